#include <gtest/gtest.h>

#include <cmath>

#include "core/io/bad_files.h"
#include "us_ct_registration/io/ultrasound/wire_distances.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::spit;
using test::TemporaryFolder;

WireDistances read_wires(const std::string& content, std::optional<int> frames = {}) {
  const TemporaryFolder folder;
  return read_wire_distances(spit(folder.path() / "wires.csv", content), 25.0, frames);
}

TEST(WireDistances, PairsOfAFrameAreAveragedAndFramesWithoutAreUnknown) {
  const WireDistances distances = read_wires(
      "volume,frame,distance_mm\r\n"
      "7,0,26\n2,2,25.5\n7,0,27\n\n2,0,30\n");
  EXPECT_EQ(distances.true_distance_mm, 25.0);
  ASSERT_EQ(distances.volumes.size(), 2U);  // in the order of their numbers
  ASSERT_EQ(distances.volumes[0].size(), 3U);
  EXPECT_EQ(distances.volumes[0][0], 30.0);
  EXPECT_TRUE(std::isnan(distances.volumes[0][1]));
  EXPECT_EQ(distances.volumes[0][2], 25.5);
  EXPECT_EQ(distances.volumes[1][0], 26.5);
  EXPECT_TRUE(std::isnan(distances.volumes[1][2]));
}

TEST(WireDistances, TheSweepMayHaveMoreFramesThanShowWires) {
  EXPECT_EQ(read_wires("volume,frame,distance_mm\n0,4,26\n", 9).volumes[0].size(), 9U);
  expect_input_error([] { read_wires("volume,frame,distance_mm\n0,9,26\n", 9); },
                     {"line 2 frame is 9", "< 9"});
}

TEST(WireDistances, NamesTheLineThatIsWrong) {
  expect_input_error([] { read_wires("frame,volume,distance_mm\n0,0,1\n"); },
                     {"wires.csv", "line 1", "volume,frame,distance_mm"});
  const std::string header = "volume,frame,distance_mm\n";
  expect_input_error([&] { read_wires(header); }, {"no distances"});
  expect_input_error([&] { read_wires(header + "0,0,1\n0,1\n"); }, {"line 3 has 2 fields"});
  expect_input_error([&] { read_wires(header + "0,-1,1\n"); }, {"line 2 frame is -1"});
  expect_input_error([&] { read_wires(header + "-1,0,1\n"); }, {"line 2 volume is -1"});
  expect_input_error([&] { read_wires(header + "0,0.5,1\n"); }, {"line 2 frame"});
  expect_input_error([&] { read_wires(header + "0,2000000000,1\n"); }, {"line 2 frame", "100000"});
  expect_input_error([&] { read_wires(header + "0,1,nan\n"); }, {"line 2 distance_mm", "finite"});
}

TEST(WireDistances, RefusesBrokenFiles) {
  test::expect_refuses_broken_files([](const auto& path) { read_wire_distances(path, 25.0); },
                                    test::to_bytes("volume,frame,distance_mm\n0,0,1"), ".csv");
}

}  // namespace
}  // namespace usct
