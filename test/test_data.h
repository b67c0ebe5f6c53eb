#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "test_paths.h"

namespace usct::test {

/// Folder of the real data for tests: USCT_TEST_DATA, else ../shared/data beside the project.
inline std::filesystem::path data_root() {
  if (const char* root = std::getenv("USCT_TEST_DATA")) return root;
  return std::filesystem::path(USCT_SOURCE_DIR) / ".." / "shared" / "data";
}

}  // namespace usct::test

/// Skips the test, with the reason, where the named real data is absent.
#define USCT_REQUIRE_DATA(path)                                                       \
  do {                                                                                \
    if (!std::filesystem::exists(path))                                               \
      GTEST_SKIP() << "real data absent: " << (path).string()                         \
                   << " (set USCT_TEST_DATA to the folder that holds the test data)"; \
  } while (false)
