#include "evaluation/method_statistics.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "random.h"
#include "us_ct_registration/evaluation/study_case.h"

namespace usct {
namespace {

constexpr std::uint64_t kBootstrapPurpose = 0x626F6F74;
constexpr double kTail = 0.025;

bool has_succeeded(const StudyRun& run, double success_mm) {
  return run.after && run.after->rigid.mean_mm < success_mm;
}

/// The values by name, without the names.
std::vector<SubjectValues> values_of(const std::map<std::string, SubjectValues>& by_subject) {
  std::vector<SubjectValues> values;
  for (const auto& [name, of_subject] : by_subject) values.push_back(of_subject);
  return values;
}

std::vector<double> means_of(const std::map<std::string, SubjectValues>& by_subject) {
  std::vector<double> means;
  for (const auto& [name, values] : by_subject)
    means.push_back(values.sum / static_cast<double>(values.count));
  return means;
}

/// The start of a run, which those of other methods share.
using StartKey = std::tuple<std::string, std::uint32_t, int>;
using RunsByStart = std::map<StartKey, const StudyRun*>;

MethodComparison compared(const std::string& first, const RunsByStart& firsts,
                          const std::string& second, const RunsByStart& seconds,
                          double success_mm) {
  std::map<std::string, SubjectValues> errors;
  std::map<std::string, SubjectValues> successes;
  for (const auto& [start, a] : firsts) {
    const auto found = seconds.find(start);
    if (found == seconds.end()) continue;
    const StudyRun* b = found->second;
    SubjectValues& success = successes[subject_of(a->case_name)];
    success.sum +=
        (has_succeeded(*b, success_mm) ? 1.0 : 0.0) - (has_succeeded(*a, success_mm) ? 1.0 : 0.0);
    ++success.count;
    if (!a->after || !b->after) continue;
    SubjectValues& error = errors[subject_of(a->case_name)];
    error.sum += b->after->rigid.mean_mm - a->after->rigid.mean_mm;
    ++error.count;
  }
  return {first, second, paired_test(means_of(errors)), paired_test(means_of(successes))};
}

}  // namespace

Interval bootstrap_over_subjects(const std::vector<SubjectValues>& subjects, std::uint64_t seed,
                                 int draws) {
  if (subjects.size() < 2) return {};
  Sequence random(seed, kBootstrapPurpose);
  std::vector<double> means;
  for (int draw = 0; draw < draws; ++draw) {
    SubjectValues drawn;
    for (std::size_t i = 0; i < subjects.size(); ++i) {
      const auto place = static_cast<std::size_t>(random.next() % subjects.size());
      drawn.sum += subjects[place].sum;
      drawn.count += subjects[place].count;
    }
    if (drawn.count > 0) means.push_back(drawn.sum / static_cast<double>(drawn.count));
  }
  if (means.empty()) return {};
  std::sort(means.begin(), means.end());
  return {quantile(means, kTail), quantile(means, 1.0 - kTail)};
}

PairedTest paired_test(const std::vector<double>& differences) {
  PairedTest test;
  test.subjects = differences.size();
  const Summary summary = summary_of(differences);
  test.mean = summary.mean;
  std::vector<SubjectValues> subjects;
  for (const double difference : differences) subjects.push_back({difference, 1});
  test.bootstrap = bootstrap_over_subjects(subjects);
  // Equal differences leave a deviation of rounding errors.
  constexpr double kRounding = 1e-12;
  if (!(summary.deviation > kRounding * std::abs(summary.mean))) return test;
  const auto count = static_cast<double>(test.subjects);
  test.t = summary.mean / (summary.deviation / std::sqrt(count));
  const boost::math::students_t_distribution<> students_t(count - 1.0);
  test.p = 2.0 * boost::math::cdf(boost::math::complement(students_t, std::abs(test.t)));
  return test;
}

RunStatistics statistics_of(const std::vector<const StudyRun*>& runs, double success_mm) {
  std::map<std::string, SubjectValues> successes;
  std::map<std::string, SubjectValues> errors;
  std::vector<double> accepted_mm;
  std::vector<double> succeeded_mm;
  std::set<std::string> cases;
  for (const StudyRun* run : runs) {
    cases.insert(run->case_name);
    SubjectValues& success = successes[subject_of(run->case_name)];
    ++success.count;
    if (has_succeeded(*run, success_mm)) {
      success.sum += 1.0;
      succeeded_mm.push_back(run->after->rigid.mean_mm);
    }
    if (!run->after) continue;
    accepted_mm.push_back(run->after->rigid.mean_mm);
    SubjectValues& error = errors[subject_of(run->case_name)];
    error.sum += accepted_mm.back();
    ++error.count;
  }
  RunStatistics statistics;
  statistics.cases = cases.size();
  statistics.subjects = successes.size();
  statistics.runs = runs.size();
  statistics.refused = runs.size() - accepted_mm.size();
  statistics.succeeded = succeeded_mm.size();
  if (!runs.empty())
    statistics.success_rate =
        static_cast<double>(statistics.succeeded) / static_cast<double>(runs.size());
  statistics.success_interval = bootstrap_over_subjects(values_of(successes));
  statistics.accepted_mm = summary_of(accepted_mm);
  statistics.mean_interval_mm = bootstrap_over_subjects(values_of(errors));
  statistics.succeeded_mm = summary_of(succeeded_mm);
  return statistics;
}

std::vector<MethodComparison> compare_methods(const std::vector<StudyRun>& runs,
                                              double success_mm) {
  std::vector<std::string> methods;
  std::map<std::string, RunsByStart> by_method;
  for (const StudyRun& run : runs) {
    if (run.trial.kind != TrialKind::kStart) continue;
    if (by_method.count(run.method) == 0) methods.push_back(run.method);
    by_method[run.method][{run.case_name, run.trial.study_seed, run.trial.index}] = &run;
  }
  std::vector<MethodComparison> comparisons;
  for (std::size_t a = 0; a < methods.size(); ++a)
    for (std::size_t b = a + 1; b < methods.size(); ++b)
      comparisons.push_back(compared(methods[a], by_method[methods[a]], methods[b],
                                     by_method[methods[b]], success_mm));
  return comparisons;
}

}  // namespace usct
