#include "us_ct_registration/evaluation/study_tables.h"

#include "evaluation/table_cells.h"
#include "us_ct_registration/evaluation/study_statistics.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct {
namespace {

std::string line_of_cells(const std::vector<std::string>& cells) {
  std::string line = "|";
  for (const std::string& cell : cells) line += " " + cell + " |";
  return line + "\n";
}

double mean_step(const std::vector<double>& table) {
  return table.size() < 2
             ? 0.0
             : std::abs(table.back() - table.front()) / static_cast<double>(table.size() - 1);
}

/// The size in samples x lines x frames.
std::string size_of(const ScanGeometry& geometry) {
  return formatted("(%d, %d, %d)", geometry.samples(), geometry.lines(), geometry.frames());
}

std::string spacing_of(const ScanGeometry& geometry) {
  const bool curved = std::holds_alternative<CurvilinearArray>(geometry.array);
  const double line = mean_step(line_table(geometry.array));
  std::string spacing =
      formatted("(%.2f mm, ", geometry.axial.spacing_mm) +
      (curved ? formatted("%.2f deg, ", line / kDegree) : formatted("%.2f mm, ", line));
  if (const auto* motor = std::get_if<MotorSweep>(&geometry.motion))
    return spacing + formatted("%.2f deg)", mean_step(motor->frame_angles_rad) / kDegree);
  return spacing + "tracked)";
}

/// Size and spacing; those of the Cartesian volume if the beams are parallel.
std::pair<std::string, std::string> size_and_spacing(const PreScanVolume& ultrasound,
                                                     const BeamOptions& beams) {
  if (!beams.parallel_beams_mm)
    return {size_of(ultrasound.geometry), spacing_of(ultrasound.geometry)};
  const Grid grid = *beams_of(ultrasound, beams).grid;
  const Eigen::Vector3d& mm = grid.spacing_mm;
  return {formatted("(%d, %d, %d)", grid.size.x(), grid.size.y(), grid.size.z()),
          formatted("(%.2f mm, %.2f mm, %.2f mm)", mm.x(), mm.y(), mm.z())};
}

}  // namespace

std::string markdown(const Table& table) {
  std::string text;
  if (!table.rows.empty()) {
    text = line_of_cells(table.header) + "|";
    for (std::size_t i = 0; i < table.header.size(); ++i) text += "---|";
    text += "\n";
    for (const std::vector<std::string>& row : table.rows) text += line_of_cells(row);
  }
  if (!table.note.empty()) text += (table.rows.empty() ? "" : "\n") + table.note + "\n";
  return text;
}

Table accuracy_table(const std::vector<StudyRun>& runs, const std::vector<double>& bin_edges_mm) {
  const std::vector<GroupStatistics> groups = statistics_by_group(runs, bin_edges_mm);
  Table table;
  table.title = "Accuracy by group";
  if (groups.empty()) return table;
  table.header = {"group",
                  "runs",
                  "refused",
                  "TRE of successes, mean / median / STD (mm)",
                  "TRE of accepted, mean / median / STD (mm)",
                  "physical error of accepted, mean / median / worst (mm)",
                  "< 2 mm (%)",
                  "< 3 mm (%)",
                  "< 5 mm (%)",
                  "worst accepted (mm)",
                  "median time (s)"};
  for (const DisplacementBin& bin : groups.front().bins)
    table.header.push_back("from " + range_name(bin.low_mm, bin.high_mm) + " (%)");
  const auto usual = [](const Summary& errors) {
    return number_cell(errors.mean) + " / " + number_cell(errors.median) + " / " +
           number_cell(errors.deviation);
  };
  const auto worst = [](const Summary& errors) {
    return number_cell(errors.mean) + " / " + number_cell(errors.median) + " / " +
           number_cell(errors.max);
  };
  for (const GroupStatistics& group : groups) {
    std::vector<std::string> cells{group.name,
                                   std::to_string(group.runs),
                                   std::to_string(group.refused),
                                   usual(group.succeeded),
                                   usual(group.accepted),
                                   worst(group.accepted_physical)};
    for (const double share : group.share_below) cells.push_back(percent_cell(share));
    cells.push_back(number_cell(group.accepted.max));
    cells.push_back(number_cell(group.seconds.median));
    for (const DisplacementBin& bin : group.bins)
      cells.push_back(bin.runs == 0 ? "-"
                                    : percent_cell(static_cast<double>(bin.succeeded) /
                                                   static_cast<double>(bin.runs)) +
                                          formatted(" of %zu", bin.runs));
    table.rows.push_back(cells);
  }
  return table;
}

