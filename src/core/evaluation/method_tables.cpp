#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "evaluation/method_statistics.h"
#include "evaluation/table_cells.h"
#include "us_ct_registration/evaluation/study_tables.h"

namespace usct {
namespace {

using RunPointers = std::vector<const StudyRun*>;

RunPointers starts_of(const std::string& method, const std::vector<StudyRun>& runs) {
  RunPointers chosen;
  for (const StudyRun& run : runs)
    if (run.method == method && run.trial.kind == TrialKind::kStart) chosen.push_back(&run);
  return chosen;
}

bool has_starts(const std::vector<StudyRun>& runs) {
  return std::any_of(runs.begin(), runs.end(),
                     [](const StudyRun& run) { return run.trial.kind == TrialKind::kStart; });
}

std::string interval_cell(const Interval& interval, double factor, int decimals) {
  if (!std::isfinite(interval.low)) return "-";
  return number_cell(factor * interval.low, decimals) + " to " +
         number_cell(factor * interval.high, decimals);
}

/// The columns of every table of methods, after those that name the row.
const std::vector<std::string> kStatisticsHeader{"cases",
                                                 "subjects",
                                                 "runs",
                                                 "refused",
                                                 "success (%)",
                                                 "95 % interval (%)",
                                                 "TRE of accepted: mean (mm)",
                                                 "95 % interval (mm)",
                                                 "median (mm)",
                                                 "95th percentile (mm)",
                                                 "worst (mm)"};

void add_statistics(std::vector<std::string> cells, const RunPointers& runs, double success_mm,
                    Table& table) {
  const RunStatistics statistics = statistics_of(runs, success_mm);
  const Summary& mm = statistics.accepted_mm;
  for (const std::string& cell :
       {std::to_string(statistics.cases), std::to_string(statistics.subjects),
        std::to_string(statistics.runs), std::to_string(statistics.refused),
        percent_cell(statistics.success_rate), interval_cell(statistics.success_interval, 100.0, 1),
        number_cell(mm.mean), interval_cell(statistics.mean_interval_mm, 1.0, 2),
        number_cell(mm.median), number_cell(mm.percentile_95), number_cell(mm.max)})
    cells.push_back(cell);
  table.rows.push_back(std::move(cells));
}

Table statistics_table(const std::string& title, std::vector<std::string> header) {
  Table table;
  table.title = title;
  table.header = std::move(header);
  table.header.insert(table.header.end(), kStatisticsHeader.begin(), kStatisticsHeader.end());
  return table;
}

/// A row for each method and each value of `name_of`.
Table table_by(const Study& study, const std::vector<StudyRun>& runs, const std::string& title,
               const std::string& what, std::string StudyRun::*name) {
  Table table = statistics_table(title, {"method", what});
  for (const StudyMethod& method : study.methods) {
    std::map<std::string, RunPointers> parts;
    for (const StudyRun* run : starts_of(method.name, runs)) parts[run->*name].push_back(run);
    for (const auto& [part, of_part] : parts)
      add_statistics({method.name, part}, of_part, study.success_mm, table);
  }
  return table;
}

RunPointers in_bin(const RunPointers& runs, std::size_t bin, const std::vector<double>& edges_mm) {
  RunPointers chosen;
  for (const StudyRun* run : runs)
    if (bin_of(run->trial.displacement_mm, edges_mm) == bin) chosen.push_back(run);
  return chosen;
}

std::string probability_cell(double p) {
  if (!std::isfinite(p)) return "-";
  return p < 1e-4 ? "< 0.0001" : number_cell(p, 4);
}

std::string success_text(const Study& study) {
  return formatted(
      "A run succeeds if it is accepted with a TRE below %g mm; rates are of all runs, "
      "refused ones too.",
      study.success_mm);
}

}  // namespace

std::vector<double> bin_edges_mm(const StudyOptions& starts, const std::vector<StudyRun>& runs) {
  double low_mm = starts.min_displacement_mm;
  double high_mm = starts.max_displacement_mm;
  if (starts.box) {
    low_mm = high_mm = 0.0;
    for (const StudyRun& run : runs)
      if (run.trial.kind == TrialKind::kStart)
        high_mm = std::max(high_mm, run.trial.displacement_mm);
    high_mm = std::max(1.0, std::ceil(high_mm / starts.bins)) * starts.bins;
  }
  std::vector<double> edges_mm;
  for (int i = 0; i <= starts.bins; ++i)
    edges_mm.push_back(low_mm + (high_mm - low_mm) * i / starts.bins);
  return edges_mm;
}

Table methods_table(const Study& study, const std::vector<StudyRun>& runs) {
  Table table = statistics_table("Methods", {"method"});
  for (const StudyMethod& method : study.methods)
    add_statistics({method.name}, starts_of(method.name, runs), study.success_mm, table);
  table.note =
      success_text(study) +
      " Intervals are percentiles of a bootstrap over subjects, since neither starts of one "
      "case nor cases of one subject are independent.";
  return table;
}

Table bins_table(const Study& study, const std::vector<StudyRun>& runs) {
  Table table = statistics_table("By displacement of the start", {"method", "start"});
  const std::vector<double> edges_mm = bin_edges_mm(study.starts, runs);
  for (const StudyMethod& method : study.methods) {
    const RunPointers of_method = starts_of(method.name, runs);
    for (std::size_t i = 1; i < edges_mm.size(); ++i)
      add_statistics({method.name, range_name(edges_mm[i - 1], edges_mm[i])},
                     in_bin(of_method, i - 1, edges_mm), study.success_mm, table);
  }
  table.note = success_text(study);
  return table;
}

Table groups_table(const Study& study, const std::vector<StudyRun>& runs) {
  return table_by(study, runs, "By group of cases", "group", &StudyRun::group);
}

Table cases_table(const Study& study, const std::vector<StudyRun>& runs) {
  Table table;
  table.title = "By case";
  table.header = {"method",      "case",
                  "runs",        "refused",
                  "success (%)", "TRE of successes: mean (mm)",
                  "STD (mm)",    "TRE of accepted: median (mm)",
                  "worst (mm)"};
  for (const StudyMethod& method : study.methods) {
    std::map<std::string, RunPointers> cases;
    for (const StudyRun* run : starts_of(method.name, runs)) cases[run->case_name].push_back(run);
    for (const auto& [name, of_case] : cases) {
      const RunStatistics statistics = statistics_of(of_case, study.success_mm);
      table.rows.push_back(
          {method.name, name, std::to_string(statistics.runs), std::to_string(statistics.refused),
           percent_cell(statistics.success_rate), number_cell(statistics.succeeded_mm.mean),
           number_cell(statistics.succeeded_mm.deviation),
           number_cell(statistics.accepted_mm.median), number_cell(statistics.accepted_mm.max)});
    }
  }
  return table;
}

Table comparisons_table(const Study& study, const std::vector<StudyRun>& runs) {
  Table table;
  table.title = "Methods compared subject by subject";
  table.header = {"first",
                  "second",
                  "subjects",
                  "TRE, second - first: mean (mm)",
                  "95 % interval (mm)",
                  "t",
                  "p",
                  "success, second - first (%)",
                  "95 % interval (%)",
                  "t",
                  "p"};
  const auto count = [](const PairedTest& test) { return std::to_string(test.subjects); };
  for (const MethodComparison& pair : compare_methods(runs, study.success_mm)) {
    const PairedTest& error = pair.error_mm;
    const PairedTest& success = pair.success;
    table.rows.push_back({pair.first, pair.second, count(success) + " (TRE: " + count(error) + ")",
                          number_cell(error.mean, 3), interval_cell(error.bootstrap, 1.0, 3),
                          number_cell(error.t), probability_cell(error.p),
                          percent_cell(success.mean), interval_cell(success.bootstrap, 100.0, 1),
                          number_cell(success.t), probability_cell(success.p)});
  }
  if (!table.rows.empty())
    table.note =
        "Paired t-tests over subjects, two-sided, and intervals of a bootstrap over subjects. The "
        "TRE of a subject is the mean over the starts of its cases from "
        "which both methods were accepted. p is not corrected for the number of pairs.";
  return table;
}

Table costs_table(const Study& study, const std::vector<StudyRun>& runs) {
  Table table;
  table.title = "Costs";
  table.header = {"method",
                  "runs",
                  "mean (s)",
                  "median (s)",
                  "95th percentile (s)",
                  "worst (s)",
                  "evaluations: mean",
                  "median",
                  "peak memory: median (MiB)",
                  "worst (MiB)"};
  for (const StudyMethod& method : study.methods) {
    std::vector<double> seconds;
    std::vector<double> evaluations;
    std::vector<double> memory_mib;
    for (const StudyRun& run : runs) {
      if (run.method != method.name) continue;
      seconds.push_back(run.seconds());
      evaluations.push_back(run.result.evaluations);
      if (run.peak_memory_mib) memory_mib.push_back(*run.peak_memory_mib);
    }
    const Summary s = summary_of(seconds);
    const Summary e = summary_of(evaluations);
    const Summary m = summary_of(memory_mib);
    table.rows.push_back({method.name, std::to_string(s.count), number_cell(s.mean),
                          number_cell(s.median), number_cell(s.percentile_95), number_cell(s.max),
                          number_cell(e.mean, 0), number_cell(e.median, 0),
                          number_cell(m.median, 0), number_cell(m.max, 0)});
  }
  table.note =
      study.how == StudyThreads::kWithinTrial
          ? "Registrations ran one after the other, each on all threads."
          : "Registrations ran at the same time, each on one thread; memory is measured only "
            "if they run one after the other.";
  return table;
}

std::vector<Table> result_tables(const Study& study, const std::vector<StudyRun>& runs) {
  std::vector<Table> tables;
  if (has_starts(runs))
    tables = {methods_table(study, runs), bins_table(study, runs), comparisons_table(study, runs),
              groups_table(study, runs), cases_table(study, runs)};
  for (const StudyMethod& method : study.methods) {
    std::vector<StudyRun> of_method;
    for (const StudyRun& run : runs)
      if (run.method == method.name) of_method.push_back(run);
    for (Table table : {negatives_table(of_method), calibration_table(of_method)}) {
      table.title += ", " + method.name;
      tables.push_back(std::move(table));
    }
  }
  tables.erase(std::remove_if(tables.begin(), tables.end(),
                              [](const Table& table) { return table.rows.empty(); }),
               tables.end());
  return tables;
}

}  // namespace usct
