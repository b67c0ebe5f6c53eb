#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <tf2/exceptions.h>
#include <tf2_msgs/TFMessage.h>

#include <fstream>
#include <set>

#include "ros/bags/acquisition_bag.h"
#include "ros/conversions/frames.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "ros/tf/frame_name.h"
#include "ros/tf/tf_buffer.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using ::ros::Duration;
using ::ros::Time;

/// Time that tf remembers, longer than any recording, s.
constexpr double kWholeRecording_s = 1e9;
/// Time after which the last sweep has ended, longer than any `sweep_pause`, s.
constexpr double kEndS = 1e6;

/// The transforms of a bag.
struct BagTf {
  TfBuffer buffer{Duration(kWholeRecording_s), kMaxTfGap_s};
  /// The frames that do not move in the one from which they hang.
  std::set<std::string> at_rest;
};

/// Finds messages by their type, since the recorder of a bag may have chosen any topics.
class BagReader {
 public:
  explicit BagReader(const std::filesystem::path& path) : path_(path), bag_(path.string()) {}

  void visit_ct(const BagVisitor& visitor) const {
    for_each<msg::CtVolume>(
        [&](const msg::CtVolume::ConstPtr& message, const Time&) { visitor.ct(*message); });
  }

  void visit_ultrasound(const BagVisitor& visitor) const {
    const int volumes = for_each<msg::PreScanVolume>(
        [&](const msg::PreScanVolume::ConstPtr& message, const Time&) { visitor.us(*message); });
    if (volumes == 0) assemble(visitor);
  }

 private:
  /// Calls `take` for each message of a type and returns how many there are. Throws InputError if
  /// several topics have messages of this type.
  template <typename Message>
  int for_each(
      const std::function<void(const typename Message::ConstPtr&, const Time&)>& take) const {
    const std::string type = ::ros::message_traits::datatype<Message>();
    rosbag::View view(bag_, rosbag::TypeQuery(type));
    std::set<std::string> topics;
    for (const rosbag::ConnectionInfo* connection : view.getConnections())
      topics.insert(connection->topic);
    if (topics.size() > 1)
      throw InputError(path_.string(), "has " + type + " on several topics (" + *topics.begin() +
                                           ", " + *topics.rbegin() +
                                           "), must be one: 'rosbag filter' keeps one");
    int count = 0;
    for (const rosbag::MessageInstance& instance : view) {
      const typename Message::ConstPtr message = instance.instantiate<Message>();
      if (!message)
        throw InputError(path_.string(), "has " + type + " of another version of this package");
      take(message, instance.getTime());
      ++count;
    }
    return count;
  }

  void assemble(const BagVisitor& visitor) const {
    BagTf tf;
    read_tf(tf);
    SweepAssembler assembler{AssemblyOptions()};
    Time last;
    for_each<msg::PreScanFrame>([&](const msg::PreScanFrame::ConstPtr& message, const Time& time) {
      const std::int64_t time_ns = nanoseconds_from(time);
      pass_on(assembler.end_after_pause(time_ns), visitor);
      pass_on(add(message, visitor.pose_frame, tf, time_ns, assembler), visitor);
      last = time;
    });
    pass_on(assembler.end_after_pause(nanoseconds_from(last + Duration(kEndS))), visitor);
  }

  static std::vector<EndedSweep> add(const msg::PreScanFrame::ConstPtr& message,
                                     const std::string& pose_frame, const BagTf& tf,
                                     std::int64_t time_ns, SweepAssembler& assembler) {
    std::shared_ptr<ReceivedFrame> frame;
    try {
      frame = from_message(message);
    } catch (const InputError& error) {
      return assembler.add_invalid(error.what(), time_ns);
    }
    if (frame->needs_pose()) look_up_pose(tf, pose_frame, *frame);
    return assembler.add(frame, time_ns);
  }

  static void pass_on(const std::vector<EndedSweep>& sweeps, const BagVisitor& visitor) {
    for (const EndedSweep& sweep : sweeps) {
      if (!sweep.message.empty())
        visitor.warning("sweep " + std::to_string(sweep.number) + ": " + sweep.message);
      if (sweep.assembled) visitor.us(*to_message(*sweep.assembled));
    }
  }

  void read_tf(BagTf& tf) const {
    rosbag::View view(bag_, rosbag::TypeQuery("tf2_msgs/TFMessage"));
    for (const rosbag::MessageInstance& instance : view) {
      const std::string& topic = instance.getTopic();
      const bool is_static = topic.size() >= 10 && topic.substr(topic.size() - 10) == "/tf_static";
      const tf2_msgs::TFMessage::ConstPtr message = instance.instantiate<tf2_msgs::TFMessage>();
      for (const geometry_msgs::TransformStamped& transform : message->transforms) {
        tf.buffer.set_transform(transform, "bag", is_static);
        if (is_static) tf.at_rest.insert(frame_name(transform.child_frame_id));
      }
    }
  }

  /// Sets the pose of a tracked frame that carries none, or says why there is none.
  static void look_up_pose(const BagTf& tf, const std::string& pose_frame, ReceivedFrame& frame) {
    const Time& stamp = frame.message->header.stamp;
    const std::string us_frame =
        pose_frame.empty() ? tf.buffer.parent_of(frame.frame_id, stamp) : pose_frame;
    if (us_frame.empty()) {
      frame.pose_problem = "tf does not know '" + frame.frame_id + "' at the stamp";
      return;
    }
    // All frames would lie at one place.
    if (pose_frame.empty() && tf.at_rest.count(frame_name(frame.frame_id)) > 0) {
      frame.pose_problem = "'" + frame.frame_id + "' does not move in '" + us_frame +
                           "', from which it hangs in tf: --pose-frame names the frame in which "
                           "the probe moves";
      return;
    }
    try {
      const geometry_msgs::Transform T =
          tf.buffer.look_up(us_frame, frame.frame_id, stamp).transform;
      frame.set_looked_up(to_pose_message(from_message_mm(T, "tf")), us_frame);
    } catch (const tf2::TransformException& error) {
      frame.pose_problem = error.what();
    }
  }

  std::filesystem::path path_;
  rosbag::Bag bag_;
};

}  // namespace

std::string words_for_bad_bag(const std::filesystem::path& path, const std::string& error) {
  std::error_code ignored;  // is_regular_file is then false
  if (!std::filesystem::exists(path, ignored)) return "does not exist";
  if (!std::filesystem::is_regular_file(path, ignored)) return "is no file, must be a bag";
  std::ifstream file(path, std::ios::binary);
  if (!file) return "cannot be opened";
  std::string begin(7, '\0');
  file.read(begin.data(), 7);
  if (begin != "#ROSBAG") return "is no bag: it does not begin with '#ROSBAG'";
  return error + "; a bag whose recording was broken off is repaired by 'rosbag reindex'";
}

void visit_acquisition_bag(const std::filesystem::path& path, const BagVisitor& visitor) {
  try {
    const BagReader reader(path);
    if (visitor.us) reader.visit_ultrasound(visitor);
    if (visitor.ct) reader.visit_ct(visitor);
  } catch (const rosbag::BagException& error) {
    throw InputError(path.string(), words_for_bad_bag(path, error.what()));
  }
}

}  // namespace usct::ros_interface
