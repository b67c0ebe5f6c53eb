#include "us_ct_registration/evaluation/study_report.h"

#include "evaluation/study_run_json.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/io/atomic_file.h"
#include "us_ct_registration/io/options/registration_options_io.h"

namespace usct {
namespace {

using io::Json;

Json names_json(const std::vector<std::filesystem::path>& paths) {
  Json names = Json::array();
  for (const auto& path : paths) names.push_back(path.string());
  return names;
}

Json starts_json(const StudyOptions& starts) {
  Json json{{"count", starts.starts}, {"seeds", starts.seeds}, {"kinds", Json::array()}};
  for (const TrialKind kind : starts.kinds) json["kinds"].push_back(kind_name(kind));
  if (starts.box) {
    json["box_mm"] = starts.box->translation_mm;
    json["box_deg"] = degrees(starts.box->rotation_rad);
  } else {
    json["min_displacement_mm"] = starts.min_displacement_mm;
    json["max_displacement_mm"] = starts.max_displacement_mm;
    json["max_rotation_deg"] = degrees(starts.max_rotation_rad);
  }
  return json;
}

Json study_json(const Study& study, const std::vector<StudyRun>& runs) {
  Json methods = Json::array();
  for (const StudyMethod& method : study.methods)
    methods.push_back({{"name", method.name},
                       {"parallel_beams_mm",
                        method.parallel_beams_mm ? Json(*method.parallel_beams_mm) : Json(nullptr)},
                       {"options", registration_options_text(method.options)}});
  Json starts = starts_json(study.starts);
  starts["bin_edges_mm"] = bin_edges_mm(study.starts, runs);
  return {{"cases", names_json(study.cases)},
          {"strangers", names_json(study.strangers)},
          {"methods", methods},
          {"starts", starts},
          {"success_mm", study.success_mm},
          {"one_at_a_time", study.how == StudyThreads::kWithinTrial}};
}

Json case_json(const StudyCase& outline) {
  const BeamGrid beams = beam_grid(outline.ultrasound.geometry);
  const Eigen::Vector3d centre = outline.centre_us_mm();
  return {{"name", outline.name},
          {"T_us_ct_true", io::pose_json(outline.T_us_ct_true)},
          {"centre_us_mm", {centre.x(), centre.y(), centre.z()}},
          {"us_samples", beams.beams.size() * static_cast<std::size_t>(beams.samples())},
          {"ct_voxels", outline.ct.grid.size.cast<std::int64_t>().prod()}};
}

Json picture_json(const StudyPicture& picture, const std::filesystem::path& seen_from) {
  return {{"method", picture.method},
          {"group", picture.group},
          {"case", picture.case_name},
          {"kind", picture.kind},
          {"start", picture.start},
          {"folder", std::filesystem::proximate(picture.folder, seen_from).string()}};
}

Json profile_json(const StudyProfile& profile) {
  Json axes = Json::array();
  for (const SimilarityProfile& axis : profile.axes) {
    Json values = Json::array();
    for (const double value : axis.values) values.push_back(io::number_json(value));
    axes.push_back({{"offsets", axis.offsets}, {"values", values}});
  }
  return {{"method", profile.method}, {"case", profile.case_name}, {"axes", axes}};
}

}  // namespace

std::string tables_markdown(const std::vector<Table>& tables) {
  std::string text;
  for (const Table& table : tables)
    text += (text.empty() ? "## " : "\n## ") + table.title + "\n\n" + markdown(table);
  return text;
}

void write_study_json(const StudyPlan& plan, const std::vector<StudyRun>& runs,
                      const StudyExtras& extras, const std::filesystem::path& path) {
  Json json;
  json["version"] = USCT_VERSION;
  json["study"] = study_json(plan.study, runs);
  json["cases"] = Json::array();
  for (const StudyCase& outline : plan.cases)
    if (!outline.is_stranger) json["cases"].push_back(case_json(outline));
  json["tables"] = Json::array();
  std::vector<Table> tables = result_tables(plan.study, runs);
  tables.push_back(costs_table(plan.study, runs));
  for (const Table& table : tables)
    json["tables"].push_back({{"title", table.title},
                              {"header", table.header},
                              {"rows", table.rows},
                              {"note", table.note}});
  json["pictures"] = Json::array();
  const std::filesystem::path folder = std::filesystem::absolute(path).parent_path();
  for (const StudyPicture& picture : extras.pictures)
    json["pictures"].push_back(picture_json(picture, folder));
  json["profiles"] = Json::array();
  for (const StudyProfile& profile : extras.profiles)
    json["profiles"].push_back(profile_json(profile));
  json["runs"] = Json::array();
  for (const StudyRun& run : runs) json["runs"].push_back(run_json(run));
  write_text(path, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

void write_study_report(const StudyPlan& plan, const std::vector<StudyRun>& runs,
                        const StudyExtras& extras, const std::filesystem::path& folder) {
  const Study& study = plan.study;
  write_text(folder / "tables.md", tables_markdown(result_tables(study, runs)));
  write_text(folder / "costs.md", tables_markdown({costs_table(study, runs)}));
  write_study_json(plan, runs, extras, folder / "study.json");
}

}  // namespace usct
