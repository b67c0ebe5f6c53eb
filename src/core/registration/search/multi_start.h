#pragma once

#include <optional>
#include <vector>

#include "registration/search/block_matching.h"
#include "registration/search/candidates.h"

/// The search: many starts around the initial pose, climbed coarse to fine.
namespace usct::registration {

/// The similarity of a level, and the same by a part of the samples: see LevelOptions::screened.
struct LevelSimilarities {
  const Similarity* all = nullptr;
  const Similarity* screening = nullptr;  // null if all candidates are compared by all samples
};

/// The problem of a search. The objects that it refers to must outlive it.
struct SearchProblem {
  /// One entry per level of the options, in their order.
  std::vector<LevelSimilarities> similarities;
  const SearchOptions& options;
  const Eigen::Isometry3d& T_us_ct_initial;
  const FieldPoints& field;
  std::uint32_t seed;
  /// A pose from which the first round climbs at every level, whatever its rank there; at the first
  /// level the initial pose is one of the starts.
  Eigen::Isometry3d T_us_ct_given = T_us_ct_initial;
  /// Each start is tried moved by one of these translations too, which take turns; US frame.
  std::vector<Eigen::Vector3d> start_shifts_us_mm = {};
  /// Finds the starts, as many as the first level optimises; null: they are spread.
  const BlockMatching* blocks = nullptr;
  /// This motion of the ultrasound mirrors it: see mirror_of.
  Eigen::Isometry3d mirror = Eigen::Isometry3d::Identity();
};

/// One round of the search; `round` counts from 0. Returns the optima of the deciding level
/// together with `found`, those of earlier rounds, best first; empty if no pose has a value.
std::vector<Candidate> multi_start(const SearchProblem& problem, int round,
                                   std::vector<Candidate> found, Run& run);

/// The same for problems that differ in their similarities, given poses and shifts only, all at
/// once: threads share their climbs. An entry of `found` and of the result for each problem.
///
/// Each problem chooses among its own candidates, unless all compete: then each level takes and
/// hands on the best of all, as many as so many searches by themselves would.
std::vector<std::vector<Candidate>> multi_start(const std::vector<SearchProblem>& problems,
                                                int round,
                                                std::vector<std::vector<Candidate>> found, Run& run,
                                                std::optional<int> competing_for = {});

/// For each of such problems the optimum of the deciding level that a pose leads to, at most
/// `reach_mm` away.
std::vector<Candidate> optima_near(const std::vector<SearchProblem>& problems,
                                   const Eigen::Isometry3d& T_us_ct, double reach_mm, Run& run);
Candidate optimum_near(const SearchProblem& problem, const Eigen::Isometry3d& T_us_ct,
                       double reach_mm, Run& run);

/// An optimum comes first, then those of the others that are distinct from it, in their order.
std::vector<Candidate> headed_by(const Candidate& first, const std::vector<Candidate>& others,
                                 const SearchProblem& problem);

}  // namespace usct::registration
