#include <gtest/gtest.h>

#include <deque>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "test_paths.h"

namespace usct::test {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = fs::weakly_canonical(USCT_SOURCE_DIR);
const fs::path kHeaders = kRoot / "include" / "us_ct_registration";
const fs::path kCore = kRoot / "src" / "core";

/// The layers that the files of each layer may include besides those of their own. `base` are the
/// files that lie in no folder of the core: errors, progress, loops, checks, text.
const std::map<std::string, std::set<std::string>>& allowed() {
  static const std::map<std::string, std::set<std::string>> layers = [] {
    std::map<std::string, std::set<std::string>> result;
    std::set<std::string> below;
    // Each entry may include all entries before it; layers of one entry do not include each other.
    for (const std::set<std::string>& beside :
         std::vector<std::set<std::string>>{{"base"},
                                            {"geometry"},
                                            {"volume"},
                                            {"ultrasound"},
                                            {"simulation"},
                                            {"similarity", "optimizer", "alignment"},
                                            {"registration"},
                                            {"io"},
                                            {"baselines", "phantom", "rendering"},
                                            {"evaluation"},
                                            {"tools", "ros"},
                                            {"rviz"}}) {
      for (const std::string& layer : beside) result[layer] = below;
      below.insert(beside.begin(), beside.end());
    }
    result["optimizer"] = {"base"};
    result["alignment"] = {"base", "geometry"};
    // The phantom judges a registration that simulates ultrasound; with shared code both could have
    // the same error.
    for (const char* judged : {"simulation", "similarity", "optimizer", "registration"})
      result["phantom"].erase(judged);
    // The bag command of the tools is a program of its own that reads bags with the ROS layer.
    result["tools/ros"] = result["tools"];
    result["tools/ros"].insert({"tools", "ros"});
    result["rviz"].erase("tools");
    return result;
  }();
  return layers;
}

/// The layer of a file of the project; empty if it belongs to none.
std::string layer_of(const fs::path& file) {
  const auto below = [&](const fs::path& folder) {
    const std::string path = file.lexically_relative(folder).generic_string();
    return path.rfind("..", 0) == 0 ? std::string() : path;
  };
  if (!below(kRoot / "src" / "tools" / "ros").empty()) return "tools/ros";
  if (!below(kRoot / "src" / "tools").empty()) return "tools";
  if (!below(kRoot / "src" / "rviz").empty()) return "rviz";
  for (const char* folder : {"ros", "nodes", "nodelets"})
    if (!below(kRoot / "src" / folder).empty()) return "ros";
  for (const fs::path& folder : {kHeaders, kCore})
    if (const std::string path = below(folder); !path.empty()) {
      const std::size_t slash = path.find('/');
      return slash == std::string::npos ? "base" : path.substr(0, slash);
    }
  return {};
}

std::vector<fs::path> files_below(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.path().extension() == ".h" || entry.path().extension() == ".cpp")
      files.push_back(entry.path());
  return files;
}

/// The names between the quotes or angle brackets of a file's include directives.
std::vector<std::string> names_included_by(const fs::path& file) {
  static const std::regex kInclude(R"(^\s*#\s*include\s*["<]([^">]+)[">])");
  std::vector<std::string> names;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (line.find("include") == std::string::npos) continue;
    std::smatch match;
    if (std::regex_search(line, match, kInclude)) names.push_back(match[1].str());
  }
  return names;
}

/// The files of this project that a file includes.
std::vector<fs::path> included_by(const fs::path& file) {
  std::vector<fs::path> found;
  for (const std::string& name : names_included_by(file))
    for (const fs::path& base :
         {kRoot / "include", kCore, kRoot / "src", kRoot / "src" / "tools", file.parent_path()})
      if (fs::is_regular_file(base / name)) {
        found.push_back(fs::weakly_canonical(base / name));
        break;
      }
  return found;
}

