#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/conversions/poses.h"
#include "ros/fusion/fusion_scene.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Eigen::Isometry3d;
using Eigen::Vector3d;
using testing::AllOf;
using testing::HasSubstr;

constexpr std::uint32_t kCrc = 77;
const Isometry3d kPatientUs(Eigen::Translation3d(100, 200, 300));
const Isometry3d kUsCt(Eigen::Translation3d(1, 2, 3));

std_msgs::Header us_header(double stamp_s = 1000.0) {
  std_msgs::Header header;
  header.stamp = ::ros::Time(stamp_s);
  header.frame_id = "us";
  return header;
}

std::shared_ptr<FusionUltrasound> ultrasound(double stamp_s = 1000.0) {
  auto us = std::make_shared<FusionUltrasound>();
  us->header = us_header(stamp_s);
  us->fixed_frame = "patient";
  us->T_fixed_us = kPatientUs;
  return us;
}

std::shared_ptr<FusionCt> held_ct(std::uint32_t crc32 = kCrc) {
  auto ct = std::make_shared<FusionCt>();
  ct->crc32 = crc32;
  return ct;
}

msg::Alignment alignment(std::uint8_t state, std::uint64_t id) {
  msg::Alignment message;
  message.state = state;
  message.header = us_header();
  message.header.frame_id = "patient";
  message.result_id = id;
  message.ct_crc32 = kCrc;
  message.transform = to_message(kPatientUs * kUsCt);
  message.expected_error = 0.0015;
  return message;
}

msg::RegistrationResult result(std::uint64_t id, std::uint8_t code = msg::StatusCode::REGISTERED) {
  msg::RegistrationResult message;
  message.header = us_header();
  message.us_stamp = message.header.stamp;
  message.id = id;
  message.ct_crc32 = kCrc;
  message.status.code = code;
  message.status.message = "too few edges";
  // It differs from that of the alignment, so that a test sees which one is drawn.
  const Isometry3d found = kUsCt * Eigen::Translation3d(0, 0, 0.5);
  if (code == msg::StatusCode::REGISTERED) message.transform = to_message(found);
  message.candidates.resize(1);
  message.candidates[0].transform = to_message(found);
  return message;
}

/// A keeper with ultrasound and CT.
struct Kept {
  FusionSceneKeeper keeper{FusionSceneOptions()};
  Kept() {
    keeper.take(std::shared_ptr<const FusionUltrasound>(ultrasound()));
    keeper.take(std::shared_ptr<const FusionCt>(held_ct()));
  }
  FusionPose pose() const { return keeper.scene().pose; }
  void expect_none(const std::string& reason) const {
    const FusionPose none = pose();
    EXPECT_EQ(none.standing, PoseStanding::kNone);
    EXPECT_FALSE(none.T_us_ct);
    EXPECT_THAT(none.headline, AllOf(HasSubstr("NO POSE"), HasSubstr(reason)));
  }
};

TEST(FusionScene, HasNothingToDrawWithoutUltrasound) {
  FusionSceneKeeper keeper{FusionSceneOptions()};
  EXPECT_EQ(keeper.scene().us, nullptr);
  keeper.take(std::shared_ptr<const FusionUltrasound>(ultrasound()));
  EXPECT_THAT(keeper.scene().pose.headline, HasSubstr("no CT has arrived"));
}

TEST(FusionScene, WhatWaitsComesBeforeWhatIsAcceptedBeforeWhatIsRefused) {
  Kept kept;
  kept.expect_none("nothing is accepted");
  kept.keeper.take_result(result(4, msg::StatusCode::LOW_CONFIDENCE));
  EXPECT_EQ(kept.pose().standing, PoseStanding::kRefused);
  EXPECT_THAT(kept.pose().headline, AllOf(HasSubstr("REFUSED"), HasSubstr("too few edges")));
  EXPECT_DOUBLE_EQ(kept.pose().T_us_ct->translation().z(), 3.5);

  kept.keeper.take_alignment(alignment(msg::Alignment::ACCEPTED, 5));
  EXPECT_EQ(kept.pose().standing, PoseStanding::kAccepted);
  EXPECT_THAT(kept.pose().headline, AllOf(HasSubstr("result 5"), HasSubstr("REFUSED")));
  EXPECT_THAT(kept.pose().evidence, HasSubstr("1.50 mm"));
  // Without its result the pose is that of the alignment.
  EXPECT_NEAR(kept.pose().T_us_ct->translation().z(), 3.0, 1e-9);
  kept.keeper.take_result(result(5));
  EXPECT_DOUBLE_EQ(kept.pose().T_us_ct->translation().z(), 3.5);

  kept.keeper.take_proposed(alignment(msg::Alignment::PROPOSED, 6));
  EXPECT_EQ(kept.pose().standing, PoseStanding::kWaiting);
  EXPECT_THAT(kept.pose().headline,
              AllOf(HasSubstr("WAITING"), HasSubstr("result 6"), HasSubstr("registration/accept 6"),
                    HasSubstr("registration/reject 6")));
  kept.keeper.take_proposed({});
  EXPECT_EQ(kept.pose().standing, PoseStanding::kAccepted);
  kept.keeper.take_alignment({});
  kept.expect_none("nothing is accepted");
}

