#include <gtest/gtest.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/CtVolume.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <optional>

#include "clock.h"
#include "ros/alignment/alignment_broadcaster.h"
#include "ros/conversions/ct.h"
#include "ros/conversions/surface_markers.h"
#include "ros/conversions/times.h"
#include "ros/process.h"
#include "ros/tf_source.h"
#include "ros/us_ingest/inbox.h"
#include "sweep.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using diagnostic_msgs::DiagnosticArray;
using diagnostic_msgs::DiagnosticStatus;
using visualization_msgs::MarkerArray;

const ::ros::Time kBegin(2000.0);
const ::ros::WallDuration kTick(0.02);
/// Longer than a node waits before it believes that tf has lost an alignment.
const ::ros::WallDuration kBreak(1.5);

/// A node that shows an alignment while a bag is played. The test announces alignments, and
/// broadcasts them as tf_publisher does. `Shows` says whether a message shows one as in force.
template <typename Message>
class ShownAlignment : public testing::Test {
 protected:
  using Shows = std::function<bool(const Message&)>;

  ShownAlignment(const std::string& space, const std::string& program, const std::string& topic,
                 Shows shows)
      : space_(space),
        clock_(node_),
        player_(node_.createWallTimer(kTick,
                                      [this](const ::ros::WallTimerEvent&) {
                                        clock_.set(
                                            ::ros::Time().fromNSec(now_ns_ += kTick.toNSec()));
                                      })),
        broadcaster_(node_, {}, watch_),
        process_(program, {"__ns:=" + space, "_fixed_frame:=patient", "_diagnostic_period:=0.05"}),
        tf_(node_, {"/" + space + "/" + program}),
        alignments_(node_.advertise<msg::Alignment>(space + "/registration/alignment", 1, true)),
        sweeps_(node_.advertise<msg::PreScanVolume>(space + "/us/volume", 1, true)),
        cts_(node_.advertise<msg::CtVolume>(space + "/ct/volume", 1, true)),
        surfaces_(node_.advertise<MarkerArray>(space + "/ct/surface", 1, true)),
        shown_(node_, topic),
        diagnostics_(node_, "/diagnostics"),
        shows_(std::move(shows)) {
    tf_.publish(pose_of("us_shown", kBegin));
    sweeps_.publish(sweep("us_shown", kBegin));
    Grid grid;
    grid.size = {4, 4, 4};
    ct_ = to_message(CtVolume(grid), header("ct"), 1);
    cts_.publish(ct_);
    Surface triangle;
    triangle.points_mm = {{0, 0, 0}, {10, 0, 0}, {0, 20, 0}};
    triangle.triangles = {{0, 1, 2}};
    surfaces_.publish(to_markers({{2, triangle}}, {}, "ct", ct_.crc32));
  }

  // Its callback uses the members.
  ~ShownAlignment() override { player_.stop(); }

  static std_msgs::Header header(const std::string& frame) {
    std_msgs::Header header;
    header.frame_id = frame;
    header.stamp = kBegin;
    return header;
  }

  void announce(double x_m) {
    msg::Alignment message;
    message.header = header("patient");
    message.state = msg::Alignment::ACCEPTED;
    message.ct_frame = "ct";
    message.ct_crc32 = ct_.crc32;
    message.transform.translation.x = x_m;
    message.transform.rotation.w = 1.0;
    message.message = "it is broadcast";
    alignments_.publish(message);
  }

  void broadcast(double x_m) {
    Alignment alignment;
    alignment.fixed_frame = "patient";
    alignment.ct_frame = "ct";
    alignment.T_fixed_ct.translation_m.x() = x_m;
    alignment.T_fixed_ct.rotation = Eigen::Quaterniond::Identity();
    broadcaster_.show(alignment);
  }

