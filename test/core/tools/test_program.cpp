#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "core/io/temporary_folder.h"
#include "tools/program.h"
#include "us_ct_registration/io/atomic_file.h"
#include "us_ct_registration/io/whole_folder.h"

namespace usct::tools {
namespace {

namespace fs = std::filesystem;

int run_as_program(const Run& run) {
  CLI::App app;
  app.add_subcommand("write");
  std::string program = "program";
  std::string command = "write";
  char* arguments[] = {program.data(), command.data()};
  return run_program(app, run, 2, arguments);
}

/// A program that the signal reaches while it writes a file and a folder.
void run_until(int signal, const fs::path& outputs) {
  const Run run = [&] {
    write_whole_folder(outputs / "folder", [&](const fs::path& made) {
      std::ofstream(made / "part") << "a part";
      write_atomically(outputs / "file", [&](const fs::path& temporary) {
        std::ofstream(temporary) << "a part";
        ::kill(::getpid(), signal);
        for (;;) ::pause();
      });
    });
    return 0;
  };
  run_as_program(run);
}

TEST(Program, GoesOnIfTheSignalIsIgnoredAsByNohup) {
  const auto hang_up = [] {
    std::signal(SIGHUP, SIG_IGN);
    const Run run = [] {
      ::kill(::getpid(), SIGHUP);
      ::usleep(100'000);
      return 7;
    };
    ::_exit(run_as_program(run));
  };
  EXPECT_EXIT(hang_up(), testing::ExitedWithCode(7), "");
}

TEST(Program, LeavesNothingBehindWhenASignalEndsIt) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const test::TemporaryFolder outputs;
    EXPECT_EXIT(run_until(signal, outputs.path()), testing::KilledBySignal(signal), "");
    EXPECT_TRUE(fs::is_empty(outputs.path())) << signal;
  }
}

}  // namespace
}  // namespace usct::tools
