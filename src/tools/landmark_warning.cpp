#include "landmark_warning.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <optional>

#include "inputs.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/evaluation/fiducial_matching.h"
#include "us_ct_registration/evaluation/study_case.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/registration/landmarks.h"

namespace usct::tools {
namespace {

using Points = std::vector<Eigen::Vector3d>;

/// Two landmarks of which an exchange makes the others fit best, in words; empty if none helps.
std::string exchange_words(Points us_mm, const Points& ct_mm, double most_mm) {
  std::string words;
  for (std::size_t i = 0; i < us_mm.size(); ++i)
    for (std::size_t j = i + 1; j < us_mm.size(); ++j) {
      std::swap(us_mm[i], us_mm[j]);
      const double mm = align_landmarks(us_mm, ct_mm).residual_mm;
      std::swap(us_mm[i], us_mm[j]);
      if (mm >= most_mm) continue;
      most_mm = mm;
      words = formatted("with points %zu and %zu of one file exchanged it would be %.2f mm", i + 1,
                        j + 1, mm);
    }
  return words;
}

/// The order in which landmarks fit better than `most_mm`, in words; empty if there is none. All
/// orders are tried of few landmarks, exchanges of two of many.
std::string order_words(const Points& us_mm, const Points& ct_mm, double most_mm) {
  constexpr std::size_t kFew = 8;
  if (us_mm.size() > kFew) return exchange_words(us_mm, ct_mm, most_mm);
  try {
    const FiducialMatch best = match_fiducials(us_mm, ct_mm, most_mm).fitting.front();
    if (best.fre_mm >= most_mm) return "";
    std::string order;
    for (const auto& [us, ct] : best.pairs)
      order += (order.empty() ? "" : ", ") + std::to_string(ct + 1);
    return formatted("with the points of the CT in the order %s it would be %.2f mm", order.c_str(),
                     best.fre_mm);
  } catch (const InputError&) {
    return "";  // no order fits
  }
}

/// Landmarks of a kidney lie centimetres apart; in metres, hundredths.
void warn_of_metres(const LandmarkFile& file) {
  constexpr double kLeastMm = 1.0;
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point : file.points_mm) box.extend(point);
  const double extent_mm = box.diagonal().norm();
  if (extent_mm < kLeastMm)
    print_warnings({formatted("%s: all points lie within %.3g mm: are they in metres?",
                              file.path.c_str(), extent_mm)});
}

/// The mean of the points, alone.
Points middle(const Points& points_mm) {
  const Eigen::Vector3d sum =
      std::accumulate(points_mm.begin(), points_mm.end(), Eigen::Vector3d(0, 0, 0));
  return Points(1, sum / static_cast<double>(points_mm.size()));
}

/// The error of a landmark that does not lie in its image, if there is one.
std::optional<InputError> misplaced(const LandmarkFile& ct, const LandmarkFile& us,
                                    const CtVolume& ct_image, const BeamGrid& beams) {
  try {
    require_in_ct(ct.points_mm, ct_image, ct.path);
    require_in_ultrasound(us.points_mm, beams, us.path);
  } catch (const InputError& error) {
    return InputError(error.source(), error.violation() +
                                          "; of the two files of --landmarks, the first must be "
                                          "of the CT, the second of the ultrasound");
  }
  return std::nullopt;
}

}  // namespace

void warn_of_landmarks(const LandmarkFile& ct, const LandmarkFile& us, double fre_mm) {
  warn_of_metres(ct);
  warn_of_metres(us);
  constexpr double kMostMm = 5.0;
  constexpr double kUsualMm = 1.0;  // the error of a careful hand
  const std::string order =
      fre_mm > kUsualMm ? order_words(us.points_mm, ct.points_mm, 0.5 * fre_mm) : "";
  if (fre_mm <= kMostMm && order.empty()) return;
  print_warnings({formatted("%s and %s do not fit each other (FRE %.2f mm): ", ct.path.c_str(),
                            us.path.c_str(), fre_mm) +
                  (order.empty() ? "" : order + ": ") +
                  "check that both files have the same points, in mm, in the same order"});
}

void require_in_images(const LandmarkFile& ct, const LandmarkFile& us, const CtVolume& ct_image,
                       const BeamGrid& beams) {
  if (const auto error = misplaced(ct, us, ct_image, beams)) throw *error;
}

void warn_of_places(const LandmarkFile& ct, const LandmarkFile& us, const CtVolume& ct_image,
                    const BeamGrid& beams) {
  const std::optional<InputError> error = misplaced(ct, us, ct_image, beams);
  if (!error) return;
  const Points middle_ct_mm = middle(ct.points_mm);
  const Points middle_us_mm = middle(us.points_mm);
  if (misplaced({ct.path, middle_ct_mm}, {us.path, middle_us_mm}, ct_image, beams) &&
      !misplaced({ct.path, middle_us_mm}, {us.path, middle_ct_mm}, ct_image, beams))
    throw *error;
  print_warnings({error->what()});
}

void warn_of_targets(const LandmarkFile& us, const BeamGrid& beams) {
  if (us.points_mm.size() > 1) warn_of_metres(us);
  const Eigen::AlignedBox3d box = beams.bounding_box();
  constexpr double kMostMm = 10.0;  // a kidney may reach a little beyond the ultrasound
  std::size_t outside = 0;
  double farthest_mm = 0.0;
  for (const Eigen::Vector3d& point : us.points_mm) {
    const double distance_mm = box.exteriorDistance(point);
    if (distance_mm > kMostMm) ++outside;
    farthest_mm = std::max(farthest_mm, distance_mm);
  }
  if (outside > 0)
    print_warnings(
        {formatted("%s: %zu of %zu points lie far outside the ultrasound, by up to %.3g mm: "
                   "are they points of the US frame, in mm?",
                   us.path.c_str(), outside, us.points_mm.size(), farthest_mm)});
}

}  // namespace usct::tools
