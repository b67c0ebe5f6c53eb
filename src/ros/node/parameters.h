#pragma once

#include <ros/node_handle.h>

#include <limits>
#include <map>
#include <set>
#include <string>

namespace usct::ros_interface {

/// Reads the private parameters of a node, once, at start. A wrong type, a value out of range and a
/// key that the node does not have are InputErrors that name the key, the value and the constraint:
/// a node with a misspelt parameter must not start with the default in its place.
class Parameters {
 public:
  explicit Parameters(const ::ros::NodeHandle& private_node);

  std::string text(const std::string& key, const std::string& fallback);
  bool flag(const std::string& key, bool fallback);
  int whole(const std::string& key, int fallback, int least,
            int most = std::numeric_limits<int>::max());
  /// A finite number; a whole number is accepted as well.
  double number(const std::string& key, double fallback, double least,
                double most = std::numeric_limits<double>::infinity());
  /// A text that must be one of `choices`.
  std::string choice(const std::string& key, const std::string& fallback,
                     const std::set<std::string>& choices);
  /// A list of exactly `count` numbers; empty if the key is not set.
  std::vector<double> numbers(const std::string& key, std::size_t count);

  /// A map of maps, such as `{tumour: {band: true}}`: the values by the names of both; empty if the
  /// key is not set. Its keys are not checked here.
  std::map<std::string, std::map<std::string, XmlRpc::XmlRpcValue>> groups(const std::string& key);

  /// `image_transport`, the transport of images. Below the node its plugin keeps parameters of its
  /// own, under its name, which remain when the node ends.
  std::string image_transport();

  /// Name of a tf frame, or an empty text. tf2 knows no names with a leading slash.
  std::string frame(const std::string& key, const std::string& fallback);

  /// Throws InputError if the parameter server has a key below the node that was not read.
  void finish() const;

 private:
  bool find(const std::string& key, XmlRpc::XmlRpcValue& value);
  std::string name(const std::string& key) const;

  ::ros::NodeHandle node_;
  std::set<std::string> known_;
  std::set<std::string> known_groups_;
};

/// A number of the parameter `name`, which may be a whole one. Throws InputError.
double as_number(const XmlRpc::XmlRpcValue& value, const std::string& name);

/// The parameter `diagnostic_period`, which diagnostic_updater reads as well, s.
double read_diagnostic_period(Parameters& parameters);

}  // namespace usct::ros_interface
