#include "ros/node/parameters.h"

#include <ros/names.h>

#include <sstream>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

using XmlRpc::XmlRpcValue;

std::string shown(const XmlRpcValue& value) {
  std::ostringstream text;
  XmlRpcValue copy = value;
  copy.write(text);
  return text.str();
}

template <typename T>
void require_within(T value, T least, T most, const std::string& name) {
  if (value >= least && value <= most) return;
  std::ostringstream text;
  text << "is " << value << ", must be in [" << least << ", " << most << "]";
  throw InputError(name, text.str());
}

/// registration.launch keeps a copy of the parameters of its argument `override`.
void require_known_override(const std::string& name, const std::string& node) {
  static const std::set<std::string> kNodes = {"ct_server",    "fusion_view", "registration",
                                               "tf_publisher", "us_cloud",    "us_ingest"};
  const std::string prefix =
      ::ros::names::append(::ros::names::parentNamespace(node), "override") + "/";
  if (name.compare(0, prefix.size(), prefix) != 0) return;
  const std::string first =
      name.substr(prefix.size(), name.find('/', prefix.size()) - prefix.size());
  if (kNodes.count(first) > 0) return;
  std::string all;
  for (const std::string& known : kNodes) all += (all.empty() ? "" : ", ") + known;
  throw InputError("override: '" + first + "'",
                   "is not a node of registration.launch; it has: " + all);
}

}  // namespace

double as_number(const XmlRpcValue& value, const std::string& name) {
  XmlRpcValue copy = value;
  if (copy.getType() == XmlRpcValue::TypeInt) return static_cast<int>(copy);
  if (copy.getType() == XmlRpcValue::TypeDouble) return static_cast<double>(copy);
  throw InputError(name, "is " + shown(value) + ", must be a number");
}

Parameters::Parameters(const ::ros::NodeHandle& private_node) : node_(private_node) {}

std::string Parameters::name(const std::string& key) const { return node_.resolveName(key); }

bool Parameters::find(const std::string& key, XmlRpcValue& value) {
  known_.insert(key);
  return node_.getParam(key, value);
}

std::string Parameters::text(const std::string& key, const std::string& fallback) {
  XmlRpcValue value;
  if (!find(key, value)) return fallback;
  if (value.getType() != XmlRpcValue::TypeString)
    throw InputError(name(key), "is " + shown(value) + ", must be a text");
  return static_cast<std::string>(value);
}

bool Parameters::flag(const std::string& key, bool fallback) {
  XmlRpcValue value;
  if (!find(key, value)) return fallback;
  if (value.getType() != XmlRpcValue::TypeBoolean)
    throw InputError(name(key), "is " + shown(value) + ", must be true or false");
  return static_cast<bool>(value);
}

int Parameters::whole(const std::string& key, int fallback, int least, int most) {
  XmlRpcValue value;
  if (!find(key, value)) return fallback;
  if (value.getType() != XmlRpcValue::TypeInt)
    throw InputError(name(key), "is " + shown(value) + ", must be a whole number");
  require_within(static_cast<int>(value), least, most, name(key));
  return static_cast<int>(value);
}

double Parameters::number(const std::string& key, double fallback, double least, double most) {
  XmlRpcValue value;
  if (!find(key, value)) return fallback;
  const double found = as_number(value, name(key));
  require_within(found, least, most, name(key));
  return found;
}

std::string Parameters::choice(const std::string& key, const std::string& fallback,
                               const std::set<std::string>& choices) {
  const std::string found = text(key, fallback);
  if (choices.count(found) > 0) return found;
  std::string all;
  for (const std::string& choice : choices) all += (all.empty() ? "'" : ", '") + choice + "'";
  throw InputError(name(key), "is '" + found + "', must be one of " + all);
}

std::vector<double> Parameters::numbers(const std::string& key, std::size_t count) {
  XmlRpcValue value;
  if (!find(key, value)) return {};
  if (value.getType() != XmlRpcValue::TypeArray || static_cast<std::size_t>(value.size()) != count)
    throw InputError(name(key), "is " + shown(value) + ", must be a list of " +
                                    std::to_string(count) + " numbers");
  std::vector<double> found;
  for (int i = 0; i < value.size(); ++i)
    found.push_back(as_number(value[i], name(key) + "[" + std::to_string(i) + "]"));
  return found;
}

std::map<std::string, std::map<std::string, XmlRpcValue>> Parameters::groups(
    const std::string& key) {
  known_groups_.insert(key);
  XmlRpcValue value;
  if (!find(key, value)) return {};
  std::map<std::string, std::map<std::string, XmlRpcValue>> found;
  const auto require_map = [this](XmlRpcValue& map, const std::string& path) {
    if (map.getType() != XmlRpcValue::TypeStruct)
      throw InputError(name(path), "is " + shown(map) + ", must be a map");
  };
  require_map(value, key);
  for (auto& [group, members] : value) {
    require_map(members, key + "/" + group);
    for (auto& [member, one] : members) found[group][member] = one;
    found[group];
  }
  return found;
}

std::string Parameters::image_transport() {
  constexpr const char* kRaw = "raw";  // has no plugin with parameters
  const std::string transport = text("image_transport", kRaw);
  if (transport != kRaw) known_groups_.insert(transport);
  return transport;
}

std::string Parameters::frame(const std::string& key, const std::string& fallback) {
  const std::string found = text(key, fallback);
  if (!found.empty() && found.front() == '/')
    throw InputError(name(key), "is '" + found + "', must be a frame without leading /");
  return found;
}

double read_diagnostic_period(Parameters& parameters) {
  constexpr double kLeastS = 0.05;
  constexpr double kMostS = 3600.0;
  return parameters.number("diagnostic_period", 1.0, kLeastS, kMostS);
}

void Parameters::finish() const {
  std::vector<std::string> names;
  node_.getParamNames(names);
  for (const std::string& full : names) require_known_override(full, node_.getNamespace());
  const std::string prefix = node_.getNamespace() + "/";
  for (const std::string& full : names) {
    if (full.compare(0, prefix.size(), prefix) != 0) continue;
    const std::string key = full.substr(prefix.size());
    if (known_.count(key) > 0 || known_groups_.count(key.substr(0, key.find('/'))) > 0) continue;
    std::string all;
    for (const std::string& known : known_) all += (all.empty() ? "" : ", ") + known;
    throw InputError(full, "is not a parameter of this node; it has: " + all);
  }
}

}  // namespace usct::ros_interface
