#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <set>

#include "core/registration/analytic_similarity.h"
#include "registration/search/multi_start.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/registration/pose_parameters.h"
#include "us_ct_registration/registration/starts.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using registration::Candidate;
using registration::FieldPoints;
using registration::SearchProblem;

Isometry3d turned_about_field(double angle_deg, const Vector3d& axis, const Vector3d& shift_mm) {
  const Eigen::Translation3d to_middle(0.0, 80.0, 0.0);
  return Isometry3d(Eigen::Translation3d(shift_mm) * to_middle *
                    Eigen::AngleAxisd(angle_deg * kDegree, axis.normalized()) *
                    to_middle.inverse());
}

SearchOptions two_levels() {
  SearchOptions options;
  options.starts->count = 64;
  options.levels.resize(2);
  for (LevelOptions& level : options.levels) {
    level.optimizer.method = OptimizerMethod::kBobyqa;
    level.optimizer.max_evaluations = 300;
    level.optimizer.initial_step = 3.0;
    level.optimizer.step_tolerance = 0.05;
    level.optimised = 8;
    level.kept = 4;
  }
  return options;
}

/// Searches from the identity on the same peaks at all levels.
class MultiStarted {
 public:
  MultiStarted(std::vector<Peak> peaks, SearchOptions options)
      : field_(cube_field()), peaks_(field_, std::move(peaks)), options_(std::move(options)) {}

  SearchProblem problem() const {
    const registration::LevelSimilarities level{&peaks_, screening_};
    return {std::vector(options_.levels.size(), level), options_, initial_, field_, 1};
  }
  std::vector<Candidate> round(int round, std::vector<Candidate> found = {}) {
    return registration::multi_start(problem(), round, std::move(found), run_);
  }
  std::vector<std::vector<Candidate>> search(const std::vector<SearchProblem>& problems,
                                             std::optional<int> competing_for = {}) {
    return registration::multi_start(
        problems, 0, std::vector<std::vector<Candidate>>(problems.size()), run_, competing_for);
  }
  Candidate optimum_near(const Isometry3d& T_us_ct, double reach_mm) {
    return registration::optimum_near(problem(), T_us_ct, reach_mm, run_);
  }
  double distance_mm(const Candidate& candidate, const Isometry3d& T_us_ct) const {
    return field_.distance_mm(candidate.T_us_ct, T_us_ct);
  }
  int evaluations() const { return run_.evaluations(); }
  /// From now on, this similarity screens.
  void screen_by(const Similarity& screening) { screening_ = &screening; }

 private:
  FieldPoints field_;
  PeaksSimilarity peaks_;
  const Similarity* screening_ = nullptr;
  SearchOptions options_;
  Isometry3d initial_ = Isometry3d::Identity();
  RegistrationHooks hooks_;
  registration::Run run_{hooks_};
};

const Isometry3d kHigh = turned_about_field(12.0, {1, 2, -1}, {9, -6, 4});
const Isometry3d kLow = turned_about_field(-15.0, {2, -1, 1}, {-12, 8, -10});

TEST(MultiStart, FindsEachPeakOnceBestFirst) {
  MultiStarted searched({{kLow, 0.8, 6.0}, {kHigh, 1.0, 6.0}}, two_levels());
  const std::vector<Candidate> optima = searched.round(0);
  ASSERT_GE(optima.size(), 2U);
  EXPECT_LT(searched.distance_mm(optima[0], kHigh), 0.2);
  EXPECT_LT(searched.distance_mm(optima[1], kLow), 0.2);
  EXPECT_NEAR(optima[0].value, 1.0, 0.01);
  EXPECT_NEAR(optima[1].value, 0.8, 0.01);
  for (std::size_t i = 2; i < optima.size(); ++i) EXPECT_LT(optima[i].value, 0.8);
}

TEST(MultiStart, OptimaCloserThanTheDistinctDistanceAreOne) {
  const Isometry3d beside = Eigen::Translation3d(25.0, 0.0, 0.0) * kHigh;
  SearchOptions options = two_levels();
  const auto peaks_found = [&](double distinct_mm) {
    options.distinct_mm = distinct_mm;
    MultiStarted searched({{kHigh, 1.0, 6.0}, {beside, 0.9, 6.0}}, options);
    int found = 0;
    for (const Candidate& optimum : searched.round(0)) found += optimum.value > 0.8 ? 1 : 0;
    return found;
  };
  EXPECT_EQ(peaks_found(4.0), 2);
  EXPECT_EQ(peaks_found(40.0), 1);
}

