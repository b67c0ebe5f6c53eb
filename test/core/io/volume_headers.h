#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/itk_oracle.h"
#include "core/io/replaced.h"
#include "us_ct_registration/geometry/grid.h"
#include "us_ct_registration/io/volumes/volume_io.h"

/// Helpers for tests of volume headers that are written by hand.
namespace usct::test {

inline void expect_near_grid(const Grid& grid, const Grid& expected, double tolerance) {
  EXPECT_EQ(grid.size, expected.size);
  // The grids are compared at the corners of the volume, where every difference shows.
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d index = Eigen::Vector3d(corner & 1, (corner >> 1) & 1, corner >> 2)
                                      .cwiseProduct(expected.size.cast<double>());
    EXPECT_LT((grid.physical_from_index(index) - expected.physical_from_index(index)).norm(),
              tolerance);
  }
}

inline Grid grid_of(const test::ItkImage& image) {
  Grid grid;
  grid.size = Eigen::Map<const Eigen::Vector3i>(image.size.data());
  grid.spacing_mm = Eigen::Map<const Eigen::Vector3d>(image.spacing.data());
  grid.origin_mm = Eigen::Map<const Eigen::Vector3d>(image.origin.data());
  grid.direction = Eigen::Map<const Eigen::Matrix3d>(image.direction.data());
  return grid;
}

/// One change to a good header, and the text that the message must contain.
struct BadHeader {
  std::string from, to;
  std::vector<std::string> named;
};

inline void expect_refused(const std::filesystem::path& path, const std::string& header,
                           const std::string& voxels, const std::vector<BadHeader>& cases) {
  write_text(path, header + voxels);
  EXPECT_NO_THROW(read_volume<std::int16_t>(path));
  for (const BadHeader& bad : cases) {
    SCOPED_TRACE(bad.from + " -> " + bad.to);
    write_text(path, replaced(header, bad.from, bad.to) + voxels);
    std::vector<std::string> named = bad.named;
    named.push_back(path.string());
    expect_input_error([&] { read_volume<std::int16_t>(path); }, named);
  }
}

/// Six voxels as big-endian int16, and their values.
inline const std::string kBigEndianVoxels("\x00\x01\xFF\xFE\x00\x03\x00\x04\x00\x05\x01\x00", 12);
inline const std::vector<std::int16_t> kVoxels{1, -2, 3, 4, 5, 256};

}  // namespace usct::test
