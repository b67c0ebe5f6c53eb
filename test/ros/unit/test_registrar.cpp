#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/make_shared.hpp>
#include <cmath>
#include <functional>
#include <utility>

#include "ros/conversions/ct.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/ultrasound.h"
#include "ros/registration/registrar.h"
#include "ros/tf/tf_buffer.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

const auto not_cancelled = [] { return false; };

boost::shared_ptr<msg::CtVolume> flat_ct_message(std::int16_t hu) {
  CtVolume ct;
  ct.grid.size = {6, 5, 4};
  ct.voxels.assign(ct.grid.voxel_count(), hu);
  std_msgs::Header header;
  header.frame_id = "ct";
  header.stamp = ::ros::Time(10.0);
  return boost::make_shared<msg::CtVolume>(to_message(ct, header, static_cast<std::uint32_t>(hu)));
}

class RegistrarCt : public testing::Test {
 protected:
  void arrive(const msg::CtVolume::ConstPtr& message) {
    volumes_.arrived(message, ::ros::Time(200.0));
    try {
      volumes_.ct(not_cancelled);  // waits until it is converted
    } catch (const Refusal&) {
    }
  }

  TfBuffer tf_{::ros::Duration(60.0)};
  FixedFrame frame_{tf_, FixedFrameOptions()};
  HeldVolumes volumes_{frame_, HeldVolumesOptions(), [] {}};
  InitialAlignments alignments_{frame_, std::nullopt};
  Registrar registrar_{RegistrarOptions(), volumes_, alignments_, frame_, "test"};
};