/// "FILE includes FILE" for each include that the layers forbid.
std::vector<std::string> forbidden_includes(const std::vector<fs::path>& files) {
  std::vector<std::string> found;
  for (const fs::path& file : files) {
    const std::string layer = layer_of(file);
    for (const fs::path& included : included_by(file)) {
      const std::string other = layer_of(included);
      if (other == layer || allowed().at(layer).count(other) != 0) continue;
      found.push_back(file.lexically_relative(kRoot).string() + " includes " +
                      included.lexically_relative(kRoot).string());
    }
  }
  return found;
}

std::vector<fs::path> all_files() {
  std::vector<fs::path> files = files_below(kHeaders);
  for (const fs::path& file : files_below(kRoot / "src")) files.push_back(file);
  return files;
}

TEST(Layers, EachIncludesOnlyItselfAndThoseBelow) {
  for (const std::string& found : forbidden_includes(all_files())) ADD_FAILURE() << found;
}

TEST(Layers, EveryFileBelongsToAKnownLayer) {
  std::map<std::string, int> files;
  for (const fs::path& file : all_files()) {
    ASSERT_EQ(allowed().count(layer_of(file)), 1U) << file << " lies in '" << layer_of(file) << "'";
    ++files[layer_of(file)];
  }
  for (const auto& [layer, below] : allowed())
    EXPECT_GT(files[layer], layer == "tools/ros" ? 0 : 1) << layer;
}

/// The test finds includes of each kind that is in use, and would report a forbidden one.
TEST(Layers, IncludesAreFound) {
  const auto layers_included_by = [](const fs::path& file) {
    std::set<std::string> layers;
    for (const fs::path& included : included_by(file)) layers.insert(layer_of(included));
    return layers;
  };
  EXPECT_EQ(layers_included_by(kHeaders / "ultrasound" / "prescan_volume.h").count("geometry"), 1U);
  EXPECT_EQ(layers_included_by(kCore / "ultrasound" / "gaussian_sums.cpp"),
            (std::set<std::string>{"base", "ultrasound", "volume"}));
  EXPECT_EQ(layers_included_by(kRoot / "src" / "tools" / "phantom.cpp"),
            (std::set<std::string>{"base", "io", "phantom", "tools"}));
  EXPECT_EQ(layers_included_by(kRoot / "src" / "tools" / "ros" / "bag.cpp").count("ros"), 1U);

  EXPECT_EQ(allowed().at("similarity").count("optimizer"), 0U);
  EXPECT_EQ(allowed().at("optimizer"), (std::set<std::string>{"base"}));
  EXPECT_EQ(allowed().at("geometry"), (std::set<std::string>{"base"}));
  EXPECT_EQ(allowed().at("registration").count("optimizer"), 1U);
  EXPECT_EQ(allowed().at("rendering").count("phantom"), 0U);
  EXPECT_EQ(allowed().at("baselines").count("evaluation"), 0U);
  EXPECT_EQ(allowed().at("ros").count("tools"), 0U);
}

/// Includes between two folders of the core, in either direction.
int includes_between(const std::string& folder, const std::string& other) {
  int found = 0;
  for (const fs::path& file : all_files())
    for (const fs::path& included : included_by(file))
      found += layer_of(file) == folder && layer_of(included) == other ? 1 : 0;
  return found;
}

TEST(Layers, SimulationAndPhantomKnowNothingOfEachOther) {
  EXPECT_EQ(includes_between("simulation", "phantom"), 0);
  EXPECT_EQ(includes_between("phantom", "simulation"), 0);
  EXPECT_GT(includes_between("phantom", "geometry"), 0);  // the search finds existing includes
  EXPECT_GT(includes_between("simulation", "geometry"), 0);
}

/// All files that the phantom is built from: those that its files include, and the source of each
/// of these headers.
std::set<fs::path> everything_the_phantom_uses() {
  std::deque<fs::path> open;
  for (const fs::path& folder : {kCore / "phantom", kHeaders / "phantom"})
    for (const fs::path& file : files_below(folder)) open.push_back(file);
  std::set<fs::path> seen;
  while (!open.empty()) {
    const fs::path file = open.front();
    open.pop_front();
    if (!seen.insert(file).second) continue;
    for (const fs::path& next : included_by(file)) open.push_back(next);
    if (file.extension() != ".h") continue;
    const bool is_public = file.lexically_relative(kHeaders).begin()->string() != "..";
    fs::path source = kCore / file.lexically_relative(is_public ? kHeaders : kCore);
    if (fs::is_regular_file(source.replace_extension(".cpp"))) open.push_back(source);
  }
  return seen;
}

