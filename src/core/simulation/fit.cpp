#include <Eigen/QR>
#include <cmath>
#include <utility>

#include "parallel.h"
#include "require.h"
#include "simulation/fit_limits.h"
#include "us_ct_registration/simulation/simulation.h"

namespace usct {
namespace {

/// Sums, later means: of p, r and U (in this order) over insonified samples, and of U alone.
struct Means {
  std::size_t usable = 0, in_body = 0, used = 0, occluded = 0;
  Eigen::Vector3d insonified = Eigen::Vector3d::Zero();
  double us = 0.0;
  double us_occluded = 0.0;

  void operator+=(const Means& other) {
    usable += other.usable;
    in_body += other.in_body;
    used += other.used;
    occluded += other.occluded;
    insonified += other.insonified;
    us += other.us;
    us_occluded += other.us_occluded;
  }
  /// Divides the sums by their counts.
  void divide() {
    if (used > occluded) insonified /= static_cast<double>(used - occluded);
    if (used > 0) us /= static_cast<double>(used);
    if (occluded > 0) us_occluded /= static_cast<double>(occluded);
  }
};

/// Sums of products of deviations from the means.
struct Deviations {
  Eigen::Matrix3d insonified = Eigen::Matrix3d::Zero();
  double us = 0.0;

  void operator+=(const Deviations& other) {
    insonified += other.insonified;
    us += other.us;
  }
};

class Fit {
 public:
  Fit(const SimulatedComponents& components, const std::vector<float>& ultrasound,
      const std::vector<std::uint8_t>& excluded, const FitOptions& options)
      : components_(components), us_(ultrasound), excluded_(excluded), options_(options) {}

  SimulatedUltrasound run() {
    means_ = total<Means>([&](std::size_t i, Means& sums) { add_to(sums, i); });
    means_.divide();
    result_.used = means_.used;
    result_.occluded = means_.occluded;
    result_.occluded_mean = means_.us_occluded;
    if (means_.usable == 0)
      return refused(FitStatus::kNoUsableUltrasound, "every ultrasound sample is excluded");
    result_.overlap = static_cast<double>(means_.in_body) / static_cast<double>(means_.usable);
    if (means_.in_body == 0 || result_.overlap < options_.min_overlap)
      return refused(FitStatus::kNoOverlap,
                     "the CT shows " + std::to_string(100.0 * result_.overlap) +
                         " % of the usable ultrasound, must be >= " +
                         std::to_string(100.0 * options_.min_overlap) + " % and > 0");
    if (means_.occluded == means_.used)
      return refused(FitStatus::kAllOccluded, "no usable sample is reached by the sound");
    deviations_ = total<Deviations>([&](std::size_t i, Deviations& sums) { add_to(sums, i); });
    if (is_constant(deviations_.us, means_.used, means_.us))
      return refused(FitStatus::kConstantUltrasound, "the usable ultrasound does not vary");
    if (!find_weights())
      return refused(FitStatus::kNoContrast, "neither mapped CT nor reflection varies");
    explain();
    return std::move(result_);
  }

 private:
  bool is_background(std::size_t i) const {
    return (components_.flags[i] & (kOutsideCt | kBeforeBody)) != 0;
  }
  bool is_usable(std::size_t i) const { return excluded_.empty() || excluded_[i] == 0; }
  bool is_used(std::size_t i) const {
    return is_usable(i) && (options_.use_background || !is_background(i));
  }
  bool is_occluded(std::size_t i) const { return (components_.flags[i] & kOccluded) != 0; }

  Eigen::Vector3d values(std::size_t i) const {
    return {components_.mapped_ct[i], components_.reflection[i], us_[i]};
  }

  /// Sums over the samples of each frame, then over the frames in order.
  template <typename Sums, typename Add>
  Sums total(const Add& add) const {
    std::vector<Sums> of_frame(static_cast<std::size_t>(components_.frames));
    parallel_for(components_.frames, [&](int frame) {
      Sums sums{};
      for (std::size_t i = components_.offset(0, 0, frame); i < components_.offset(0, 0, frame + 1);
           ++i)
        add(i, sums);
      of_frame[static_cast<std::size_t>(frame)] = sums;
    });
    Sums all{};
    for (const Sums& sums : of_frame) all += sums;
    return all;
  }

  void add_to(Means& sums, std::size_t i) const {
    if (!is_usable(i)) return;
    if (!std::isfinite(us_[i]))
      throw InputError("ultrasound", "sample " + std::to_string(i) + " is not finite");
    ++sums.usable;
    sums.in_body += is_background(i) ? 0 : 1;
    if (!is_used(i)) return;
    ++sums.used;
    sums.us += us_[i];
    if (is_occluded(i)) {
      ++sums.occluded;
      sums.us_occluded += us_[i];
    } else {
      sums.insonified += values(i);
    }
  }

  void add_to(Deviations& sums, std::size_t i) const {
    if (!is_used(i)) return;
    sums.us += (us_[i] - means_.us) * (us_[i] - means_.us);
    if (is_occluded(i)) return;
    const Eigen::Vector3d deviation = values(i) - means_.insonified;
    sums.insonified += deviation * deviation.transpose();
  }