TEST(MultiStart, KeepsAsManyAsTheOptionsSay) {
  SearchOptions options = two_levels();
  options.most_optima = 1;
  MultiStarted searched({{kLow, 0.8, 6.0}, {kHigh, 1.0, 6.0}}, options);
  const std::vector<Candidate> optima = searched.round(0);
  ASSERT_EQ(optima.size(), 1U);
  EXPECT_LT(searched.distance_mm(optima[0], kHigh), 0.2);
}

TEST(MultiStart, ClimbsFromTheInitialPoseAtEveryLevel) {
  // A peak so narrow that no start but the initial pose is on its slope.
  const Isometry3d here = Isometry3d(Eigen::Translation3d(1.0, 0.0, 0.5));
  SearchOptions options = two_levels();
  options.levels[0].optimised = options.levels[0].kept = 1;  // the wide peak takes the only place
  MultiStarted searched({{here, 1.0, 1.0}, {kLow, 0.9, 25.0}}, options);
  const std::vector<Candidate> optima = searched.round(0);
  ASSERT_FALSE(optima.empty());
  EXPECT_LT(searched.distance_mm(optima[0], here), 0.2);
}

TEST(MultiStart, LaterRoundsKeepWhatWasFound) {
  MultiStarted searched({{kHigh, 1.0}}, two_levels());
  std::vector<Candidate> before = searched.round(0);
  before.front().value = 5.0;  // higher than the similarity of any pose
  EXPECT_EQ(searched.round(1, before).front().value, 5.0);
}

/// Notes the poses that it is asked for.
class Noting final : public Similarity {
 public:
  explicit Noting(const Similarity& similarity) : similarity_(similarity) {}
  using Similarity::evaluate;
  void evaluate(const SimilarityPose* poses, std::size_t count, SimilarityValue* values,
                const Check& check) const override {
    for (std::size_t i = 0; i < count; ++i) asked.push_back(poses[i].T_ct_us.translation());
    similarity_.evaluate(poses, count, values, check);
  }
  mutable std::vector<Eigen::Vector3d> asked;

 private:
  const Similarity& similarity_;
};

TEST(MultiStart, ScreeningChoosesTheStartsThatAreCompared) {
  SearchOptions options = two_levels();
  options.starts->count = 1024;
  options.levels.resize(1);  // a second level would climb from the initial pose, whatever its rank
  options.levels[0].screened = options.levels[0].optimised = 8;
  options.levels[0].reach_mm = 10.0;
  const FieldPoints field = cube_field();
  const PeaksSimilarity low(field, {{kLow, 1.0, 20.0}});
  const Noting screening(low);
  MultiStarted searched({{kLow, 0.8, 8.0}, {kHigh, 1.0, 8.0}}, options);
  EXPECT_LT(searched.distance_mm(searched.round(0).front(), kHigh), 0.2);
  // A screening that sees the lower peak alone leaves no start near the other one.
  searched.screen_by(screening);
  for (const Candidate& optimum : searched.round(0))
    EXPECT_GT(searched.distance_mm(optimum, kHigh), 5.0);
  EXPECT_EQ(screening.asked.size(), 1024U);
}

/// A search of one level whose screening notes all starts.
class NotedStarts : public testing::Test {
 protected:
  NotedStarts() { searched_.screen_by(screening_); }
  static SearchOptions one_screened_level() {
    SearchOptions options = two_levels();
    options.levels.resize(1);
    options.levels[0].screened = options.levels[0].optimised;
    return options;
  }

  const SearchOptions options_ = one_screened_level();
  const PeaksSimilarity low_{cube_field(), {{kLow, 1.0, 20.0}}};
  const Noting screening_{low_};
  MultiStarted searched_{{{kLow, 1.0, 20.0}}, options_};
};

TEST_F(NotedStarts, EachRoundHasStartsOfItsOwn) {
  for (int round = 0; round < 3; ++round) searched_.round(round);
  const auto count = static_cast<std::size_t>(options_.starts->count);
  ASSERT_EQ(screening_.asked.size(), 3 * count);
  std::set<double> different;
  for (const Eigen::Vector3d& place : screening_.asked) different.insert(place.x());
  EXPECT_EQ(different.size(), 3 * count);
}

