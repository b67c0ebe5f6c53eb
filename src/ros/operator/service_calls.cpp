#include "ros/operator/service_calls.h"

#include <exception>

namespace usct::ros_interface {

std::string ServiceCalls::problem_of(const std::string& name, const std::function<bool()>& call) {
  try {
    if (!::ros::service::exists(name, false))
      return "nobody offers the service '" + name + "': its node is not running";
    if (!call()) return "'" + name + "' gave no answer: its node has ended, or has other messages";
    return "";
  } catch (const std::exception& error) {
    return "'" + name + "' cannot be called: " + error.what();
  }
}

void ServiceCalls::poll() {
  // A function that gets an answer may start the next call.
  std::vector<std::function<bool()>> running;
  running.swap(running_);
  for (std::function<bool()>& has_ended : running)
    if (!has_ended()) running_.push_back(std::move(has_ended));
}

}  // namespace usct::ros_interface
