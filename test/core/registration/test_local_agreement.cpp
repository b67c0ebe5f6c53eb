#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <vector>

#include "core/geometry/random_geometry.h"
#include "core/registration/wishes.h"
#include "registration/evidence/clusters.h"
#include "registration/evidence/local_agreement.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using registration::Clusters;
using registration::local_agreement;
using registration::LocalAgreement;

/// Tissue counts as near within so much of the middle of the first cluster.
std::optional<LocalAgreement> agreement_of(const Similarity& similarity,
                                           const Isometry3d& T_us_ct = Isometry3d::Identity(),
                                           double radius_mm = 1000.0) {
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  return local_agreement(
      similarity, {T_us_ct, {}},
      {kClusterMm, kStepMm, {Vector3d(5.0, 5.0, 5.0), radius_mm, Vector3d::UnitZ()}}, run);
}

double agreement(const Similarity& similarity, const Isometry3d& T_us_ct = Isometry3d::Identity()) {
  return agreement_of(similarity, T_us_ct).value().share;
}

Isometry3d shift(const Vector3d& shift_mm) { return Isometry3d(Eigen::Translation3d(shift_mm)); }

RC_GTEST_PROP(LocalAgreement, IsWholeIfAllClustersWishThePose, ()) {
  const Vector3d pose_mm = random_pose(20.0).translation();
  const Wishes wishes(std::vector<Vector3d>(5, pose_mm));
  RC_ASSERT(std::abs(agreement(wishes, shift(pose_mm)) - (1.0 - by_chance(5))) < 1e-9);
}

const Vector3d kCornerMm(kStepMm, kStepMm, -kStepMm);

/// The mean over the 27 translations of the contribution of a cluster of strength 1 with this wish.
double mean_of_wish(const Vector3d& wished_mm) {
  double sum = 0.0;
  for (const int x : {-1, 0, 1})
    for (const int y : {-1, 0, 1})
      for (const int z : {-1, 0, 1})
        sum += std::exp(-(Vector3d(x, y, z) - wished_mm / kStepMm).norm());
  return sum / 27.0;
}

/// The share of its rise that a cluster reaches at the pose if it wishes a corner of the lattice.
double share_off_a_corner() {
  const double mean = mean_of_wish(kCornerMm);
  return (std::exp(-std::sqrt(3.0)) - mean) / (1.0 - mean);
}

/// Tissue that has moved as a whole does not lie where it would like to, but where its neighbours
/// would like it to.
TEST(LocalAgreement, TissueThatMovesWithItsNeighboursAgreesByHalf) {
  const LocalAgreement moved = agreement_of(Wishes(std::vector<Vector3d>(6, kCornerMm))).value();
  EXPECT_NEAR(moved.share, 0.5 * (share_off_a_corner() + 1.0) - by_chance(6), 1e-9);
  EXPECT_NEAR(moved.tissue_motion_mm, kCornerMm.norm(), 1e-9);
  EXPECT_NEAR(moved.wide_motion_mm, kCornerMm.norm(), 1e-9);
  EXPECT_NEAR(moved.deformation_mm, kCornerMm.norm(), 0.2 * kCornerMm.norm());
  EXPECT_LT((moved.wished_motion.translation() - kCornerMm).norm(), 0.2 * kCornerMm.norm());
  EXPECT_LT(Eigen::AngleAxisd(moved.wished_motion.linear()).angle(), 1e-9);
}

/// A motion of less than half a step is nearer to none than to any translation that is offered.
TEST(LocalAgreement, DeformationIsSeenBetweenTheTranslations) {
  const Vector3d wished = 0.4 * kStepMm * Vector3d::UnitY();
  const LocalAgreement moved = agreement_of(Wishes(std::vector<Vector3d>(6, wished))).value();
  EXPECT_EQ(moved.tissue_motion_mm, 0.0);
  EXPECT_NEAR(moved.deformation_mm, wished.norm(), 0.25 * wished.norm());
}

