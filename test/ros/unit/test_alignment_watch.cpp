#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/alignment/alignment_watch.h"
#include "ros/conversions/poses.h"

namespace usct::ros_interface {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;
using testing::IsEmpty;

/// An alignment that is announced and broadcast as by tf_publisher. The clock of the wall is set by
/// hand.
class WatchedAlignment : public testing::Test {
 protected:
  static us_ct_registration::Alignment aligned_at(double x_mm) {
    us_ct_registration::Alignment message;
    message.state = us_ct_registration::Alignment::ACCEPTED;
    message.header.frame_id = "patient";
    message.ct_frame = "ct";
    message.transform = to_message(Eigen::Isometry3d(Eigen::Translation3d(x_mm, 0, 0)));
    return message;
  }
  void broadcast(double seconds, double x_mm) {
    for (const double stamp_s : {seconds, seconds + 0.2})
      tf_.set_transform(
          stamped_transform(::ros::Time(stamp_s),
                            Eigen::Isometry3d(Eigen::Translation3d(x_mm, 0, 0)), "patient", "ct"),
          "test");
  }
  /// The watch's problem at a time of ROS, so many milliseconds of the wall later.
  std::string problem_at(double seconds, int passed_ms) {
    wall_now_ += milliseconds(passed_ms);
    const std::string before = watch_.problem();
    const bool is_changed = watch_.look_up(tf_, ::ros::Time(seconds), wall_now_);
    EXPECT_EQ(is_changed, before != watch_.problem());
    return watch_.problem();
  }

  TfBuffer tf_{::ros::Duration(60.0)};
  AlignmentWatch watch_;
  AlignmentWatch::Clock::time_point wall_now_;
};

TEST_F(WatchedAlignment, IsInForceWhileTfHasItAndAgainLater) {
  EXPECT_THAT(problem_at(100.0, 5000), IsEmpty());  // there is none
  watch_.arrived(aligned_at(1.0));
  broadcast(100.0, 1.0);
  for (int i = 0; i < 30; ++i) EXPECT_THAT(problem_at(100.1, 100), IsEmpty());
  // tf_publisher has died.
  EXPECT_THAT(problem_at(100.3, 100), IsEmpty());
  EXPECT_THAT(problem_at(101.2, 900), IsEmpty());
  EXPECT_THAT(problem_at(101.3, 100), HasSubstr("tf does not connect 'ct' to 'patient'"));
  const std::string words = watch_.problem();
  EXPECT_EQ(problem_at(107.0, 5000), words);
  watch_.arrived(aligned_at(1.0));  // the same is no better for being said again
  EXPECT_EQ(problem_at(107.0, 0), words);
  broadcast(108.0, 1.0);
  EXPECT_THAT(problem_at(108.1, 100), IsEmpty());
}

TEST_F(WatchedAlignment, ASwitchIsNoInterruption) {
  watch_.arrived(aligned_at(1.0));
  broadcast(100.0, 1.0);
  EXPECT_THAT(problem_at(100.1, 0), IsEmpty());
  watch_.arrived(aligned_at(2.0));
  EXPECT_THAT(problem_at(100.15, 50), IsEmpty());
  EXPECT_THAT(problem_at(100.2, 50), IsEmpty());
  broadcast(100.2 + 1e-6, 2.0);
  EXPECT_THAT(problem_at(100.25, 50), IsEmpty());
  // Time runs back, and tf is forgotten and comes again.
  tf_.clear();
  EXPECT_THAT(problem_at(50.0, 100), IsEmpty());
  broadcast(50.0, 2.0);
  for (int i = 0; i < 30; ++i) EXPECT_THAT(problem_at(50.1, 100), IsEmpty());
}

TEST_F(WatchedAlignment, IsNotInForceWhereTfHasAnotherOne) {
  watch_.arrived(aligned_at(1.0));
  broadcast(100.0, 1.01);
  EXPECT_THAT(problem_at(100.1, 0), IsEmpty());
  EXPECT_THAT(problem_at(100.1, 1000), HasSubstr("where another alignment has it"));
  watch_.arrived(aligned_at(1.01));
  EXPECT_THAT(watch_.problem(), IsEmpty());
  EXPECT_THAT(problem_at(100.1, 5000), IsEmpty());
  watch_.arrived({});  // reverted
  EXPECT_THAT(problem_at(200.0, 5000), IsEmpty());
  EXPECT_THAT(problem_at(200.0, 5000), IsEmpty());
}

TEST_F(WatchedAlignment, IsNotTheNewestTransformBeforeTimeHasBegun) {
  watch_.arrived(aligned_at(1.0));
  broadcast(100.0, 1.0);
  EXPECT_THAT(problem_at(0.0, 0), IsEmpty());
  EXPECT_THAT(problem_at(0.0, 1000), HasSubstr("simulated time has not begun"));
}

}  // namespace
}  // namespace usct::ros_interface