TEST(FusionScene, ACancelledRegistrationChangesNothing) {
  Kept kept;
  kept.keeper.take_result(result(4, msg::StatusCode::LOW_CONFIDENCE));
  msg::RegistrationResult cancelled = result(5, msg::StatusCode::CANCELLED);
  cancelled.candidates.clear();
  kept.keeper.take_result(cancelled);
  EXPECT_EQ(kept.pose().standing, PoseStanding::kRefused);
  EXPECT_THAT(kept.pose().headline, HasSubstr("too few edges"));
}

TEST(FusionScene, TheResultInForceIsKnownForAsLongAsItIs) {
  Kept kept;
  kept.keeper.take_result(result(5));
  kept.keeper.take_alignment(alignment(msg::Alignment::ACCEPTED, 5));
  for (std::uint64_t id = 6; id < 40; ++id)
    kept.keeper.take_result(result(id, msg::StatusCode::LOW_CONFIDENCE));
  // As of the result; the alignment alone has 3.0.
  EXPECT_DOUBLE_EQ(kept.pose().T_us_ct->translation().z(), 3.5);
}

TEST(FusionScene, WhatIsRestoredSaysSo) {
  Kept kept;
  kept.keeper.take_alignment(alignment(msg::Alignment::RESTORED, 0));
  EXPECT_EQ(kept.pose().standing, PoseStanding::kAccepted);
  EXPECT_THAT(kept.pose().headline, HasSubstr("before a restart"));
}

TEST(FusionScene, WhatIsNotInTfIsNotDrawnAsAccepted) {
  Kept kept;
  kept.keeper.take_alignment(alignment(msg::Alignment::ACCEPTED, 5));
  const FusionScene accepted = kept.keeper.scene();
  TfBuffer tf;
  const AlignmentWatch::Clock::time_point begin;
  const ::ros::Time now(1001.0);
  EXPECT_FALSE(kept.keeper.look_up(tf, now, begin));
  EXPECT_EQ(kept.pose().standing, PoseStanding::kAccepted);
  EXPECT_TRUE(kept.keeper.look_up(tf, now, begin + AlignmentWatch::kPatience));
  kept.expect_none("is not in force: tf does not connect");
  EXPECT_FALSE(kept.keeper.is_current(accepted));
  kept.keeper.take_result(result(4, msg::StatusCode::LOW_CONFIDENCE));
  EXPECT_EQ(kept.pose().standing, PoseStanding::kRefused);
  EXPECT_THAT(kept.pose().headline, HasSubstr("is not in force"));
}

TEST(FusionScene, APoseOfOtherImagesIsNotDrawn) {
  for (const bool is_waiting : {false, true}) {
    Kept kept;
    msg::Alignment message = alignment(msg::Alignment::ACCEPTED, 5);
    if (is_waiting) message.state = msg::Alignment::PROPOSED;
    const auto take = [&](const msg::Alignment& one) {
      is_waiting ? kept.keeper.take_proposed(one) : kept.keeper.take_alignment(one);
    };
    kept.keeper.take_result(result(5));
    take(message);
    EXPECT_TRUE(kept.pose().T_us_ct);
    kept.keeper.take(std::shared_ptr<const FusionCt>(held_ct(kCrc + 1)));
    kept.expect_none("it is of another CT");
    kept.keeper.take(std::shared_ptr<const FusionCt>(held_ct()));
    kept.keeper.take(std::shared_ptr<const FusionUltrasound>(ultrasound(1001.0)));
    kept.expect_none("it is of another ultrasound, that of 1000.000 s");
  }
  Kept kept;
  for (int change = 0; change < 3; ++change) {
    msg::RegistrationResult refused = result(4, msg::StatusCode::LOW_CONFIDENCE);
    if (change == 0) refused.ct_crc32 = kCrc + 1;
    if (change == 1) refused.us_stamp = ::ros::Time(999.0);
    if (change == 2) refused.candidates.clear();
    kept.keeper.take_result(refused);
    kept.expect_none("nothing is accepted");
  }
}

