#include <CLI/CLI.hpp>
#include <cstdio>
#include <iterator>

#include "core/io/temporary_folder.h"
#include "trial.h"
#include "us_ct_registration/threads.h"

/// Reads mutated files with every reader of files from outside. Exit status 1 if anything went
/// wrong. The table goes to standard output as Markdown, what went wrong to standard error.
namespace usct::fuzz {
namespace {

std::vector<Reader> all_readers() {
  const test::TemporaryFolder folder;
  std::vector<Reader> readers;
  for (const auto& make : {readers_of_ct, readers_of_ultrasound, readers_of_results}) {
    std::vector<Reader> some = make(folder.path());
    std::move(some.begin(), some.end(), std::back_inserter(readers));
  }
  return readers;
}

void print(const Reader& reader, const Trial& trial) {
  const double runs = static_cast<double>(trial.runs);
  std::printf("| %s | %llu | %.1f | %.1f | %zu | %.1f | %zu |\n", reader.name.c_str(),
              static_cast<unsigned long long>(trial.runs), 1e6 * trial.seconds / runs,
              100.0 * static_cast<double>(trial.accepted) / runs, trial.refusals, trial.growth_mib,
              trial.faults.size());
  for (const std::string& fault : trial.faults)
    std::fprintf(stderr, "%s: %s\n", reader.name.c_str(), fault.c_str());
  std::fflush(stdout);
}

int run(const TrialOptions& options, const std::string& only) {
  std::printf(
      "| reader | runs | us per run | accepted, %% | kinds of refusal | growth, MiB | faults |\n");
  std::printf("|---|---|---|---|---|---|---|\n");
  bool good = true;
  bool any = false;
  for (const Reader& reader : all_readers()) {
    // The HDF5 library itself crashes and hangs on some damaged files.
    if (only.empty() && reader.file == "transform.h5") continue;
    if (reader.name.find(only) == std::string::npos) continue;
    any = true;
    const Trial trial = run_trial(reader, options);
    print(reader, trial);
    good = good && trial.faults.empty();
  }
  if (!any) std::fprintf(stderr, "no reader has '%s' in its name\n", only.c_str());
  return good && any ? 0 : 1;
}

}  // namespace
}  // namespace usct::fuzz

int main(int argc, char** argv) {
  usct::fuzz::TrialOptions options;
  std::string only;
  CLI::App app{"test_fuzz_readers: mutated files for every reader"};
  app.add_option("--runs", options.runs, "runs of each reader")->capture_default_str();
  app.add_option("--seconds", options.seconds, "longest time for each reader, s");
  app.add_option("--seed", options.seed, "of the mutations")->capture_default_str();
  app.add_option("--only", only,
                 "only readers whose names contain this text; HDF5 files are read only so");
  app.add_option("--keep", options.keep, "folder that gets the files that went wrong")
      ->check(CLI::ExistingDirectory);
  CLI11_PARSE(app, argc, argv);
  const usct::ThreadCount threads(1);  // files are too small to share
  return usct::fuzz::run(options, only);
}
