#include "us_ct_registration/registration/measures.h"

#include <algorithm>

#include "us_ct_registration/error.h"

namespace usct {

const std::vector<MeasureField>& measure_fields() {
  static const std::vector<MeasureField> fields = {
      {"overlap", &Measures::overlap},
      {"displacement_mm", &Measures::displacement_mm},
      {"disagreement_mm", &Measures::disagreement_mm},
      {"mirror_ratio", &Measures::mirror_ratio},
      {"mirror_advantage", &Measures::mirror_advantage},
      {"chance_ratio", &Measures::chance_ratio},
      {"chance_advantage", &Measures::chance_advantage},
      {"rival_ratio", &Measures::rival_ratio},
      {"rival_advantage", &Measures::rival_advantage},
      {"parts_mm", &Measures::parts_mm},
      {"ridge_parts_mm", &Measures::ridge_parts_mm},
      {"local_agreement", &Measures::local_agreement},
      {"mirror_agreement", &Measures::mirror_agreement},
      {"local_advantage", &Measures::local_advantage},
      {"tissue_motion_mm", &Measures::tissue_motion_mm},
      {"wide_motion_mm", &Measures::wide_motion_mm},
      {"deformation_mm", &Measures::deformation_mm},
      {"wrong_probability", &Measures::wrong_probability},
      {"expected_error_mm", &Measures::expected_error_mm},
      {"error_bound_mm", &Measures::error_bound_mm},
      {"depth_error", &Measures::depth_error},
      {"sweep_error", &Measures::sweep_error},
      {"sweep_unevenness", &Measures::sweep_unevenness},
      {"errors_ratio", &Measures::errors_ratio},
      {"errors_advantage", &Measures::errors_advantage},
      {"sweep_motion_mm", &Measures::sweep_motion_mm},
  };
  return fields;
}

std::map<std::string, double> by_name(const Measures& measures) {
  std::map<std::string, double> values;
  for (const MeasureField& field : measure_fields())
    if (const std::optional<double>& value = measures.*field.value) values[field.name] = *value;
  return values;
}

Measures measures_from(const std::map<std::string, double>& values, const std::string& source) {
  Measures measures;
  for (const auto& [name, value] : values) {
    const std::vector<MeasureField>& fields = measure_fields();
    const auto found =
        std::find_if(fields.begin(), fields.end(),
                     [&known = name](const auto& field) { return known == field.name; });
    if (found == fields.end()) throw InputError(source, "measure '" + name + "' is unknown");
    measures.*found->value = value;
  }
  return measures;
}

}  // namespace usct
