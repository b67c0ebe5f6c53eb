#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace usct::ros_interface {

/// A node as it describes itself, for a line of a display.
struct NodeLine {
  std::string name;
  /// As in DiagnosticStatus.msg; STALE: the node is silent or was never heard.
  std::uint8_t level = 0;
  std::string text;
};

/// Follows what some nodes say of themselves on `/diagnostics`, and whether they still say
/// anything. Times are seconds of a clock that never jumps.
class NodeWatch {
 public:
  /// `prefix`: the namespace of the nodes without leading slash, "" or "robot/". A node that was
  /// silent for longer than `silence_s` counts as stale.
  NodeWatch(std::string prefix, std::vector<std::string> names, double silence_s);

  void take(const diagnostic_msgs::DiagnosticArray& message, double now_s);
  /// In the order of the names.
  std::vector<NodeLine> lines(double now_s) const;
  bool is_silent(const std::string& name, double now_s) const;
  /// Whether the node `registration` says that it registers.
  bool is_registering() const;

 private:
  struct Heard {
    diagnostic_msgs::DiagnosticStatus status;
    double at_s = 0.0;
  };

  std::string prefix_;
  std::vector<std::string> names_;
  double silence_s_;
  std::map<std::string, Heard> heard_;
};

}  // namespace usct::ros_interface