TEST_F(NotedStarts, StartsAreMovedByShiftsInTurnToo) {
  SearchProblem problem = searched_.problem();
  const Vector3d shift_us_mm(20.0, -3.0, 5.0);
  problem.start_shifts_us_mm = {shift_us_mm, -shift_us_mm};
  searched_.search({problem});
  const auto count = static_cast<std::size_t>(options_.starts->count);
  ASSERT_EQ(screening_.asked.size(), 2 * count);
  // The first start is the initial pose, the identity; the second one is moved the other way.
  EXPECT_TRUE(screening_.asked[0].isZero());
  EXPECT_TRUE(screening_.asked[count].isApprox(-shift_us_mm));  // T_ct_us
  const PoseParameters pose(Isometry3d::Identity(), cube_field().us_mm());
  const Isometry3d second = pose.T_us_ct(spread_starts(pose, *options_.starts)[1]);
  EXPECT_TRUE(screening_.asked[count + 1].isApprox(
      (Eigen::Translation3d(-shift_us_mm) * second).inverse().translation()));
}

/// Of problems that compete the best candidates of all are climbed from: as many as one search
/// takes, wherever they are.
TEST(MultiStart, ProblemsThatCompeteShareTheClimbs) {
  const FieldPoints field = cube_field();
  const PeaksSimilarity high(field, {{kHigh, 1.0, 12.0}});
  const PeaksSimilarity low(field, {{kLow, 0.01, 12.0}});
  MultiStarted searched({}, two_levels());
  std::vector<SearchProblem> problems(2, searched.problem());
  for (std::size_t level = 0; level < 2; ++level) {
    problems[0].similarities[level].all = &low;
    problems[1].similarities[level].all = &high;
  }
  const auto apart = searched.search(problems);
  EXPECT_LT(searched.distance_mm(apart[0].front(), kLow), 0.2);
  EXPECT_LT(searched.distance_mm(apart[1].front(), kHigh), 0.2);
  const int evaluations_apart = searched.evaluations();
  const auto together = searched.search(problems, 1);
  EXPECT_LT(searched.distance_mm(together[1].front(), kHigh), 0.2);
  EXPECT_LT(searched.evaluations() - evaluations_apart, evaluations_apart);
  // The problem without a place still climbs from the given pose.
  ASSERT_FALSE(together[0].empty());
  EXPECT_LE(together[0].size(), apart[0].size());
}

TEST(MultiStart, FewCandidatesAreNotScreened) {
  SearchOptions options = two_levels();
  options.levels[0].screened = options.starts->count;
  const NoSimilarity nothing;
  const Noting screening(nothing);
  MultiStarted searched({{kHigh, 1.0, 6.0}}, options);
  searched.screen_by(screening);
  EXPECT_LT(searched.distance_mm(searched.round(0).front(), kHigh), 0.2);
  EXPECT_EQ(screening.asked.size(), 0U);
}

TEST(MultiStart, WithoutAnyValueThereIsNoOptimum) {
  const FieldPoints field = cube_field();
  const NoSimilarity nothing;
  const SearchOptions options = two_levels();
  const Isometry3d initial = Isometry3d::Identity();
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  EXPECT_TRUE(
      registration::multi_start(
          {{{&nothing, nullptr}, {&nothing, nullptr}}, options, initial, field, 1}, 0, {}, run)
          .empty());
}

TEST(MultiStart, ProblemsSearchedTogetherFindWhatEachFindsAlone) {
  MultiStarted high({{kLow, 0.8, 6.0}, {kHigh, 1.0, 6.0}}, two_levels());
  MultiStarted low({{kLow, 0.9, 6.0}}, two_levels());
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  const std::vector<std::vector<Candidate>> together = registration::multi_start(
      std::vector<SearchProblem>{high.problem(), low.problem()}, 0, {{}, {}}, run);
  ASSERT_EQ(together.size(), 2U);
  const std::vector<std::vector<Candidate>> alone{high.round(0), low.round(0)};
  for (std::size_t problem = 0; problem < 2; ++problem) {
    ASSERT_EQ(together[problem].size(), alone[problem].size());
    for (std::size_t i = 0; i < alone[problem].size(); ++i) {
      EXPECT_EQ(together[problem][i].value, alone[problem][i].value);
      EXPECT_TRUE(together[problem][i].T_us_ct.isApprox(alone[problem][i].T_us_ct, 0.0));
    }
  }
  EXPECT_LT(high.distance_mm(together[0].front(), kHigh), 0.2);
  EXPECT_LT(low.distance_mm(together[1].front(), kLow), 0.2);
}

