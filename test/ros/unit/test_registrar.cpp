#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/make_shared.hpp>

#include "ros/conversions/ct.h"
#include "ros/registrar.h"
#include "ros/tf_buffer.h"
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

}  // namespace
}  // namespace usct::ros_interface
