#include <algorithm>
#include <deque>
#include <set>
#include <string_view>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/ultrasound/igsio.h"

namespace usct {
namespace {

/// A step from one coordinate frame to the next.
struct Link {
  std::string name;  // as in the file
  std::string from;
  std::string to;
  Eigen::Affine3d T_to_from;
  bool valid;
};

struct Ends {
  std::string from;
  std::string to;
};

/// "ProbeToTracker" leads from Probe to Tracker. A name with several "To" before a capital
/// ("ToolToToTable") is split at each of them; a wrong split does no harm, because no other
/// transform knows its coordinate frames.
std::vector<Ends> ends_of(const std::string& name) {
  std::vector<Ends> ends;
  for (std::size_t at = name.find("To", 1); at != std::string::npos; at = name.find("To", at + 1)) {
    const std::string to = name.substr(at + 2);
    const bool starts_a_word = !to.empty() && (to[0] < 'a' || to[0] > 'z');
    if (starts_a_word) ends.push_back({name.substr(0, at), to});
  }
  return ends;
}

/// Adds the links of one transform, in both directions.
void add_links(const std::string& name, const IgsioTransform& transform, std::vector<Link>& links) {
  for (const auto& [from, to] : ends_of(name)) {
    // A singular matrix is a link in one direction only.
    const bool invertible = transform.T.linear().determinant() != 0.0;
    links.push_back({name, from, to, transform.T, transform.valid()});
    if (invertible) links.push_back({name, to, from, transform.T.inverse(), transform.valid()});
  }
}

/// The shortest path of links from one coordinate frame to another; empty if there is none.
/// Every coordinate frame that the search reaches is added to `reached`.
std::vector<const Link*> shortest_path(const std::vector<Link>& links, const std::string& from,
                                       const std::string& to, bool only_valid,
                                       std::set<std::string>& reached) {
  std::map<std::string, const Link*> arrived_by;
  std::deque<std::string> queue = {from};
  reached.insert(from);
  while (!queue.empty() && reached.count(to) == 0) {
    const std::string here = queue.front();
    queue.pop_front();
    for (const Link& link : links)
      if (link.from == here && (link.valid || !only_valid) && reached.insert(link.to).second) {
        arrived_by[link.to] = &link;
        queue.push_back(link.to);
      }
  }
  std::vector<const Link*> path;
  if (reached.count(to) != 0)
    for (std::string here = to; here != from; here = arrived_by.at(here)->from)
      path.insert(path.begin(), arrived_by.at(here));
  return path;
}

[[noreturn]] void fail(const std::vector<Link>& links, const IgsioTransforms& transforms,
                       const std::string& from, const std::string& to, const std::string& source,
                       const std::set<std::string>& reached_by_valid) {
  const std::string wanted = "transform from '" + from + "' to '" + to + "': ";
  std::set<std::string> reached;
  std::string invalid;
  for (const Link* link : shortest_path(links, from, to, false, reached))
    if (!link->valid) {
      const std::string& status = transforms.at(link->name).status;
      invalid += (invalid.empty() ? "" : ", ") + link->name + " is " +
                 (status.empty() ? "without status" : status);
    }
  if (!invalid.empty()) throw InputError(source, wanted + invalid);
  std::string known;
  for (const std::string& name : reached_by_valid)
    if (name != from) known += (known.empty() ? "" : ", ") + name;
  throw InputError(source, wanted + "no chain of transforms; '" + from + "' connects to " +
                               (known.empty() ? "nothing" : known));
}

std::vector<Link> links_of(const IgsioTransforms& transforms) {
  std::vector<Link> links;
  for (const auto& [name, transform] : transforms) add_links(name, transform, links);
  return links;
}

}  // namespace

bool is_connected(const IgsioTransforms& transforms, const std::string& from,
                  const std::string& to) {
  std::set<std::string> reached;
  shortest_path(links_of(transforms), from, to, true, reached);
  return reached.count(to) != 0;
}

bool takes_place_of(const IgsioTransforms& calibration, const std::string& name) {
  const std::vector<Ends> ends = ends_of(name);
  return std::any_of(ends.begin(), ends.end(),
                     [&](const Ends& of) { return is_connected(calibration, of.from, of.to); });
}

Eigen::Affine3d transform_chain(const IgsioFrame& frame, const IgsioTransforms& calibration,
                                const std::string& from, const std::string& to,
                                const std::string& source) {
  IgsioTransforms transforms = calibration;
  for (const auto& named : frame.transforms)
    if (!takes_place_of(calibration, named.first)) transforms.insert(named);
  const std::vector<Link> links = links_of(transforms);
  std::set<std::string> reached;
  const std::vector<const Link*> path = shortest_path(links, from, to, true, reached);
  if (path.empty() && from != to) fail(links, transforms, from, to, source, reached);
  Eigen::Affine3d T = Eigen::Affine3d::Identity();
  for (const Link* link : path) T = link->T_to_from * T;
  return T;
}

}  // namespace usct