  static bool is_constant(double squares, std::size_t count, double mean) {
    return squares <= kConstantBelow * static_cast<double>(count) * mean * mean;
  }

  bool find_weights() {
    if (options_.fixed_weights) {
      result_.weights = *options_.fixed_weights;
      result_.status = FitStatus::kFixedWeights;
      return true;
    }
    // p (grey values) and r (below 1) are standardised, so that neither dominates the smallest
    // weights.
    Eigen::Vector3d scale = deviations_.insonified.diagonal().cwiseSqrt();
    for (int i = 0; i < 2; ++i)
      if (is_constant(scale[i] * scale[i], means_.used - means_.occluded, means_.insonified[i]))
        scale[i] = 0.0;
    if (scale[0] == 0.0 && scale[1] == 0.0) return false;
    const auto correlation = [&](int i, int j) {
      const double product = scale[i] * scale[j];
      return product > 0.0 ? deviations_.insonified(i, j) / product : 0.0;
    };
    Eigen::Matrix2d of_images;
    of_images << correlation(0, 0), correlation(0, 1), correlation(1, 0), correlation(1, 1);
    Eigen::CompleteOrthogonalDecomposition<Eigen::Matrix2d> decomposition;
    decomposition.setThreshold(kCollinearBelow);
    decomposition.compute(of_images);
    const Eigen::Vector2d standardised =
        decomposition.solve(Eigen::Vector2d(correlation(0, 2), correlation(1, 2)));
    const auto weight = [&](int i) {
      return scale[i] > 0.0 ? standardised[i] * scale[2] / scale[i] : 0.0;
    };
    result_.weights.mapped_ct = weight(0);
    result_.weights.reflection = weight(1);
    result_.weights.bias =
        means_.insonified[2] - weight(0) * means_.insonified[0] - weight(1) * means_.insonified[1];
    result_.status = FitStatus::kFitted;
    return true;
  }

  /// Computes the simulated image (eq 4.9) and LC2 (eq 4.10).
  void explain() {
    const SimulationWeights& weights = result_.weights;
    result_.brightness.resize(components_.count());
    const auto residual = total<double>([&](std::size_t i, double& sum) {
      const double f = is_occluded(i)
                           ? result_.occluded_mean
                           : weights.mapped_ct * components_.mapped_ct[i] +
                                 weights.reflection * components_.reflection[i] + weights.bias;
      result_.brightness[i] = static_cast<float>(f);
      if (is_used(i)) sum += (us_[i] - f) * (us_[i] - f);
    });
    result_.lc2 = 1.0 - residual / deviations_.us;
  }

  SimulatedUltrasound refused(FitStatus status, const std::string& message) {
    result_.status = status;
    result_.message = message;
    return std::move(result_);
  }

  const SimulatedComponents& components_;
  const std::vector<float>& us_;
  const std::vector<std::uint8_t>& excluded_;
  const FitOptions& options_;
  Means means_;
  Deviations deviations_;
  SimulatedUltrasound result_;
};

}  // namespace

std::string to_string(FitStatus status) {
  switch (status) {
    case FitStatus::kNotFitted:
      return "not fitted";
    case FitStatus::kFitted:
      return "fitted";
    case FitStatus::kFixedWeights:
      return "fixed weights";
    case FitStatus::kNoUsableUltrasound:
      return "no usable ultrasound";
    case FitStatus::kNoOverlap:
      return "no overlap";
    case FitStatus::kConstantUltrasound:
      return "constant ultrasound";
    case FitStatus::kAllOccluded:
      return "all occluded";
    case FitStatus::kNoContrast:
      return "no contrast";
  }
  return "unknown";
}

void FitOptions::validate(const std::string& source) const {
  require(min_overlap >= 0.0 && min_overlap <= 1.0, source, "min_overlap", min_overlap,
          "within [0, 1]");
  if (!fixed_weights) return;
  for (const auto& [field, value] :
       {std::pair("mapped_ct", fixed_weights->mapped_ct),
        std::pair("reflection", fixed_weights->reflection), std::pair("bias", fixed_weights->bias)})
    require(std::isfinite(value), source, field, value, "finite");
}

SimulatedUltrasound fit_to_ultrasound(const SimulatedComponents& components,
                                      const std::vector<float>& ultrasound,
                                      const std::vector<std::uint8_t>& excluded,
                                      const FitOptions& options) {
  options.validate();
  const auto count = static_cast<double>(components.count());
  require(ultrasound.size() == components.count(), "ultrasound", "samples",
          static_cast<double>(ultrasound.size()), "as many as were simulated");
  require(excluded.empty() || excluded.size() == components.count(), "excluded", "samples",
          static_cast<double>(excluded.size()), "none or as many as were simulated");
  require(count > 0.0, "simulated components", "samples", count, "> 0");
  return Fit(components, ultrasound, excluded, options).run();
}

}  // namespace usct