/// The layers alone would allow the phantom to reach the simulation through a file that it
/// includes.
TEST(Layers, PhantomSharesNoCodeWithTheSimulationOfUltrasoundFromCt) {
  const std::set<fs::path> files = everything_the_phantom_uses();
  // The search works: it reaches other folders, and sources through headers.
  EXPECT_EQ(files.count(kCore / "phantom" / "frame_synthesis.cpp"), 1U);
  EXPECT_EQ(files.count(kCore / "geometry" / "scan_geometry.cpp"), 1U);
  EXPECT_GT(files.size(), 30U);
  for (const fs::path& file : files)
    for (const fs::path& part : file.lexically_relative(kRoot))
      for (const char* forbidden : {"simulation", "similarity", "registration", "optimizer"})
        EXPECT_NE(part.string(), forbidden) << file;
}

/// The name of the folder directly below `parent` in which a file lies; empty if it is in none.
std::string folder_below(const fs::path& parent, const fs::path& file) {
  const std::string path = file.lexically_relative(parent).generic_string();
  const std::size_t slash = path.find('/');
  return path.rfind("..", 0) == 0 || slash == std::string::npos ? "" : path.substr(0, slash);
}

/// Expects that the folders below `parent` are those of `order`, and that each includes only itself
/// and those of earlier entries. Files that lie in none of them are not looked at.
void expect_order(const fs::path& parent, const std::vector<std::set<std::string>>& order) {
  std::map<std::string, std::size_t> rank;
  for (std::size_t i = 0; i < order.size(); ++i)
    for (const std::string& folder : order[i]) rank[folder] = i;
  std::set<std::string> seen;
  int downwards = 0;
  for (const fs::path& file : files_below(parent)) {
    const std::string from = folder_below(parent, file);
    if (from.empty()) continue;
    ASSERT_EQ(rank.count(from), 1U) << file;
    seen.insert(from);
    for (const fs::path& included : included_by(file)) {
      const std::string to = folder_below(parent, included);
      if (to.empty() || to == from) continue;
      EXPECT_LT(rank.at(to), rank.at(from)) << file << " includes " << included;
      ++downwards;
    }
  }
  EXPECT_EQ(seen.size(), rank.size());
  EXPECT_GE(downwards, static_cast<int>(rank.size()) - 1);  // the search finds existing includes
}

TEST(Layers, FoldersOfTheRegistrationFollowItsSteps) {
  expect_order(kCore / "registration", {{"images"}, {"search"}, {"evidence"}, {"attempts"}});
}

TEST(Layers, FoldersOfTheRosInterfaceKnowNoNodeAboveThem) {
  expect_order(kRoot / "src" / "ros", {{"node"},
                                       {"conversions"},
                                       {"tf"},
                                       {"alignment", "bags", "ct", "ingest", "registration"},
                                       {"fusion", "operator", "overlay"},
                                       {"crtk", "slicer"}});
}

TEST(Layers, TheCoreIncludesNoRosHeader) {
  const std::regex ros(
      R"(^(ros|rosbag|roscpp|tf2\w*|nodelet|actionlib|pluginlib|topic_tools|diagnostic_updater|image_transport|\w+_msgs)/.*)");
  EXPECT_TRUE(std::regex_match("sensor_msgs/Image.h", ros));
  int included = 0;
  int includes_of_ros = 0;
  for (const fs::path& file : all_files())
    for (const std::string& name : names_included_by(file)) {
      ++included;
      if (!std::regex_match(name, ros)) continue;
      const std::string layer = layer_of(file);
      EXPECT_TRUE(layer == "ros" || layer == "tools/ros" || layer == "rviz")
          << file << " includes " << name;
      ++includes_of_ros;
    }
  EXPECT_GT(included, 1000);
  EXPECT_GT(includes_of_ros, 20);
}

}  // namespace
}  // namespace usct::test