TEST(FusionScene, APoseThatIsNotKnownIsNotDrawn) {
  Kept kept;
  auto us = ultrasound();
  us->T_fixed_us.reset();
  kept.keeper.take(std::shared_ptr<const FusionUltrasound>(us));
  kept.keeper.take_alignment(alignment(msg::Alignment::ACCEPTED, 5));
  kept.expect_none("is not known");
  msg::Alignment broken = alignment(msg::Alignment::ACCEPTED, 5);
  broken.header.frame_id = "us";
  broken.transform.rotation.w = 0.5;
  kept.keeper.take_alignment(broken);
  kept.expect_none("quaternion");
  EXPECT_THROW(
      {
        msg::RegistrationResult invalid = result(9);
        invalid.transform.rotation.w = 2.0;
        kept.keeper.take_result(invalid);
      },
      InputError);
}

TEST(FusionScene, IsOutdatedByEveryDecision) {
  Kept kept;
  kept.keeper.take_alignment(alignment(msg::Alignment::ACCEPTED, 5));
  const FusionScene accepted = kept.keeper.scene();
  EXPECT_TRUE(kept.keeper.is_current(accepted));
  // It is drawn of its own images, whatever came later.
  kept.keeper.take(std::shared_ptr<const FusionUltrasound>(ultrasound(1001.0)));
  EXPECT_TRUE(kept.keeper.is_current(accepted));
  kept.keeper.take_proposed(alignment(msg::Alignment::PROPOSED, 6));
  EXPECT_FALSE(kept.keeper.is_current(accepted));
  kept.keeper.take_proposed({});
  EXPECT_TRUE(kept.keeper.is_current(accepted));
  msg::Alignment moved = alignment(msg::Alignment::ACCEPTED, 5);
  moved.transform.translation.x += 1e-4;
  kept.keeper.take_alignment(moved);
  EXPECT_FALSE(kept.keeper.is_current(accepted));
  kept.keeper.take_alignment({});
  EXPECT_FALSE(kept.keeper.is_current(accepted));
}

TEST(FusionScene, ThePlanesMeetWhereSomebodySaysElseInTheLabel) {
  FusionSceneOptions options;
  options.centre_us_mm = Vector3d(7, 8, 9);
  FusionSceneKeeper keeper(options);
  keeper.take(std::shared_ptr<const FusionUltrasound>(ultrasound()));
  keeper.take(std::shared_ptr<const FusionCt>(held_ct()));
  visualization_msgs::MarkerArray surfaces;
  for (const char* name : {"1 left kidney", "2 tumour"}) {
    visualization_msgs::Marker marker;
    marker.ns = name;
    marker.action = visualization_msgs::Marker::ADD;
    marker.pose.orientation.w = 1.0;
    for (const double x_mm : {0.0, 10.0, 40.0})
      marker.points.push_back(to_message(Vector3d(x_mm, 0, 4)));
    surfaces.markers.push_back(marker);
  }
  keeper.take_surface(surfaces);
  const auto expect_centres = [&](const std::vector<Vector3d>& expected) {
    const std::vector<Vector3d> found = keeper.scene().centres_us_mm;
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i)
      EXPECT_LT((found[i] - expected[i]).norm(), 1e-9) << i;
  };
  expect_centres({{7, 8, 9}});  // a label has no place in the ultrasound without a pose
  keeper.take_alignment(alignment(msg::Alignment::ACCEPTED, 5));
  expect_centres({{7, 8, 9}, {21, 2, 7}});
  keeper.set_centre(FramedPoint{"patient", {101, 202, 303}});
  expect_centres({{1, 2, 3}, {7, 8, 9}, {21, 2, 7}});
  keeper.set_centre(FramedPoint{"elsewhere", {101, 202, 303}});
  expect_centres({{7, 8, 9}, {21, 2, 7}});
  keeper.set_centre(std::nullopt);
  expect_centres({{7, 8, 9}, {21, 2, 7}});
}

}  // namespace
}  // namespace usct::ros_interface
