#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/acquisition_errors.h"

namespace usct {

/// A pose, with errors of the acquisition, at which a similarity is evaluated.
struct SimilarityPose {
  /// Maps the US frame to the CT's, mm; rigid.
  Eigen::Isometry3d T_ct_us = Eigen::Isometry3d::Identity();
  AcquisitionErrors errors;
};

struct SimilarityValue {
  /// Higher is better; NaN if the similarity is undefined (no overlap at all).
  double value = std::numeric_limits<double>::quiet_NaN();
  /// Share of the ultrasound's counting samples that lie in the CT, in [0, 1].
  double overlap = 0.0;
};

/// A similarity near a pose to second order, as a function of a small motion of the ultrasound's
/// samples in the US frame, a rotation vector (rad) about its origin and a translation (mm), and of
/// AcquisitionErrors::depth, ::sweep and ::unevenness.
struct SimilarityDerivatives {
  static constexpr int kMotion = 6;  // parameters of the motion, which come first
  static constexpr int kCount = kMotion + 3;
  using Vector = Eigen::Matrix<double, kCount, 1>;
  using Matrix = Eigen::Matrix<double, kCount, kCount>;

  SimilarityValue value;
  /// Whether the derivatives were spared, since the value was not high enough.
  bool only_value = false;
  Vector gradient = Vector::Zero();
  /// An approximation of the negative second derivative, positive semidefinite; 0 if it was not
  /// asked for. Both are 0 for the errors where Similarity::has_error_derivatives() is false.
  Matrix curvature = Matrix::Zero();
};

/// The derivatives that are computed; the curvature costs more.
enum class DerivativeOrder { kGradient, kCurvature };

/// The similarity of a CT and ultrasound as a function of the pose. Both images and all options are
/// fixed when it is made (see catalogue.h). All functions may be called from several threads at
/// once, and always give the same bits for the same pose.
class Similarity {
 public:
  virtual ~Similarity() = default;

  /// Fills `values[i]` for `poses[i]`, i in [0, count). The threads share several poses among them;
  /// a single pose they share only for local_lc2, patch by patch, and for simulated_lc2, by lines
  /// of the ultrasound. `check` is called now and then, from several threads, and may throw to
  /// cancel.
  virtual void evaluate(const SimilarityPose* poses, std::size_t count, SimilarityValue* values,
                        const Check& check) const = 0;

  /// Value and derivatives at a pose, of a similarity that has derivatives
  /// (SimilarityNeeds::has_derivatives). For local_lc2 the threads share the patches. Where the
  /// value is not above `above`, a similarity that knows it first spares the derivatives, since a
  /// climb does not go there.
  virtual std::optional<SimilarityDerivatives> derivatives(const SimilarityPose& /*pose*/,
                                                           DerivativeOrder /*order*/,
                                                           double /*above*/) const {
    return std::nullopt;
  }
  std::optional<SimilarityDerivatives> derivatives(const SimilarityPose& pose,
                                                   DerivativeOrder order) const {
    return derivatives(pose, order, -std::numeric_limits<double>::infinity());
  }

  /// Whether these derivatives include those by the AcquisitionErrors.
  virtual bool has_error_derivatives() const { return false; }

  /// Contributions of the parts of the ultrasound (patches) at a pose; the value is their sum. A
  /// similarity that is not a sum has one part.
  virtual std::vector<double> parts(const SimilarityPose& pose) const {
    return {evaluate(pose).value};
  }

  /// Positions of these parts, US frame, mm, in the same order; empty for a similarity that is not
  /// a sum.
  virtual std::vector<Eigen::Vector3d> part_centres_us_mm() const { return {}; }

  std::vector<SimilarityValue> evaluate(const std::vector<SimilarityPose>& poses,
                                        const Check& check = {}) const {
    std::vector<SimilarityValue> values(poses.size());
    evaluate(poses.data(), poses.size(), values.data(), check);
    return values;
  }
  SimilarityValue evaluate(const SimilarityPose& pose) const {
    SimilarityValue value;
    evaluate(&pose, 1, &value, {});
    return value;
  }
};

}  // namespace usct
