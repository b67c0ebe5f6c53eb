#include <gtest/gtest.h>

#include <deque>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>

namespace usct::phantom::test {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = USCT_SOURCE_DIR;

/// The files of this project that a file includes.
std::vector<fs::path> included_by(const fs::path& file) {
  static const std::regex kInclude(R"(^\s*#\s*include\s*["<]([^">]+)[">])");
  std::vector<fs::path> found;
  std::ifstream in(file);
  std::string line;
  while (std::getline(in, line)) {
    std::smatch match;
    if (!std::regex_search(line, match, kInclude)) continue;
    for (const fs::path& base : {kRoot / "include", kRoot / "src" / "core", file.parent_path()})
      if (fs::is_regular_file(base / match[1].str())) found.push_back(base / match[1].str());
  }
  return found;
}

/// Files of the core, headers and the sources that go with them, that the phantom is built from.
std::set<fs::path> everything_the_phantom_uses() {
  std::deque<fs::path> open;
  for (const fs::path& folder :
       {kRoot / "src/core/phantom", kRoot / "include/us_ct_registration/phantom"})
    for (const auto& entry : fs::recursive_directory_iterator(folder)) open.push_back(entry.path());
  std::set<fs::path> seen;
  while (!open.empty()) {
    const fs::path file = fs::weakly_canonical(open.front());
    open.pop_front();
    if (!seen.insert(file).second) continue;
    for (const fs::path& next : included_by(file)) open.push_back(next);
    // A header is used through the source that implements it.
    if (file.extension() == ".h") {
      std::string text = fs::relative(file, kRoot).string();
      const std::string prefix = "include/us_ct_registration/";
      if (text.rfind(prefix, 0) == 0) text = "src/core/" + text.substr(prefix.size());
      const fs::path source = kRoot / fs::path(text).replace_extension(".cpp");
      if (fs::is_regular_file(source)) open.push_back(source);
    }
  }
  return seen;
}

/// The phantom judges registration, whose simulation of ultrasound must not have made it.
TEST(Dependencies, PhantomSharesNoCodeWithTheSimulationOfUltrasoundFromCt) {
  const std::set<fs::path> files = everything_the_phantom_uses();
  // The walk works: it reaches other folders, and sources through headers.
  EXPECT_TRUE(files.count(fs::weakly_canonical(kRoot / "src/core/phantom/frame_synthesis.cpp")));
  EXPECT_TRUE(files.count(fs::weakly_canonical(kRoot / "src/core/geometry/scan_geometry.cpp")));
  EXPECT_GT(files.size(), 30U);
  for (const fs::path& file : files)
    for (const fs::path& part : fs::relative(file, kRoot))
      for (const char* forbidden : {"simulation", "similarity", "registration", "optimizer"})
        EXPECT_NE(part.string(), forbidden) << file;
}

}  // namespace
}  // namespace usct::phantom::test
