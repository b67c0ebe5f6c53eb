#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/trials.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/registration/registration_result.h"

/// The runs of a study: registrations of cases with known truth, and their errors.
namespace usct {

/// Errors of one pose at the targets of a case.
struct PoseErrors {
  /// Against the truth of the case, which is the best rigid fit of its targets.
  TargetErrors rigid;
  /// Distances of the targets themselves. Where the kidney deformed they include what no rigid pose
  /// can remove; where it did not, or nothing is known of it, they equal `rigid`.
  TargetErrors physical;
};

/// A trial, registered by one method, and its result.
struct StudyRun {
  Trial trial;
  std::string method;
  std::string case_name;
  std::string group;
  std::string ct_case_name;
  RegistrationResult result;
  /// Errors at the start, of the pose if it was accepted, and of every candidate; none without
  /// truth.
  std::optional<PoseErrors> before;
  std::optional<PoseErrors> after;
  std::vector<PoseErrors> candidates;
  /// Errors that the covariance of an accepted result predicts.
  std::optional<ExpectedTargetErrors> expected;
  /// The most memory, MiB, that the process held during the registration, less what it held before.
  /// Only known if the registration ran alone.
  std::optional<double> peak_memory_mib;

  bool accepted() const { return result.T_us_ct.has_value(); }
  /// Wall time of the registration without files: the "total" of the result if it has one, else the
  /// sum of its steps.
  double seconds() const;
};

using Register = std::function<RegistrationResult(const PreScanVolume&, const CtVolume&,
                                                  const Eigen::Isometry3d& T_us_ct_initial)>;

/// The cases of a study by their indices, with all voxels. Several threads may ask at once.
using CaseSource = std::function<std::shared_ptr<const StudyCase>(std::size_t)>;

enum class StudyThreads {
  kOverTrials,   // each registration on one thread: most registrations per hour
  kWithinTrial,  // one registration after the other, each on all threads: times and memory that can
                 // be compared
};

/// A trial that `register_one` registers.
struct RunOrder {
  const Trial* trial;
  const Register* register_one;
};

/// Carries out the orders on `threads` threads (>= 1), and hands each run over as soon as it is
/// there, from one thread at a time; `done` is told the index of its order. The runs, all but their
/// times and their memory, do not depend on the number of threads if each `register_one` is a pure
/// function. `StudyRun::method` is left empty. An exception of `register_one` or `done` ends the
/// loop and is thrown here.
void run_trials(const CaseSource& cases, const std::vector<RunOrder>& orders, StudyThreads how,
                int threads, const std::function<void(std::size_t, StudyRun&&)>& done);

}  // namespace usct