Table thesis_table(const StudyPlan& plan, const CaseSource& cases,
                   const std::vector<StudyRun>& runs, const BeamOptions& beams) {
  Table table;
  table.title = "As tables 5.1 and 5.2 of the thesis";
  table.header = {"phantom",  "tests",   "converged (%)", "mean TRE (mm)",
                  "STD (mm)", "US size", "US spacing",    "avg. time/test (s)"};
  for (const GroupStatistics& statistics : statistics_by_case(runs, {}))
    for (std::size_t i = 0; i < plan.cases.size(); ++i)
      if (plan.cases[i].name == statistics.name) {
        const auto [size, spacing] = size_and_spacing(cases(i)->ultrasound, beams);
        table.rows.push_back({statistics.name, std::to_string(statistics.runs),
                              percent_cell(statistics.success_rate()),
                              number_cell(statistics.succeeded.mean),
                              number_cell(statistics.succeeded.deviation), size, spacing,
                              number_cell(statistics.seconds.mean)});
      }
  return table;
}

Table negatives_table(const std::vector<StudyRun>& runs) {
  const std::vector<NegativeStatistics> kinds = negative_statistics(runs);
  Table table;
  table.title = "Negative trials";
  if (kinds.empty()) return table;
  table.header = {"negative trials", "runs",
                  "refused",         "accepted, right",
                  "accepted, wrong", "wrong: share, 95 % upper bound (%)"};
  table.note =
      "Right: a mean TRE below 5 mm, whatever success_mm is. Bounds are for independent trials; "
      "those of one case are not, so that a bound over cases is "
      "wider.";
  NegativeStatistics all;
  const auto refusals = [](const NegativeStatistics& kind) {
    std::size_t count = 0;
    std::string by_status;
    for (const auto& [status, runs_of_status] : kind.refused) {
      count += runs_of_status;
      by_status += (by_status.empty() ? "" : ", ") + status + " " + std::to_string(runs_of_status);
    }
    return std::to_string(count) + (by_status.empty() ? "" : " (" + by_status + ")");
  };
  const auto add_row = [&](const std::string& name, const NegativeStatistics& kind) {
    table.rows.push_back(
        {name, std::to_string(kind.runs), refusals(kind),
         has_truth(kind.kind) ? std::to_string(kind.accepted_right) : "-",
         std::to_string(kind.accepted_wrong),
         percent_cell(static_cast<double>(kind.accepted_wrong) / static_cast<double>(kind.runs)) +
             ", " + number_cell(100.0 * kind.wrong_share_bound())});
  };
  all.kind = TrialKind::kFarStart;
  for (const NegativeStatistics& kind : kinds) {
    add_row(kind_name(kind.kind), kind);
    all.runs += kind.runs;
    all.accepted_right += kind.accepted_right;
    all.accepted_wrong += kind.accepted_wrong;
    for (const auto& [status, count] : kind.refused) all.refused[status] += count;
  }
  add_row("all", all);
  return table;
}

Table calibration_table(const std::vector<StudyRun>& runs) {
  const Calibration calibration = calibration_of(runs);
  Table table;
  table.title = "Expected against physical errors";
  if (calibration.all.runs == 0) {
    table.note = "No accepted run tells an expected error.";
    return table;
  }
  table.header = {"expected RMS error (mm)",     "runs",
                  "mean expected (mm)",          "mean physical (mm)",
                  "RMS physical / RMS expected", "physical <= 2 x expected (%)"};
  const auto add_row = [&](const std::string& name, const CalibrationBin& bin) {
    table.rows.push_back({name, std::to_string(bin.runs), number_cell(bin.mean_expected_mm),
                          number_cell(bin.mean_true_mm), number_cell(bin.rms_ratio),
                          percent_cell(bin.share_within_twice)});
  };
  for (const CalibrationBin& bin : calibration.bins)
    add_row(bin.high_mm < 1e6 ? formatted("%g-%g", bin.low_mm, bin.high_mm)
                              : formatted("%g and more", bin.low_mm),
            bin);
  add_row("all", calibration.all);
  table.note = "Rank correlation (Spearman) of expected and physical errors: " +
               number_cell(calibration.rank_correlation);
  return table;
}

}  // namespace usct