  bool is_shown() const {
    const auto all = shown_.all();
    const auto found =
        std::find_if(all.rbegin(), all.rend(), [&](const auto& one) { return is_of_node(*one); });
    return found != all.rend() && shows_(**found);
  }
  /// Whether the alignment was shown as in force in all messages from the first one that did so.
  bool was_shown_without_a_break() const {
    bool has_begun = false;
    for (const auto& one : shown_.all()) {
      if (!is_of_node(*one)) continue;
      const bool shows = shows_(*one);
      if (has_begun && !shows) return false;
      has_begun = has_begun || shows;
    }
    return true;
  }
  bool is_of_node(const MarkerArray& /*array*/) const { return true; }
  bool is_of_node(const DiagnosticArray& array) const {
    return std::any_of(array.status.begin(), array.status.end(),
                       [&](const auto& one) { return one.name.find(space_) != std::string::npos; });
  }

  void expect_to_be_shown_while_tf_has_it() {
    broadcast(0.1);
    announce(0.1);
    ASSERT_TRUE(eventually([&] { return is_shown(); }));
    // A switch, after which tf has the alignment before for as long as it was post-dated.
    broadcast(0.3);
    announce(0.3);
    kBreak.sleep();
    // The bag begins again.
    now_ns_ -= ::ros::Duration(100.0).toNSec();
    kBreak.sleep();
    EXPECT_TRUE(was_shown_without_a_break());
    EXPECT_TRUE(is_shown());
    // tf_publisher dies.
    broadcaster_.show(std::nullopt);
    EXPECT_TRUE(eventually([&] { return !is_shown(); }));
    EXPECT_TRUE(wait_for_diagnostics(diagnostics_, space_, DiagnosticStatus::WARN,
                                     "tf does not connect 'ct' to 'patient'"));
    // It is there again, and then somebody else has put the CT elsewhere.
    broadcast(0.3);
    EXPECT_TRUE(eventually([&] { return is_shown(); }));
    broadcast(0.7);
    EXPECT_TRUE(eventually([&] { return !is_shown(); }));
    EXPECT_TRUE(wait_for_diagnostics(diagnostics_, space_, DiagnosticStatus::WARN,
                                     "tf has the CT where another alignment has it"));
  }

  const std::string space_;
  ::ros::NodeHandle node_;
  Clock clock_;
  std::atomic<std::int64_t> now_ns_{nanoseconds_from(kBegin)};
  ::ros::WallTimer player_;
  TfWatch watch_;
  AlignmentBroadcaster broadcaster_;
  const Process process_;
  const TfSource tf_;
  ::ros::Publisher alignments_;
  ::ros::Publisher sweeps_;
  ::ros::Publisher cts_;
  ::ros::Publisher surfaces_;
  msg::CtVolume ct_;
  Inbox<Message> shown_;
  Inbox<DiagnosticArray> diagnostics_;
  const Shows shows_;
};

class AlignmentAsSurfaces : public ShownAlignment<MarkerArray> {
 protected:
  AlignmentAsSurfaces()
      : ShownAlignment("surfaces", "us_cloud", "surfaces/ct/surface_placed",
                       [](const MarkerArray& array) {
                         return std::any_of(array.markers.begin(), array.markers.end(),
                                            [](const auto& one) { return !one.points.empty(); });
                       }) {}
};

/// The pose that fusion_view would draw stands in its diagnostics.
class AlignmentAsView : public ShownAlignment<DiagnosticArray> {
 protected:
  AlignmentAsView()
      : ShownAlignment("shown_view", "fusion_view", "/diagnostics",
                       [](const DiagnosticArray& array) {
                         for (const auto& status : array.status)
                           for (const auto& one : status.values)
                             if (one.key == "pose" && one.value.rfind("ACCEPTED", 0) == 0)
                               return true;
                         return false;
                       }) {}
};

TEST_F(AlignmentAsSurfaces, IsShownWhileTfHasIt) { expect_to_be_shown_while_tf_has_it(); }

TEST_F(AlignmentAsView, IsShownWhileTfHasIt) { expect_to_be_shown_while_tf_has_it(); }

}  // namespace
}  // namespace usct::ros_interface
