#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>

#include "core/io/expect_input_error.h"
#include "random_geometry.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/beam_grid.h"

namespace usct {
namespace {

using test::integer;
using test::random_axial;
using test::random_curvilinear;
using test::random_grid;
using test::random_motorised;
using test::random_pose;

void assert_beams_agree(const ScanGeometry& geometry) {
  const BeamGrid beams = beam_grid(geometry);
  RC_ASSERT(beams.samples() == geometry.samples());
  RC_ASSERT(beams.lines == geometry.lines());
  RC_ASSERT(beams.frames == geometry.frames());
  const Eigen::AlignedBox3d box = beams.bounding_box();
  for (int n = 0; n < 20; ++n) {
    const int sample = integer(0, geometry.samples());
    const int line = integer(0, geometry.lines());
    const int frame = integer(0, geometry.frames());
    const Eigen::Vector3d expected = us_from_scan(
        geometry,
        {static_cast<double>(sample), static_cast<double>(line), static_cast<double>(frame)});
    RC_ASSERT((beams.point(frame, line, sample) - expected).norm() < 1e-9);
    RC_ASSERT(box.exteriorDistance(expected) < 1e-9);
    RC_ASSERT(std::abs(beams.beam(frame, line).direction.norm() - 1.0) < 1e-12);
  }
  RC_ASSERT(beams.tracked != geometry.is_motorised());
}

RC_GTEST_PROP(BeamGrid, OfAMotorisedProbeAgreesWithUsFromScan, ()) {
  assert_beams_agree(random_motorised());
}

RC_GTEST_PROP(BeamGrid, OfATrackedProbeAgreesWithUsFromScan, ()) {
  ScanGeometry geometry;
  geometry.axial = random_axial();
  if (*rc::gen::arbitrary<bool>())
    geometry.array = random_curvilinear();
  else
    geometry.array = LinearArray{test::uneven_table(40, -20.0, 20.0)};
  geometry.motion = TrackedSweep{{random_pose(), random_pose(), random_pose()}, {}};
  assert_beams_agree(geometry);
}

/// Samples run along the beam's axis in its sense; lines and frames are the other axes in order.
RC_GTEST_PROP(ParallelBeams, VisitEveryVoxelOfAnObliqueGridAlongAllSixAxes, ()) {
  const Grid grid = random_grid();
  for (const int axis : {0, 1, 2})
    for (const bool positive : {true, false}) {
      const BeamGrid beams = parallel_beam_grid(grid, {axis, positive});
      const int line_axis = axis == 0 ? 1 : 0;
      const int frame_axis = axis == 2 ? 1 : 2;
      RC_ASSERT(beams.samples() == grid.size[axis]);
      RC_ASSERT(beams.lines == grid.size[line_axis]);
      RC_ASSERT(beams.frames == grid.size[frame_axis]);
      for (int frame = 0; frame < beams.frames; ++frame)
        for (int line = 0; line < beams.lines; ++line)
          for (int sample = 0; sample < beams.samples(); ++sample) {
            Eigen::Vector3d index;
            index[axis] = positive ? sample : grid.size[axis] - 1 - sample;
            index[line_axis] = line;
            index[frame_axis] = frame;
            const Eigen::Vector3d expected = grid.physical_from_index(index);
            RC_ASSERT((beams.point(frame, line, sample) - expected).norm() < 1e-9);
          }
    }
}

TEST(ParallelBeams, AxisIsReadFromTextAndNothingElseIsTaken) {
  const BeamAxis down = parse_beam_axis("-y", "--beam-axis");
  EXPECT_EQ(down.axis, 1);
  EXPECT_FALSE(down.positive);
  EXPECT_EQ(parse_beam_axis("+z", "--beam-axis").axis, 2);
  for (const char* text : {"", "y", "+w", "+y ", "++y", "-Y"})
    EXPECT_THROW(parse_beam_axis(text, "--beam-axis"), InputError) << text;
  EXPECT_THROW(parallel_beam_grid(Grid{{2, 2, 2}}, {3, true}), InputError);
}

TEST(BeamGrid, ABeamThatLeadsNowhereIsNamed) {
  BeamGrid good{{3, 0.0, 1.0}, 1, 2, {}};
  good.beams.assign(2, {Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitY()});
  good.validate();
  const auto refuse = [&](const Beam& beam) {
    BeamGrid bad = good;
    bad.beams[1] = beam;
    test::expect_input_error([&] { bad.validate("us"); }, {"us", "beam 1"});
  };
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  refuse({Eigen::Vector3d(0.0, kNaN, 0.0), Eigen::Vector3d::UnitY()});
  refuse({Eigen::Vector3d::Zero(), Eigen::Vector3d(0.0, kNaN, 0.0)});
  refuse({Eigen::Vector3d::Zero(), Eigen::Vector3d(0.0, 1.1, 0.0)});
}

TEST(BeamGrid, NumbersSamplesBeamByBeamAndHasItsMiddleAmongThem) {
  BeamGrid grid{{3, 1.0, 2.0}, 4, 2, {}};
  for (int frame = 0; frame < 2; ++frame)
    for (int line = 0; line < 4; ++line)
      grid.beams.push_back({Eigen::Vector3d(line, 0.0, 5.0 * frame), Eigen::Vector3d::UnitY()});
  std::size_t next = 0;
  for (int frame = 0; frame < 2; ++frame)
    for (int line = 0; line < 4; ++line) {
      EXPECT_EQ(&grid.beam(frame, line), &grid.beams[grid.beam_number(frame, line)]);
      EXPECT_EQ(grid.offset(frame, line), next);
      for (int sample = 0; sample < 3; ++sample)
        EXPECT_EQ(grid.offset(frame, line, sample), next++);
    }
  EXPECT_LT((grid.middle_mm() - Eigen::Vector3d(1.5, 3.0, 2.5)).norm(), 1e-12);
}

TEST(BeamGrid, RefusesInvalidGeometry) { EXPECT_THROW(beam_grid(ScanGeometry{}), InputError); }

}  // namespace
}  // namespace usct