TEST(LocalAgreement, ClustersThatWishTheOppositeOfTheirNeighboursDoNotAgree) {
  std::vector<Vector3d> wished;
  for (int i = 0; i < 6; ++i) wished.push_back(i % 2 == 0 ? kCornerMm : Vector3d(-kCornerMm));
  EXPECT_LT(agreement(Wishes(wished)) + by_chance(6), 0.0);
}

/// The third cluster alone wishes to move, and is outvoted by its neighbours, which wish to stay.
TEST(LocalAgreement, OneClusterAmongOthersIsNoMotionOfTissue) {
  const LocalAgreement found =
      agreement_of(Wishes({{0, 0, 0}, {0, 0, 0}, kCornerMm, {0, 0, 0}, {0, 0, 0}})).value();
  EXPECT_EQ(found.tissue_motion_mm, 0.0);
  EXPECT_LT(found.deformation_mm, 0.2 * kCornerMm.norm());
  EXPECT_GT(found.share + by_chance(5), 0.7);
}

/// Two clusters outvote the one between them. The five around it are not moved: those near the
/// middle of a group count more often.
TEST(LocalAgreement, WhatMovesSmallGroupsAveragesOutOverWideOnes) {
  std::vector<Vector3d> wished(9, Vector3d::Zero());
  wished[3] = wished[5] = kCornerMm;
  const LocalAgreement found = agreement_of(Wishes(wished)).value();
  EXPECT_GT(found.tissue_motion_mm, 1.0);
  EXPECT_EQ(found.wide_motion_mm, 0.0);
}

