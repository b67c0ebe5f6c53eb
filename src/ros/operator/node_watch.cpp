#include "ros/operator/node_watch.h"

#include <set>
#include <utility>

#include "us_ct_registration/formatted.h"

namespace usct::ros_interface {
namespace {

using diagnostic_msgs::DiagnosticStatus;

/// Values that a person who registers has to know: how old the images are.
const std::set<std::string> kShownValues = {"newest ultrasound", "CT loaded", "accepted since (s)"};

std::string text_of(const DiagnosticStatus& status) {
  std::string text = status.message;
  for (const diagnostic_msgs::KeyValue& one : status.values)
    if (kShownValues.count(one.key) > 0) text += "; " + one.key + ": " + one.value;
  return text;
}

}  // namespace

NodeWatch::NodeWatch(std::string prefix, std::vector<std::string> names, double silence_s)
    : prefix_(std::move(prefix)), names_(std::move(names)), silence_s_(silence_s) {}

void NodeWatch::take(const diagnostic_msgs::DiagnosticArray& message, double now_s) {
  for (const DiagnosticStatus& status : message.status)
    for (const std::string& name : names_)
      // diagnostic_updater puts the node's name and a colon before the name of the task.
      if (status.name.rfind(prefix_ + name + ":", 0) == 0) heard_[name] = {status, now_s};
}

bool NodeWatch::is_silent(const std::string& name, double now_s) const {
  const auto found = heard_.find(name);
  return found == heard_.end() || now_s - found->second.at_s > silence_s_;
}

std::vector<NodeLine> NodeWatch::lines(double now_s) const {
  std::vector<NodeLine> lines;
  for (const std::string& name : names_) {
    const auto found = heard_.find(name);
    if (found == heard_.end())
      lines.push_back({name, DiagnosticStatus::STALE, "not heard"});
    else if (is_silent(name, now_s))
      lines.push_back({name, DiagnosticStatus::STALE,
                       formatted("silent for %.0f s; it said: ", now_s - found->second.at_s) +
                           text_of(found->second.status)});
    else
      lines.push_back({name, static_cast<std::uint8_t>(found->second.status.level),
                       text_of(found->second.status)});
  }
  return lines;
}

bool NodeWatch::is_registering() const {
  const auto found = heard_.find("registration");
  if (found == heard_.end()) return false;
  for (const diagnostic_msgs::KeyValue& one : found->second.status.values)
    if (one.key == "state") return one.value.rfind("running", 0) == 0;
  return false;
}

}  // namespace usct::ros_interface
