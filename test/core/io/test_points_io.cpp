#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "core/io/bad_files.h"
#include "us_ct_registration/io/results/points_io.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::spit;
using test::TemporaryFolder;

std::vector<Eigen::Vector3d> read_points_from(const std::string& content) {
  const TemporaryFolder folder;
  return read_points_mm(spit(folder.path() / "points.csv", content));
}

TEST(PointsIo, ReadsWhatSpreadsheetsWrite) {
  const std::vector<Eigen::Vector3d> points =
      read_points_from("x,y,z\r\n1, 2.5,-3e2\r\n+4,5,6\r\n\r\n");
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points[0], Eigen::Vector3d(1, 2.5, -300));
  EXPECT_EQ(points[1], Eigen::Vector3d(4, 5, 6));
  // With a byte order mark.
  EXPECT_EQ(read_points_from("\xEF\xBB\xBFx,y,z\r\n1,2,3\r\n").size(), 1U);
}

TEST(PointsIo, NumbersComeBackBitByBit) {
  const std::vector<Eigen::Vector3d> points = {{0.1, 1.0 / 3.0, -1e-300},
                                               {1e300, -0.0, 123456789.123456789}};
  const TemporaryFolder folder;
  write_points_mm(points, folder.path() / "points.csv");
  EXPECT_EQ(read_points_mm(folder.path() / "points.csv"), points);
}

TEST(PointsIo, NamesTheLineThatIsWrong) {
  expect_input_error([] { read_points_from("1,2,3\n4,5,6\n"); }, {"points.csv", "line 1", "x,y,z"});
  expect_input_error([] { read_points_from("x,y,z\n1,2,3\n1,2\n"); }, {"line 3", "2 fields"});
  expect_input_error([] { read_points_from("x,y,z\n1,2,3,4\n"); }, {"line 2", "4 fields"});
  expect_input_error([] { read_points_from("x,y,z\n1,2,nan\n"); }, {"line 2 z", "nan", "finite"});
  expect_input_error([] { read_points_from("x,y,z\n1,,3\n"); }, {"line 2 y"});
  expect_input_error([] { read_points_from("x,y,z\n1,2,3mm\n"); }, {"line 2 z", "3mm"});
  expect_input_error([] { read_points_from("x,y,z\n"); }, {"no points"});
  expect_input_error([] { read_points_from("x,y,z\n1;2;3\n"); }, {"line 2", "1 fields"});
}

TEST(PointsIo, RefusesBrokenFiles) {
  // Each truncation spoils the only point, because its last number has one digit.
  test::expect_refuses_broken_files([](const auto& path) { read_points_mm(path); },
                                    test::to_bytes("x,y,z\n1,2,3"), ".csv");
}

/// A volume that was named in place of a table must not be read into memory.
TEST(PointsIo, AFileThatIsTooLargeForATextIsRefused) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "points.csv";
  std::ofstream(path) << "x,y,z\n";
  std::filesystem::resize_file(path, (std::uintmax_t{64} << 20) + 1);
  expect_input_error([&] { read_points_mm(path); }, {"points.csv", "larger than 64 MiB"});
}

TEST(PointsIo, WhatIsNotAPointIsNotWritten) {
  const TemporaryFolder folder;
  expect_input_error([&] { write_points_mm({}, folder.path() / "p.csv"); }, {"p.csv"});
  expect_input_error(
      [&] {
        write_points_mm({{1, 2, std::nan("")}}, folder.path() / "p.csv");
      },
      {"p.csv", "finite"});
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace usct
