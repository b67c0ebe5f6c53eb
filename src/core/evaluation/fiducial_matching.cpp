#include "us_ct_registration/evaluation/fiducial_matching.h"

#include <algorithm>
#include <cmath>

#include "geometry/point_spread.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/registration/landmarks.h"

namespace usct {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

constexpr std::size_t kMostFewer = 8;
constexpr std::size_t kMostMore = 40;
/// Pairs that are tried: seconds. Where the tolerance is as large as the distances of the points,
/// almost all of more than 1e12 pairings fit.
constexpr std::size_t kMostTried = 20'000'000;

/// The value that a chi-square variable exceeds in one of 1000 cases (Wilson and Hilferty 1931).
double rare_chi_square(double degrees) {
  constexpr double kRareNormal = 3.0902;
  const double ninth = 2.0 / (9.0 * degrees);
  return degrees * std::pow(1.0 - ninth + kRareNormal * std::sqrt(ninth), 3.0);
}

/// Tries all ways to give each point of the smaller set a partner in the larger one, and abandons a
/// beginning as soon as two distances disagree. Gives up after kMostTried pairs.
class MatchSearch {
 public:
  MatchSearch(const Points& fewer, const Points& more, double fle_mm)
      : fewer_(fewer), more_(more), used_(more.size(), false) {
    // The difference of two distances has the errors of two pairs along one line.
    tolerance_mm_ = 4.0 * std::sqrt(2.0 / 3.0) * fle_mm;
    // N squared errors, each of fle^2 / 3 per axis, less the six degrees of the alignment.
    const auto count = static_cast<double>(fewer.size());
    largest_fre_mm_ = fle_mm * std::sqrt(rare_chi_square(3.0 * count - 6.0) / (3.0 * count));
  }

  struct Found {
    std::vector<std::size_t> partners;
    double fre_mm;
  };

  bool has_given_up() const { return tried_ > kMostTried; }

  std::vector<Found> search() {
    extend();
    std::sort(found_.begin(), found_.end(),
              [](const Found& a, const Found& b) { return a.fre_mm < b.fre_mm; });
    return found_;
  }

 private:
  void extend() {
    if (partners_.size() == fewer_.size()) {
      keep_if_it_fits();
      return;
    }
    for (std::size_t candidate = 0; candidate < more_.size() && !has_given_up(); ++candidate) {
      ++tried_;
      if (used_[candidate] || !is_compatible(candidate)) continue;
      used_[candidate] = true;
      partners_.push_back(candidate);
      extend();
      partners_.pop_back();
      used_[candidate] = false;
    }
  }

  bool is_compatible(std::size_t candidate) const {
    const Vector3d& next = fewer_[partners_.size()];
    for (std::size_t i = 0; i < partners_.size(); ++i)
      if (std::abs((next - fewer_[i]).norm() - (more_[candidate] - more_[partners_[i]]).norm()) >
          tolerance_mm_)
        return false;
    return true;
  }

  void keep_if_it_fits() {
    Points chosen;
    for (const std::size_t partner : partners_) chosen.push_back(more_[partner]);
    try {
      const double fre_mm = align_landmarks(fewer_, chosen).residual_mm;
      if (fre_mm <= largest_fre_mm_) found_.push_back({partners_, fre_mm});
    } catch (const InputError&) {
      // The partners lie on a line, which the smaller set does not.
    }
  }

  const Points& fewer_;
  const Points& more_;
  double tolerance_mm_ = 0.0;
  double largest_fre_mm_ = 0.0;
  std::size_t tried_ = 0;
  std::vector<bool> used_;
  std::vector<std::size_t> partners_;
  std::vector<Found> found_;
};

}  // namespace

FiducialMatching match_fiducials(const Points& fiducials_us_mm, const Points& fiducials_ct_mm,
                                 double fle_mm, const std::string& source) {
  if (!(fle_mm > 0.0) || !std::isfinite(fle_mm))
    throw InputError(source, formatted("localization error is %g mm, must be above 0", fle_mm));
  const bool us_has_fewer = fiducials_us_mm.size() <= fiducials_ct_mm.size();
  const Points& fewer = us_has_fewer ? fiducials_us_mm : fiducials_ct_mm;
  const Points& more = us_has_fewer ? fiducials_ct_mm : fiducials_us_mm;
  if (fewer.size() > kMostFewer || more.size() > kMostMore)
    throw InputError(source, formatted("%zu and %zu points, must be at most %zu and %zu",
                                       fewer.size(), more.size(), kMostFewer, kMostMore));
  require_spread(fewer, 0.05, source);
  require_spread(more, 0.0, source);
  FiducialMatching matching;
  MatchSearch search(fewer, more, fle_mm);
  const std::vector<MatchSearch::Found> all = search.search();
  if (search.has_given_up())
    throw InputError(source,
                     formatted("too many pairings fit a localization error of %g mm: give a "
                               "smaller error, or fewer points",
                               fle_mm));
  for (const MatchSearch::Found& found : all) {
    FiducialMatch match;
    match.fre_mm = found.fre_mm;
    for (std::size_t i = 0; i < found.partners.size(); ++i) {
      const std::size_t partner = found.partners[i];
      match.pairs.emplace_back(us_has_fewer ? i : partner, us_has_fewer ? partner : i);
    }
    std::sort(match.pairs.begin(), match.pairs.end());
    matching.fitting.push_back(match);
  }
  if (matching.fitting.empty())
    throw InputError(source,
                     formatted("no pairing of %zu points of the ultrasound with %zu of the CT fits "
                               "a localization error of %g mm",
                               fiducials_us_mm.size(), fiducials_ct_mm.size(), fle_mm));
  return matching;
}

std::pair<Points, Points> matched_points(const FiducialMatch& match, const Points& fiducials_us_mm,
                                         const Points& fiducials_ct_mm) {
  std::pair<Points, Points> points;
  for (const auto& [us, ct] : match.pairs) {
    points.first.push_back(fiducials_us_mm[us]);
    points.second.push_back(fiducials_ct_mm[ct]);
  }
  return points;
}

}  // namespace usct
