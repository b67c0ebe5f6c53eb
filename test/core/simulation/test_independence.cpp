#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace usct::test {
namespace {

/// Files of `folder` that include something of `other`.
std::string includes_between(const std::string& folder, const std::string& other) {
  std::string found;
  int files = 0;
  for (const char* root : {"include/us_ct_registration", "src/core"})
    for (const auto& entry : std::filesystem::recursive_directory_iterator(
             std::filesystem::path(USCT_SOURCE_DIR) / root / folder)) {
      std::ifstream file(entry.path());
      ++files;
      for (std::string line; std::getline(file, line);)
        if (line.rfind("#include", 0) == 0 && line.find(other + "/") != std::string::npos)
          found += entry.path().string() + ": " + line + '\n';
    }
  EXPECT_GT(files, 0);
  return found;
}

// The phantom judges a registration that simulates ultrasound: with shared code both would err
// alike.
TEST(Independence, SimulationAndPhantomKnowNothingOfEachOther) {
  EXPECT_EQ(includes_between("simulation", "phantom"), "");
  EXPECT_EQ(includes_between("phantom", "simulation"), "");
  EXPECT_NE(includes_between("phantom", "geometry"), "");  // the search finds what is there
}

}  // namespace
}  // namespace usct::test
