#include "us_ct_registration/evaluation/study_work.h"

#include <chrono>
#include <cmath>
#include <limits>

#include "evaluation/study_results.h"
#include "text.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using Runs = std::vector<std::optional<StudyRun>>;

/// Estimates the time that the open runs of a study will take, from those that are done.
class TimeLeft {
 public:
  TimeLeft(std::size_t methods, int at_once) : methods_(methods), at_once_(at_once) {}

  void expect(std::size_t method) { ++methods_[method].open; }
  /// Adds the time of a run that was done before.
  void learn(std::size_t method, double seconds) {
    ++methods_[method].done;
    methods_[method].seconds += seconds;
  }
  void finish(std::size_t method, double seconds) {
    --methods_[method].open;
    learn(method, seconds);
  }
  /// Methods of which none is done count like the mean of all others.
  double seconds() const {
    double seconds = 0.0;
    double done = 0.0;
    for (const Method& method : methods_) {
      seconds += method.seconds;
      done += method.done;
    }
    double left = 0.0;
    for (const Method& method : methods_)
      if (method.open > 0)
        left += method.open * (method.done > 0 ? method.seconds / method.done : seconds / done);
    return left / at_once_;
  }

 private:
  struct Method {
    double done = 0.0;
    double open = 0.0;
    double seconds = 0.0;
  };
  std::vector<Method> methods_;
  double at_once_;
};

/// The runs of the shard that are not done.
std::vector<std::size_t> open_runs(const Runs& runs, const StudyShard& shard) {
  std::vector<std::size_t> open;
  for (auto i = static_cast<std::size_t>(shard.number - 1); i < runs.size();
       i += static_cast<std::size_t>(shard.count))
    if (!runs[i]) open.push_back(i);
  return open;
}

/// The runs of a study as they come.
class Ledger {
 public:
  Ledger(const StudyPlan& plan, const StudyWork& work, Runs runs)
      : plan_(plan),
        work_(work),
        runs_(std::move(runs)),
        open_(open_runs(runs_, work.shard)),
        time_left_(plan.study.methods.size(),
                   plan.study.how == StudyThreads::kOverTrials ? work.threads : 1),
        file_(work.folder / "runs" /
              (std::to_string(work.shard.number) + "_of_" + std::to_string(work.shard.count) +
               ".jsonl")) {
    for (std::size_t i = 0; i < runs_.size(); ++i)
      if (runs_[i]) time_left_.learn(plan.runs[i].method, runs_[i]->seconds());
    for (const std::size_t i : open_) time_left_.expect(plan.runs[i].method);
  }

  const std::vector<std::size_t>& open() const { return open_; }

  void take(std::size_t index, StudyRun run) {
    const PlannedRun& planned = plan_.runs[index];
    run.method = plan_.study.methods[planned.method].name;
    run.result.options.clear();  // those of the method, in every run
    if (!work_.folder.empty()) append_result(file_, run, planned.fingerprint);
    time_left_.finish(planned.method, run.seconds());
    runs_[index] = std::move(run);
    ++done_;
    report();
  }
  void report() const {
    if (work_.progress) work_.progress({done_, open_.size(), time_left_.seconds()});
  }
  Runs release() { return std::move(runs_); }

 private:
  const StudyPlan& plan_;
  const StudyWork& work_;
  Runs runs_;
  std::vector<std::size_t> open_;
  TimeLeft time_left_;
  fs::path file_;
  std::size_t done_ = 0;
};

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error)
    throw InputError(folder.string(), "cannot be made a folder of results: " + error.message());
}

}  // namespace

void StudyShard::validate(const std::string& source) const {
  if (number < 1 || number > count)
    throw InputError(source, "is " + std::to_string(number) + "/" + std::to_string(count) +
                                 ", must be K/N with 1 <= K <= N");
}

StudyShard parse_shard(const std::string& text, const std::string& source) {
  const std::vector<std::string_view> parts = split(text, '/');
  if (parts.size() != 2)
    throw InputError(source, "is " + in_quotes(text) + ", must be K/N with 1 <= K <= N");
  const StudyShard shard{parse_int(parts[0], source, "K"), parse_int(parts[1], source, "N")};
  shard.validate(source);
  return shard;
}

Runs carry_out(const StudyPlan& plan, const CaseSource& cases, const std::vector<Register>& methods,
               const StudyWork& work) {
  work.shard.validate("shard");
  Runs known(plan.runs.size());
  if (!work.folder.empty()) {
    make_folder(work.folder / "runs");
    known = read_results(work.folder / "runs", plan, work.warn);
  }
  Ledger ledger(plan, work, std::move(known));
  std::vector<RunOrder> orders;
  for (const std::size_t i : ledger.open())
    orders.push_back({&plan.runs[i].trial, &methods[plan.runs[i].method]});
  ledger.report();
  run_trials(cases, orders, plan.study.how, work.threads, [&](std::size_t order, StudyRun&& run) {
    ledger.take(ledger.open()[order], std::move(run));
  });
  return ledger.release();
}

}  // namespace usct
