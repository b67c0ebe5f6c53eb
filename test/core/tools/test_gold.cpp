#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "core/baselines/surfaces.h"
#include "core/tools/run_usct.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::test {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

class Gold : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  std::string points(const std::string& name, const Points& points_mm) const {
    write_points_mm(points_mm, path(name));
    return path(name);
  }

  TemporaryFolder folder_;
};

/// A quarter turn about z and a shift, with one fiducial 3 mm off.
TEST_F(Gold, FiducialsGiveATransformAndItsErrors) {
  const std::string us =
      points("us.csv", {{100, 0, 10}, {100, 40, 10}, {70, 0, 10}, {70, 40, 13}, {85, 20, 60}});
  const std::string ct =
      points("ct.csv", {{0, 0, 0}, {40, 0, 0}, {0, 30, 0}, {40, 30, 0}, {20, 15, 50}});
  const Outcome outcome =
      run_usct({"gold", "fiducials", us, ct, "--targets", us, "--output", path("gold.tfm")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_NE(outcome.output.find("from 5 fiducials"), std::string::npos) << outcome.output;
  EXPECT_NE(outcome.output.find("predicted TRE at 5 targets"), std::string::npos);
  const Vector3d moved = read_T_us_ct(path("gold.tfm")) * Vector3d(40, 30, 0);
  EXPECT_LT((moved - Vector3d(70, 40, 13)).norm(), 2.0);
  EXPECT_GT((moved - Vector3d(70, 40, 13)).norm(), 0.5);
}

TEST_F(Gold, FiducialsWithoutOrderAreMatched) {
  const std::string ct = points("ct.csv", {{0, 0, 0}, {40, 0, 0}, {0, 30, 0}, {20, 15, 50}});
  const std::string us =
      points("us.csv", {{30, 25, 51}, {0, 0, 400}, {50, 10, 1}, {10, 40, 1}, {10, 10, 1}});
  const Outcome outcome = run_usct(
      {"gold", "fiducials", us, ct, "--match", "--fle", "0.5", "--output", path("gold.tfm")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_EQ(outcome.errors, "");
  // The second point of the ultrasound has no partner.
  EXPECT_NE(outcome.output.find("                  5 |           1 |"), std::string::npos)
      << outcome.output;
  EXPECT_EQ(outcome.output.find("                  2 |"), std::string::npos) << outcome.output;
  EXPECT_LT((read_T_us_ct(path("gold.tfm")) * Vector3d(1, 2, 3) - Vector3d(11, 12, 4)).norm(),
            1e-9);

  const std::string square = points("square.csv", {{0, 0, 0}, {40, 0, 0}, {40, 40, 0}, {0, 40, 0}});
  const Outcome turned = run_usct({"gold", "fiducials", square, square, "--match"});
  EXPECT_NE(turned.errors.find("8 pairings fit"), std::string::npos) << turned.errors;
}

TEST_F(Gold, SurfacesOfABoxAreAmbiguousAndThatIsSaid) {
  Points box;
  for (int i = -10; i <= 10; ++i)
    for (int j = -5; j <= 5; ++j)
      for (const int k : {-3, 3}) box.emplace_back(4.0 * i, 4.0 * j, 4.0 * k);
  const std::string file = points("box.csv", box);
  const Outcome outcome = run_usct({"gold", "surfaces", file, file, "--output", path("gold.tfm")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_NE(outcome.errors.find("which way round the kidney is"), std::string::npos);
  EXPECT_NE(outcome.output.find("180 degrees"), std::string::npos) << outcome.output;
}

TEST_F(Gold, IcpAlignsAPartOfASurface) {
  const Points ct = bumpy_ellipsoid(1500);
  const Vector3d shift(20, -10, 80);
  Points part;
  for (const Vector3d& p : ct)
    if (p.x() < 30.0) part.push_back(p + shift);
  const std::string file = points("ct.csv", ct);
  const Outcome outcome =
      run_usct({"gold", "icp", points("us.csv", part), file, "--output", path("gold.tfm")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_EQ(outcome.errors, "");
  EXPECT_NE(outcome.output.find("predicted error"), std::string::npos) << outcome.output;
  EXPECT_LT((read_T_us_ct(path("gold.tfm")) * ct[0] - ct[0] - shift).norm(), 0.05);

  const std::string ball = points("ball.csv", ellipsoid({30, 30, 30}, 800));
  const Outcome round = run_usct(
      {"gold", "icp", ball, ball, "--initial", path("gold.tfm"), "--largest-distance", "200"});
  EXPECT_NE(round.errors.find("leave a motion undetermined"), std::string::npos) << round.errors;
  const Outcome far = run_usct({"gold", "icp", file, file, "--initial", path("gold.tfm")});
  EXPECT_EQ(far.exit_status, 2);
  EXPECT_NE(far.errors.find("do not overlap"), std::string::npos) << far.errors;
}

/// Of half a kidney another axis is the longest.
TEST_F(Gold, IcpFindsAPartWhoseAxesHaveAnotherOrder) {
  const Points ct = bumpy_ellipsoid(1500);
  const Vector3d shift(20, -10, 80);
  Points part;
  for (const Vector3d& p : ct)
    if (p.x() < 0.0) part.push_back(p + shift);
  const Outcome outcome = run_usct(
      {"gold", "icp", points("us.csv", part), points("ct.csv", ct), "--output", path("gold.tfm")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_LT((read_T_us_ct(path("gold.tfm")) * ct[0] - ct[0] - shift).norm(), 0.1);
}

/// Trimmed, the wrong way round leaves out the pairs that speak against it.
TEST_F(Gold, IcpWithTrimmedPairsFindsTheRightWayRound) {
  const Points ct = bumpy_ellipsoid(1500);
  const Vector3d shift(20, -10, 80);
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  Points part;
  for (const Vector3d& p : bumpy_ellipsoid(900))
    if (p.x() < 15.0)
      part.push_back(p + shift + Vector3d(normal(random), normal(random), normal(random)));
  for (const char* overlap : {"1", "0.9", "0.8"}) {
    const Outcome outcome = run_usct({"gold", "icp", points("us.csv", part), points("ct.csv", ct),
                                      "--overlap", overlap, "--output", path("gold.tfm")});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
    EXPECT_LT((read_T_us_ct(path("gold.tfm")) * ct[0] - ct[0] - shift).norm(), 2.0)
        << overlap << "\n"
        << outcome.output;
  }
}

/// Balls of 2 mm whose centres are centres of voxels, where their voxels are symmetric.
TEST_F(Gold, BallsOfACtAreWrittenAsPoints) {
  Grid grid;
  grid.size = {50, 60, 40};
  grid.spacing_mm = Vector3d(0.5, 0.5, 0.5);
  grid.origin_mm = Vector3d(-7, 3, 90);
  CtVolume ct(grid, 20);
  const std::vector<Eigen::Vector3i> balls{{12, 13, 10}, {40, 15, 12}, {14, 45, 30}};
  for (const Eigen::Vector3i& ball : balls)
    for (int k = -2; k <= 2; ++k)
      for (int j = -2; j <= 2; ++j)
        for (int i = -2; i <= 2; ++i)
          if (i * i + j * j + k * k <= 4) ct.at(ball.x() + i, ball.y() + j, ball.z() + k) = 3000;
  write_volume(ct, path("ct.nrrd"));
  const Outcome outcome = run_usct({"gold", "balls", path("ct.nrrd"), "--diameter", "2", "--count",
                                    "3", "--output", path("balls.csv")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  const Points found = read_points_mm(path("balls.csv"));
  ASSERT_EQ(found.size(), 3U);
  for (const Vector3d& centre : found) {
    const Vector3d index = grid.index_from_physical(centre);
    double least = 1e9;
    for (const Eigen::Vector3i& ball : balls)
      least = std::min(least, (index - ball.cast<double>()).norm());
    EXPECT_LT(least, 0.01);
  }
  const Outcome four =
      run_usct({"gold", "balls", path("ct.nrrd"), "--diameter", "2", "--count", "4"});
  EXPECT_EQ(four.exit_status, 2);
  EXPECT_NE(four.errors.find("--count: is 4, but 3 balls were found"), std::string::npos)
      << four.errors;
  const Outcome both = run_usct({"gold", "balls", path("ct.nrrd"), "--us", path("ct.nrrd")});
  EXPECT_EQ(both.exit_status, 2);
  EXPECT_NE(both.errors.find("not both"), std::string::npos) << both.errors;
}

TEST_F(Gold, BallsRefuseTheOptionsOfTheOtherImage) {
  const auto refused = [](std::vector<std::string> arguments, const std::string& named) {
    arguments.insert(arguments.begin(), {"gold", "balls"});
    const Outcome outcome = run_usct(arguments);
    EXPECT_EQ(outcome.exit_status, 2);
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
  };
  refused({"ct.nrrd", "--echo-radius", "5"}, "--echo-radius requires --us");
  refused({"ct.nrrd", "--least-contrast", "5"}, "--least-contrast requires --us");
  refused({"ct.nrrd", "--probe", "absent.yaml"}, "--probe requires --us");
  refused({"--us", "us.nrrd", "--least-hu", "1000"}, "--least-hu requires CT");
  refused({"--us", "us.nrrd", "--series", "1"}, "--series requires CT");
}

TEST_F(Gold, BadInputIsRefusedAndNothingWritten) {
  const std::string three = points("three.csv", {{0, 0, 0}, {40, 0, 0}, {0, 30, 0}});
  const std::string two = points("two.csv", {{0, 0, 0}, {40, 0, 0}});
  const Outcome outcome = run_usct({"gold", "fiducials", three, two, "--output", path("no.tfm")});
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_NE(outcome.errors.find(three + ": has 3 points, must have as many as " + two + ", 2"),
            std::string::npos)
      << outcome.errors;
  const auto named = [](const std::vector<std::string>& arguments, const std::string& text) {
    const Outcome refused = run_usct(arguments);
    EXPECT_EQ(refused.exit_status, 2);
    EXPECT_NE(refused.errors.find(text), std::string::npos) << refused.errors;
  };
  named({"gold", "fiducials", two, three, "--match"}, two + ", " + three + ": 2 points");
  const std::string surface = points("surface.csv", bumpy_ellipsoid(100));
  named({"gold", "surfaces", surface, three}, three + ": 3 points, must be at least 10");
  named({"gold", "icp", three, surface}, three + ": 3 points, must be at least 10");
  write_volume(CtVolume(Grid{{20, 20, 20}, {0.5, 0.5, 0.5}}, 20), path("ct.nrrd"));
  named({"gold", "balls", path("ct.nrrd")}, path("ct.nrrd") + ": no ball of 1 mm was found");
  EXPECT_EQ(run_usct({"gold"}).exit_status, 2);
  EXPECT_FALSE(std::filesystem::exists(path("no.tfm")));
}

/// Before the work, and before a table is printed that suggests success.
TEST_F(Gold, AnOutputThatCannotBeWrittenIsRefusedFirst) {
  const std::string us = points("us.csv", {{0, 0, 0}, {40, 0, 0}, {0, 30, 0}, {20, 15, 50}});
  std::ofstream(path("labels.nrrd")) << "precious";
  const auto refused = [&](std::vector<std::string> arguments, const std::string& output,
                           const std::string& named) {
    arguments.insert(arguments.begin(), "gold");
    arguments.insert(arguments.end(), {"--output", path(output)});
    const Outcome outcome = run_usct(arguments);
    EXPECT_EQ(outcome.exit_status, 2);
    EXPECT_EQ(outcome.output, "") << arguments[1];
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
    EXPECT_EQ(outcome.errors.find("warning"), std::string::npos) << outcome.errors;
  };
  for (const char* standard : {"fiducials", "surfaces", "icp"}) {
    refused({standard, us, us}, "labels.nrrd", "must end in .tfm, .txt, .h5 or .hdf5");
    refused({standard, us, us}, "absent/gold.tfm", "--output: is '");
  }
  refused({"balls", "absent.nrrd"}, "labels.nrrd", "must end in .csv");
  EXPECT_EQ(read_text(path("labels.nrrd")), "precious");
}

TEST_F(Gold, TheOrderOfTheFilesIsSaid) {
  for (const char* standard : {"fiducials", "surfaces", "icp"}) {
    const std::string help = run_usct({"gold", standard, "--help"}).output;
    EXPECT_NE(help.find("the first file"), std::string::npos) << help;
    EXPECT_NE(help.find("the second file"), std::string::npos) << help;
  }
}

}  // namespace
}  // namespace usct::test