/// Has a value on one side of a plane only, and notes how often it is asked.
class HalfSpace final : public Similarity {
 public:
  using Similarity::evaluate;
  void evaluate(const SimilarityPose* poses, std::size_t count, SimilarityValue* values,
                const Check&) const override {
    for (std::size_t i = 0; i < count; ++i) {
      ++asked;
      const double x_mm = poses[i].T_ct_us.translation().x();
      if (x_mm > 0.0) values[i] = {1.0 / (1.0 + std::abs(x_mm - 1.0)), 1.0};
    }
  }
  mutable std::atomic<int> asked{0};
};

TEST(Climb, DoesNotBeginWhereThereIsNoValue) {
  const FieldPoints field = cube_field();
  const HalfSpace similarity;
  const RegistrationHooks hooks;
  for (const OptimizerMethod method : {OptimizerMethod::kBobyqa, OptimizerMethod::kCmaEs}) {
    registration::Run run(hooks);
    OptimizerOptions optimizer;
    optimizer.method = method;
    std::vector<Candidate> candidates{
        {Isometry3d(Eigen::Translation3d(2.0, 0.0, 0.0)), {}},  // the CT moves away
        {Isometry3d(Eigen::Translation3d(-2.0, 0.0, 0.0)), {}}};
    similarity.asked = 0;
    registration::climb(similarity, {optimizer, 10.0, {}, 1}, field, candidates, run);
    EXPECT_FALSE(candidates[0].has_value());
    EXPECT_TRUE(
        candidates[0].T_us_ct.isApprox(Isometry3d(Eigen::Translation3d(2.0, 0.0, 0.0)), 0.0));
    EXPECT_GT(candidates[1].value, 0.9);
    EXPECT_EQ(run.evaluations(), similarity.asked);
  }
}

TEST(OptimumNear, IsThatToWhichThePoseLeadsWhateverIsHigherElsewhere) {
  MultiStarted searched({{kHigh, 1.0, 6.0}, {kLow, 0.8, 6.0}}, two_levels());
  const Isometry3d beside = Eigen::Translation3d(2.0, -1.0, 1.0) * kLow;
  const Candidate found = searched.optimum_near(beside, 10.0);
  EXPECT_LT(searched.distance_mm(found, kLow), 0.2);
  EXPECT_NEAR(found.value, 0.8, 0.01);
  EXPECT_GT(searched.distance_mm(searched.optimum_near(beside, 0.5), kLow), 1.0);
}

TEST(HeadedBy, KeepsTheOthersThatAreDistinctInTheirOrder) {
  const auto shifted = [](double x_mm, double value) {
    return Candidate{Isometry3d(Eigen::Translation3d(x_mm, 0.0, 0.0)), {}, value, 1.0};
  };
  const MultiStarted searched({{kHigh, 1.0}}, two_levels());
  const std::vector<Candidate> optima = registration::headed_by(
      shifted(0.0, 0.5), {shifted(10.0, 0.9), shifted(3.0, 0.8), shifted(-5.0, 0.7)},
      searched.problem());
  ASSERT_EQ(optima.size(), 3U);
  EXPECT_EQ(optima[0].value, 0.5);
  EXPECT_EQ(optima[1].value, 0.9);
  EXPECT_EQ(optima[2].value, 0.7);
}

TEST(MultiStart, WithoutStartsOnlyTheInitialPoseIsClimbedFrom) {
  SearchOptions options = two_levels();
  options.starts.reset();
  MultiStarted searched({{kHigh, 1.0, 30.0}, {kLow, 2.0, 3.0}}, options);
  const std::vector<Candidate> optima = searched.round(0);
  ASSERT_EQ(optima.size(), 1U);
  EXPECT_LT(searched.distance_mm(optima[0], kHigh), 0.3);
}

}  // namespace
}  // namespace usct::test
