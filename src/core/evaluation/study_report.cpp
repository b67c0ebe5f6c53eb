#include "us_ct_registration/evaluation/study_report.h"

#include "evaluation/study_run_json.h"
#include "io/bytes.h"
#include "us_ct_registration/geometry/angles.h"
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

}  // namespace

std::string tables_markdown(const std::vector<Table>& tables) {
  std::string text;
  for (const Table& table : tables)
    text += (text.empty() ? "## " : "\n## ") + table.title + "\n\n" + markdown(table);
  return text;
}

void write_study_json(const Study& study, const std::vector<StudyRun>& runs,
                      const std::vector<StudyPicture>& pictures,
                      const std::filesystem::path& path) {
  Json json;
  json["version"] = USCT_VERSION;
  json["study"] = study_json(study, runs);
  json["tables"] = Json::array();
  std::vector<Table> tables = result_tables(study, runs);
  tables.push_back(costs_table(study, runs));
  for (const Table& table : tables)
    json["tables"].push_back({{"title", table.title},
                              {"header", table.header},
                              {"rows", table.rows},
                              {"note", table.note}});
  json["pictures"] = Json::array();
  const std::filesystem::path folder = std::filesystem::absolute(path).parent_path();
  for (const StudyPicture& picture : pictures)
    json["pictures"].push_back(
        {{"method", picture.method},
         {"group", picture.group},
         {"case", picture.case_name},
         {"kind", picture.kind},
         {"start", picture.start},
         {"folder", std::filesystem::proximate(picture.folder, folder).string()}});
  json["runs"] = Json::array();
  for (const StudyRun& run : runs) json["runs"].push_back(run_json(run));
  io::write_text(path, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

void write_study_report(const Study& study, const std::vector<StudyRun>& runs,
                        const std::vector<StudyPicture>& pictures,
                        const std::filesystem::path& folder) {
  io::write_text(folder / "tables.md", tables_markdown(result_tables(study, runs)));
  io::write_text(folder / "costs.md", tables_markdown({costs_table(study, runs)}));
  write_study_json(study, runs, pictures, folder / "study.json");
}

}  // namespace usct
