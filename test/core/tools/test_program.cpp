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

/// A program that ignores the signal, gets it and goes on.
void ignore(int signal) {
  std::signal(signal, SIG_IGN);
  ::_exit(run_as_program([signal] {
    ::kill(::getpid(), signal);
    ::usleep(100'000);
    return 7;
  }));
}

TEST(Program, GoesOnIfTheSignalIsIgnoredAsByNohup) {
  EXPECT_EXIT(ignore(SIGHUP), testing::ExitedWithCode(7), "");
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
