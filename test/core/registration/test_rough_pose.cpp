#include <gtest/gtest.h>

#include <map>

#include "core/io/expect_input_error.h"
#include "us_ct_registration/registration/rough_pose.h"

namespace usct::test {
namespace {

using Eigen::Vector3d;

/// The axes of a CT, LPS, point to the patient's left, to the back and to the head (DICOM PS3.3
/// C.7.6.2.1.1).
TEST(ProbeDirection, WordsAreDirectionsOfThePatient) {
  const std::map<std::string, Vector3d> words{{"left", {1, 0, 0}},      {"right", {-1, 0, 0}},
                                              {"posterior", {0, 1, 0}}, {"anterior", {0, -1, 0}},
                                              {"superior", {0, 0, 1}},  {"inferior", {0, 0, -1}}};
  for (const auto& [axial, along_beams] : words)
    for (const auto& [lateral, across_beams] : words) {
      if (along_beams.dot(across_beams) != 0.0) {
        expect_input_error(
            [&, &a = axial, &l = lateral] {
              parse_probe_direction({a, l}, "d");
            },
            {"d", "right angles"});
        continue;
      }
      const ProbeDirection found = parse_probe_direction({axial, lateral}, "d");
      EXPECT_EQ(found.axial, along_beams) << axial << " " << lateral;
      EXPECT_EQ(found.lateral, across_beams) << axial << " " << lateral;
    }
}

}  // namespace
}  // namespace usct::test