/// The fourth cluster is strong and far from the centre. It is no neighbour of the two near it.
TEST(LocalAgreement, WideGroupsEndWhereTheTissueDoes) {
  const Wishes wishes({{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, kCornerMm}, {1.0, 1.0, 0.1, 50.0});
  EXPECT_EQ(agreement_of(wishes, Isometry3d::Identity(), 15.0).value().wide_motion_mm, 0.0);
  EXPECT_GT(agreement_of(wishes).value().wide_motion_mm, 3.0);
}

TEST(LocalAgreement, TissueFarFromTheCentreDoesNotCount) {
  std::vector<Vector3d> wished(8, Vector3d::Zero());
  std::fill_n(wished.begin() + 4, 4, kCornerMm);
  // The middles of the clusters are 10 mm apart.
  const Wishes wishes(wished);
  EXPECT_EQ(agreement_of(wishes, Isometry3d::Identity(), 25.0).value().tissue_motion_mm, 0.0);
  EXPECT_GT(agreement_of(wishes, Isometry3d::Identity(), 75.0).value().tissue_motion_mm, 3.0);
}

/// Two clusters that wish to stay and to lie at a corner, with four in between that make no
/// difference: no group has both of them, however wide. What each can rise by is 3 and 1.
Wishes three_to_one() {
  const double stays = 1.0 - mean_of_wish(Vector3d::Zero());
  const double moves = 1.0 - mean_of_wish(kCornerMm);
  std::vector<Vector3d> wished(6, Vector3d::Zero());
  wished.back() = kCornerMm;
  return {wished, {3.0 / stays, 0.0, 0.0, 0.0, 0.0, 1.0 / moves}};
}

TEST(LocalAgreement, ClustersCountByTheRiseThatTheyCanReach) {
  EXPECT_NEAR(agreement(three_to_one()), (3.0 + share_off_a_corner()) / 4.0 - by_chance(6), 1e-9);
}

/// The mean of the squares is a quarter of that of the corner's motion.
TEST(LocalAgreement, MotionsOfTissueCountByTheRiseThatDependsOnThem) {
  const LocalAgreement found = agreement_of(three_to_one()).value();
  const LocalAgreement all = agreement_of(Wishes(std::vector<Vector3d>(6, kCornerMm))).value();
  EXPECT_NEAR(found.tissue_motion_mm, 0.5 * kCornerMm.norm(), 1e-9);
  EXPECT_NEAR(found.wide_motion_mm, 0.5 * kCornerMm.norm(), 1e-9);
  EXPECT_NEAR(found.deformation_mm, 0.5 * all.deformation_mm, 1e-9);
}

TEST(Clusters, NeighboursAreThoseWhoseCubesTouch) {
  // Three in a row, one that touches the last by an edge, and one on its own.
  const Clusters clusters({{5, 5, 5}, {15, 5, 5}, {25, 5, 5}, {35, 15, 5}, {95, 5, 5}}, 10.0);
  ASSERT_EQ(clusters.count(), 5U);
  EXPECT_EQ(clusters.middles_us_mm()[3], Vector3d(35, 15, 5));
  EXPECT_EQ(clusters.sums_of_neighbours({1, 2, 4, 8, 16}), (std::vector<double>{2, 5, 10, 4, 0}));
}

/// By hand: a cluster wishes (4, 0, 0). Its contributions are exp(-d) for 27 distances d (in steps)
/// on a lattice of which it wishes the middle of a face.
TEST(LocalAgreement, IsTheShareOfTheRiseInReachLessWhatChanceMakesUp) {
  double sum = 0.0;
  for (const int x : {0, 1, 2})
    for (const int y : {-1, 0, 1})
      for (const int z : {-1, 0, 1}) sum += std::exp(-std::sqrt(x * x + y * y + z * z));
  const double mean = sum / 27.0;
  EXPECT_NEAR(agreement(Wishes({{kStepMm, 0.0, 0.0}})),
              (std::exp(-1.0) - mean) / (1.0 - mean) - by_chance(1), 1e-9);
}

TEST(LocalAgreement, AdvantageIsTheRootOfTheNumberOfClustersThatGainAlike) {
  for (const int clusters : {1, 4, 9})
    EXPECT_NEAR(agreement_of(Wishes(std::vector<Vector3d>(clusters, Vector3d::Zero())))->advantage,
                std::sqrt(clusters), 1e-9);
}

/// By hand: one of three clusters wishes to lie at a face of the lattice, and gains less.
TEST(LocalAgreement, AdvantageWeighsGainsAgainstWhatTheyDifferBy) {
  double middle = 0.0;
  double face = 0.0;
  for (const int x : {-1, 0, 1})
    for (const int y : {-1, 0, 1})
      for (const int z : {-1, 0, 1}) {
        middle += std::exp(-std::sqrt(x * x + y * y + z * z)) / 27.0;
        face += std::exp(-std::hypot(x + 1.0, y, z)) / 27.0;
      }
  const double whole = 1.0 - middle;
  const double less = std::exp(-1.0) - face;
  EXPECT_NEAR(agreement_of(Wishes({{0, 0, 0}, {kStepMm, 0, 0}, {0, 0, 0}}))->advantage,
              (2.0 * whole + less) / std::sqrt(2.0 * whole * whole + less * less), 1e-9);
}

/// Four times as many clusters with the same noise say the same twice as surely.
RC_GTEST_PROP(LocalAgreement, AdvantageGrowsWithTheRootOfTheNumberOfClusters, ()) {
  std::vector<Vector3d> wished;
  for (int i = 0; i < 5; ++i) wished.push_back(random_pose(6.0).translation());
  std::vector<Vector3d> more;
  for (int i = 0; i < 4; ++i) more.insert(more.end(), wished.begin(), wished.end());
  RC_ASSERT(std::abs(agreement_of(Wishes(more))->advantage -
                     2.0 * agreement_of(Wishes(wished))->advantage) < 1e-9);
}

RC_GTEST_PROP(LocalAgreement, DoesNotDependOnTheScaleOfTheSimilarity, ()) {
  std::vector<Vector3d> wished;
  for (int i = 0; i < 6; ++i) wished.push_back(random_pose(6.0).translation());
  const Wishes wishes(wished);
  const double scale = uniform(0.01, 100.0);
  RC_ASSERT(std::abs(agreement(wishes) - agreement(wishes.times(scale))) < 1e-9);
}

TEST(LocalAgreement, SimilaritiesWithoutPartsOrDifferencesSayNothing) {
  EXPECT_FALSE(agreement_of(Wishes({})));
  EXPECT_FALSE(agreement_of(Wishes({Vector3d::Zero()}).times(0.0)));
}

}  // namespace
}  // namespace usct::test