TEST_F(RegistrarCt, OptionsOfTheSearchWithoutAnInitialAlignmentAreCheckedAtTheStart) {
  const auto refusal = [&](const std::string& preset, const std::string& options) -> std::string {
    RegistrarOptions registrar;
    registrar.preset = preset;
    registrar.options = options;
    registrar.allow_global = true;
    try {
      Registrar(registrar, volumes_, alignments_, frame_, "test");
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_EQ(refusal("patient", "search: {rounds: 1}"), "none");
  EXPECT_THAT(refusal("", "preset: patient\nsearch: {rounds: 1}"),
              testing::HasSubstr("'preset' is empty, must name a preset if allow_global is true"));
  // The preset has no third level, and 'global' neither.
  EXPECT_THAT(refusal("patient", "search: {levels: {2: {optimised: 1}}}"),
              testing::HasSubstr("search.levels"));
}

TEST_F(RegistrarCt, IsPreparedOnce) {
  EXPECT_FALSE(registrar_.is_ct_unprepared());
  for (const std::int16_t hu : {1, 2}) {
    arrive(flat_ct_message(hu));
    EXPECT_TRUE(registrar_.is_ct_unprepared());
    registrar_.prepare_ct(not_cancelled);
    EXPECT_FALSE(registrar_.is_ct_unprepared());
  }
}

TEST_F(RegistrarCt, StaysUnpreparedIfItsPreparationIsCancelled) {
  arrive(flat_ct_message(1));
  registrar_.prepare_ct([] { return true; });
  EXPECT_TRUE(registrar_.is_ct_unprepared());
  registrar_.prepare_ct(not_cancelled);
  EXPECT_FALSE(registrar_.is_ct_unprepared());
}

TEST_F(RegistrarCt, IsForgottenWhenANewOneIsRefused) {
  arrive(flat_ct_message(1));
  registrar_.prepare_ct(not_cancelled);
  const std::weak_ptr<const HeldCt> held = volumes_.ct(not_cancelled);
  auto malformed = flat_ct_message(2);
  malformed->data.pop_back();
  arrive(malformed);
  EXPECT_TRUE(registrar_.is_ct_unprepared());
  EXPECT_FALSE(held.expired());
  registrar_.prepare_ct(not_cancelled);
  EXPECT_FALSE(registrar_.is_ct_unprepared());
  EXPECT_TRUE(held.expired());
}

using Status = msg::StatusCode;
using testing::HasSubstr;

/// A CT of 0.4 m with a pattern, around the origin or 2 m away.
boost::shared_ptr<msg::CtVolume> patterned_ct(std::uint32_t revision, double x_mm) {
  CtVolume ct;
  ct.grid.size = {40, 40, 40};
  ct.grid.spacing_mm = {10.0, 10.0, 10.0};
  ct.grid.origin_mm = {x_mm - 200.0, -200.0, -200.0};
  for (std::size_t i = 0; i < ct.grid.voxel_count(); ++i)
    ct.voxels.push_back(static_cast<std::int16_t>(i * 7919 % 311));
  std_msgs::Header header;
  header.frame_id = "ct";
  header.stamp = ::ros::Time(10.0);
  return boost::make_shared<msg::CtVolume>(to_message(ct, header, revision));
}

boost::shared_ptr<msg::PreScanVolume> patterned_ultrasound(double stamp_s) {
  PreScanVolume volume;
  volume.geometry.axial = {40, 3.0, 2.0};
  CurvilinearArray array{40.0, {}};
  MotorSweep motor{27.25, {}, 0.0};
  for (int i = 0; i < 16; ++i) array.line_angles_rad.push_back(0.05 * (i - 7.5));
  for (int i = 0; i < 12; ++i) motor.frame_angles_rad.push_back(0.06 * (i - 5.5));
  volume.geometry.array = array;
  volume.geometry.motion = motor;
  for (int frame = 0; frame < 12; ++frame)
    for (int line = 0; line < 16; ++line)
      for (int sample = 0; sample < 40; ++sample)
        volume.voxels.push_back(static_cast<std::uint8_t>(
            128.0 + 100.0 * std::sin(0.5 * sample + 0.4 * frame) * std::sin(0.6 * line)));
  std_msgs::Header header;
  header.frame_id = "us";
  header.stamp = ::ros::Time(stamp_s);
  return boost::make_shared<msg::PreScanVolume>(to_message(volume, header));
}

/// Requests for ultrasound with the stamp 100 s, of a probe that tf has in the frame "patient".
class RegistrarRun : public testing::Test {
 protected:
  static constexpr double kStampS = 100.0;

  void know(double seconds, double x_mm) {
    tf_.set_transform(
        stamped_transform(::ros::Time(seconds), Eigen::Isometry3d(Eigen::Translation3d(x_mm, 0, 0)),
                          "patient", "us"),
        "test");
  }
  void arrive(const msg::CtVolume::ConstPtr& message) {
    volumes_.arrived(message, ::ros::Time(200.0));
  }
  void arrive(const msg::PreScanVolume::ConstPtr& message) {
    volumes_.arrived(message, ::ros::Time(200.0));
  }
  void hold_images() {
    arrive(patterned_ultrasound(kStampS));
    arrive(patterned_ct(1, 0.0));
  }
  msg::RegistrationResult run() {
    RegistrationRequest request;
    request.preset = "fast";
    request.initial.emplace();
    request.initial->header.frame_id = "us";
    request.initial->transform.rotation.w = 1.0;
    request.cancelled = not_cancelled;
    request.progress = [this](double, const std::string& stage) {
      if (stage == "registering" && during_) std::exchange(during_, nullptr)();
    };
    return registrar_.run(request);
  }
  static FixedFrameOptions in_patient() {
    FixedFrameOptions options;
    options.frame = "patient";
    options.max_tf_age_s = 0.5;
    options.sweep_duration_s = 0.5;
    return options;
  }
  static HeldVolumesOptions impatient() {
    HeldVolumesOptions options;
    options.tf_timeout_s = 0.1;
    return options;
  }

  TfBuffer tf_{::ros::Duration(60.0)};
  FixedFrame frame_{tf_, in_patient()};
  HeldVolumes volumes_{frame_, impatient(), [] {}};
  InitialAlignments alignments_{frame_, std::nullopt};
  Registrar registrar_{RegistrarOptions(), volumes_, alignments_, frame_, "test"};
  std::function<void()> during_;  // called once the registration runs
};

/// A request that comes with a new CT interrupts its preparation; that of the CT before is held.
TEST_F(RegistrarRun, IsOfTheCtThatIsHeldAndNotOfTheOneThatWasPrepared) {
  know(98.0, 0.0);
  know(101.0, 0.0);
  hold_images();
  volumes_.ct(not_cancelled);
  registrar_.prepare_ct(not_cancelled);
  const msg::RegistrationResult first = run();
  EXPECT_EQ(first.ct_revision, 1U);
  EXPECT_NE(first.status.code, Status::NO_OVERLAP) << first.status.message;
  arrive(patterned_ct(2, 2000.0));
  const msg::RegistrationResult second = run();
  EXPECT_EQ(second.ct_revision, 2U);
  EXPECT_EQ(second.status.code, Status::NO_OVERLAP) << second.status.message;
}

TEST_F(RegistrarRun, ACtThatArrivesMeanwhileEndsIt) {
  know(98.0, 0.0);
  know(101.0, 0.0);
  hold_images();
  during_ = [this] { arrive(patterned_ct(2, 0.0)); };
  const msg::RegistrationResult result = run();
  EXPECT_FALSE(during_);
  EXPECT_EQ(result.status.code, Status::FAILED);
  EXPECT_THAT(result.status.message, HasSubstr("another CT arrived while CT revision 1"));
}

TEST_F(RegistrarRun, ACtThatIsAnnouncedMeanwhileEndsIt) {
  know(98.0, 0.0);
  know(101.0, 0.0);
  hold_images();
  during_ = [this] {
    msg::CtInfo info;
    info.header.frame_id = "ct";
    info.crc32 = 1;
    volumes_.announced(info);
  };
  const msg::RegistrationResult result = run();
  EXPECT_FALSE(during_);
  EXPECT_EQ(result.status.code, Status::FAILED);
  EXPECT_THAT(result.status.message, HasSubstr("another CT arrived while CT revision 1"));
}

TEST_F(RegistrarRun, SaysThatAMotionAfterTheStampWasNotSeen) {
  know(98.0, 0.0);
  know(100.01, 0.0);
  hold_images();
  EXPECT_THAT(run().status.message, HasSubstr("a motion there was not seen"));
  know(101.0, 0.0);
  EXPECT_THAT(run().status.message, testing::Not(HasSubstr("a motion there was not seen")));
}

TEST_F(RegistrarRun, AJumpThatTfTellsWhileItRunsRefusesIt) {
  know(98.0, 0.0);
  know(100.01, 0.0);
  hold_images();
  during_ = [this] {
    know(100.02, 30.0);
    know(101.0, 30.0);
  };
  EXPECT_EQ(run().status.code, Status::TF_JUMPED);
}

TEST_F(RegistrarRun, SaysHowOldTfWas) {
  know(98.0, 0.0);
  know(99.75, 0.0);
  hold_images();
  EXPECT_THAT(run().status.message, HasSubstr("tf was 0.250 s older than the ultrasound's stamp"));
  know(101.0, 0.0);
  arrive(patterned_ultrasound(kStampS));
  EXPECT_THAT(run().status.message, testing::Not(HasSubstr("older than the ultrasound's stamp")));
}

TEST_F(RegistrarRun, ARefusedUltrasoundIsNamedInItsResult) {
  know(98.0, 0.0);
  know(99.97, 0.0);
  know(99.98, 30.0);
  know(101.0, 30.0);
  hold_images();
  const msg::RegistrationResult result = run();
  EXPECT_EQ(result.status.code, Status::TF_JUMPED);
  EXPECT_EQ(result.us_stamp, ::ros::Time(kStampS));
  EXPECT_EQ(result.header.frame_id, "us");
  EXPECT_EQ(result.fixed_frame, "patient");
}

}  // namespace
}  // namespace usct::ros_interface
