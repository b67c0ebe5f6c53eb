#include "us_ct_registration/evaluation/study_report.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "io/bytes.h"
#include "us_ct_registration/evaluation/study_statistics.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct {
namespace {

using Json = nlohmann::ordered_json;

std::string number(double value, int decimals = 2) {
  return std::isfinite(value) ? formatted("%.*f", decimals, value) : "-";
}

std::string percent(double share) { return number(100.0 * share, 1); }

std::string row(const std::vector<std::string>& cells) {
  std::string line = "|";
  for (const std::string& cell : cells) line += " " + cell + " |";
  return line + "\n";
}

std::string header(const std::vector<std::string>& cells) {
  std::string rule = "|";
  for (std::size_t i = 0; i < cells.size(); ++i) rule += "---|";
  return row(cells) + rule + "\n";
}

std::string bin_name(const DisplacementBin& bin) {
  return formatted("%g-%g mm", bin.low_mm, bin.high_mm);
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

Json number_json(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json errors_json(const TargetErrors& errors) {
  return {{"mean", errors.mean_mm},
          {"rms", errors.rms_mm},
          {"median", errors.median_mm},
          {"max", errors.max_mm}};
}

Json rigid_json(const PoseErrors* errors) {
  return errors == nullptr ? Json(nullptr) : errors_json(errors->rigid);
}

Json physical_json(const PoseErrors* errors) {
  return errors == nullptr ? Json(nullptr) : errors_json(errors->physical);
}

template <typename T>
const T* pointer_to(const std::optional<T>& value) {
  return value ? &*value : nullptr;
}

Json pose_json(const Eigen::Isometry3d& T) {
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = T.matrix();
  return std::vector<double>(rows.data(), rows.data() + rows.size());
}

Json candidates_json(const StudyRun& run) {
  Json list = Json::array();
  for (std::size_t i = 0; i < run.result.candidates.size(); ++i) {
    const PoseErrors* errors = run.candidates.empty() ? nullptr : &run.candidates[i];
    list.push_back({{"similarity", number_json(run.result.candidates[i].similarity)},
                    {"overlap", number_json(run.result.candidates[i].overlap)},
                    {"tre_mm", rigid_json(errors)},
                    {"physical_mm", physical_json(errors)}});
  }
  return list;
}

Json expected_json(const StudyRun& run) {
  if (!run.expected) return nullptr;
  return {{"rms", run.expected->rms_mm}, {"max", run.expected->max_mm}};
}

Json run_json(const StudyRun& run) {
  return {{"case", run.case_name},
          {"group", run.group},
          {"ct_case", run.ct_case_name},
          {"kind", kind_name(run.trial.kind)},
          {"start", run.trial.index},
          {"displacement_mm", run.trial.displacement_mm},
          {"T_us_ct_initial", pose_json(run.trial.T_us_ct_initial)},
          {"status", status_name(run.result.status)},
          {"message", run.result.message},
          {"T_us_ct", run.accepted() ? pose_json(*run.result.T_us_ct) : Json(nullptr)},
          {"before_tre_mm", rigid_json(pointer_to(run.before))},
          {"before_physical_mm", physical_json(pointer_to(run.before))},
          {"tre_mm", rigid_json(pointer_to(run.after))},
          {"physical_mm", physical_json(pointer_to(run.after))},
          {"expected_tre_mm", expected_json(run)},
          {"similarity", number_json(run.result.similarity)},
          {"overlap", number_json(run.result.overlap)},
          {"candidates", candidates_json(run)},
          {"evaluations", run.result.evaluations},
          {"measures", by_name(run.result.measures)},
          {"seconds", run.result.seconds},
          {"options", run.result.options}};
}

}  // namespace

std::string accuracy_markdown(const std::vector<StudyRun>& runs,
                              const std::vector<double>& bin_edges_mm) {
  const std::vector<GroupStatistics> groups = statistics_by_group(runs, bin_edges_mm);
  if (groups.empty()) return "";
  std::vector<std::string> titles{"group",
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
    titles.push_back("from " + bin_name(bin) + " (%)");
  const auto spread = [](const Spread& errors) {
    return number(errors.mean) + " / " + number(errors.median) + " / " + number(errors.deviation);
  };
  const auto worst = [](const Spread& errors) {
    return number(errors.mean) + " / " + number(errors.median) + " / " + number(errors.max);
  };
  std::string table = header(titles);
  for (const GroupStatistics& group : groups) {
    std::vector<std::string> cells{group.name,
                                   std::to_string(group.runs),
                                   std::to_string(group.refused),
                                   spread(group.succeeded),
                                   spread(group.accepted),
                                   worst(group.accepted_physical)};
    for (const double share : group.share_below) cells.push_back(percent(share));
    cells.push_back(number(group.accepted.max));
    cells.push_back(number(group.seconds.median));
    for (const DisplacementBin& bin : group.bins)
      cells.push_back(bin.runs == 0 ? "-"
                                    : percent(static_cast<double>(bin.succeeded) /
                                              static_cast<double>(bin.runs)) +
                                          formatted(" of %zu", bin.runs));
    table += row(cells);
  }
  return table;
}

std::string thesis_markdown(const std::vector<StudyCase>& cases, const std::vector<StudyRun>& runs,
                            const BeamOptions& beams) {
  std::string table = header({"phantom", "tests", "converged (%)", "mean TRE (mm)", "STD (mm)",
                              "US size", "US spacing", "avg. time/test (s)"});
  for (const GroupStatistics& statistics : statistics_by_case(runs, {}))
    for (const StudyCase& study_case : cases)
      if (study_case.name == statistics.name) {
        const auto [size, spacing] = size_and_spacing(study_case.ultrasound, beams);
        table += row({statistics.name, std::to_string(statistics.runs),
                      percent(statistics.success_rate()), number(statistics.succeeded.mean),
                      number(statistics.succeeded.deviation), size, spacing,
                      number(statistics.seconds.mean)});
      }
  return table;
}

std::string negatives_markdown(const std::vector<StudyRun>& runs) {
  const std::vector<NegativeStatistics> kinds = negative_statistics(runs);
  if (kinds.empty()) return "";
  std::string table = header({"negative trials", "runs", "refused", "accepted, right",
                              "accepted, wrong", "wrong: share, 95 % upper bound (%)"});
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
  const auto counts = [&](const std::string& name, const NegativeStatistics& kind) {
    return row({name, std::to_string(kind.runs), refusals(kind),
                has_truth(kind.kind) ? std::to_string(kind.accepted_right) : "-",
                std::to_string(kind.accepted_wrong),
                percent(static_cast<double>(kind.accepted_wrong) / static_cast<double>(kind.runs)) +
                    ", " + number(100.0 * kind.wrong_share_bound())});
  };
  all.kind = TrialKind::kFarStart;
  for (const NegativeStatistics& kind : kinds) {
    table += counts(kind_name(kind.kind), kind);
    all.runs += kind.runs;
    all.accepted_right += kind.accepted_right;
    all.accepted_wrong += kind.accepted_wrong;
    for (const auto& [status, count] : kind.refused) all.refused[status] += count;
  }
  return table + counts("all", all);
}

std::string calibration_markdown(const std::vector<StudyRun>& runs) {
  const Calibration calibration = calibration_of(runs);
  if (calibration.all.runs == 0) return "No accepted run tells an expected error.\n";
  std::string table =
      header({"expected RMS error (mm)", "runs", "mean expected (mm)", "mean physical (mm)",
              "RMS physical / RMS expected", "physical <= 2 x expected (%)"});
  const auto cells = [](const std::string& name, const CalibrationBin& bin) {
    return row({name, std::to_string(bin.runs), number(bin.mean_expected_mm),
                number(bin.mean_true_mm), number(bin.rms_ratio), percent(bin.share_within_twice)});
  };
  for (const CalibrationBin& bin : calibration.bins)
    table += cells(bin.high_mm < 1e6 ? formatted("%g-%g", bin.low_mm, bin.high_mm)
                                     : formatted("%g and more", bin.low_mm),
                   bin);
  return table + cells("all", calibration.all) + "\nRank correlation (Spearman) of expected and " +
         "physical errors: " + number(calibration.rank_correlation) + "\n";
}

void write_study_json(const std::vector<StudyRun>& runs,
                      const std::map<std::string, std::string>& study,
                      const std::filesystem::path& path) {
  Json json;
  json["version"] = USCT_VERSION;
  json["study"] = study;
  json["runs"] = Json::array();
  for (const StudyRun& run : runs) json["runs"].push_back(run_json(run));
  io::write_text(path, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace usct
