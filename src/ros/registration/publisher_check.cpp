#include "ros/registration/publisher_check.h"

#include <ros/callback_queue.h>
#include <ros/master.h>
#include <ros/this_node.h>
#include <topic_tools/shape_shifter.h>

#include <chrono>
#include <map>
#include <optional>
#include <thread>

namespace usct::ros_interface {
namespace {

constexpr std::chrono::milliseconds kProbe(1000);
constexpr std::chrono::milliseconds kConnectionPoll(10);

bool within_probe_time(const std::function<bool()>& cancelled,
                       const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + kProbe;
  while (!condition()) {
    if (cancelled() || std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(kConnectionPoll);
  }
  return true;
}

/// Topics with publishers, and their types; none if the master does not answer.
/// `ros::master::getTopics` would wait for it, without end.
std::optional<std::map<std::string, std::string>> published_topics() {
  XmlRpc::XmlRpcValue request;
  request[0] = ::ros::this_node::getName();
  request[1] = "";
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue found;
  constexpr bool kWaitForMaster = false;
  if (!::ros::master::execute("getPublishedTopics", request, response, found, kWaitForMaster))
    return std::nullopt;
  std::map<std::string, std::string> topics;
  for (int i = 0; i < found.size(); ++i)
    topics[std::string(found[i][0])] = std::string(found[i][1]);
  return topics;
}

/// Findings of a subscriber that takes messages of any type.
struct Probe {
  bool connected = false;
  std::string md5sum;  // empty if no message arrived
};

Probe probe(::ros::NodeHandle node, const std::string& topic,
            const std::function<bool()>& cancelled) {
  Probe found;
  ::ros::CallbackQueue queue;
  node.setCallbackQueue(&queue);
  const ::ros::Subscriber any = node.subscribe<topic_tools::ShapeShifter>(
      topic, 1, [&](const topic_tools::ShapeShifter::ConstPtr& message) {
        found.md5sum = message->getMD5Sum();
      });
  within_probe_time(cancelled, [&] {
    queue.callAvailable();
    found.connected = found.connected || any.getNumPublishers() > 0;
    return !found.md5sum.empty();
  });
  return found;
}

std::string other_definition(const ExpectedTopic& expected, const std::string& md5sum) {
  return "the publisher of '" + expected.name + "' was built against another definition of " +
         expected.datatype + " (md5sum " + (md5sum.empty() ? "not known" : md5sum) +
         ", this node's is " + expected.md5sum + "): build both from the same .msg files";
}

}  // namespace

std::string why_nothing_arrived(const ::ros::NodeHandle& node, const ExpectedTopic& expected,
                                ::ros::Subscriber& subscriber,
                                const std::function<::ros::Subscriber()>& resubscribe,
                                const std::function<bool()>& cancelled) {
  const auto topics = published_topics();
  if (!topics) return "the ROS master at " + ::ros::master::getURI() + " does not answer";
  const auto type = topics->find(expected.name);
  if (type == topics->end()) return "'" + expected.name + "' has no publisher";
  if (type->second != expected.datatype)
    return "'" + expected.name + "' is published as " + type->second + ", must be " +
           expected.datatype;
  // The publisher may have started only now.
  if (within_probe_time(cancelled, [&] { return subscriber.getNumPublishers() > 0; }))
    return "the publisher of '" + expected.name +
           "' is connected, but has sent nothing yet: its diagnostics say what it does";
  // A subscriber for any type would share the connection of an existing subscriber to the topic,
  // and that connection is the one that fails.
  subscriber.shutdown();
  const Probe found = probe(node, expected.name, cancelled);
  subscriber = resubscribe();
  if (found.connected && found.md5sum != expected.md5sum)
    return other_definition(expected, found.md5sum);
  return "'" + expected.name + "' has a publisher, but no connection to it came about";
}

}  // namespace usct::ros_interface
