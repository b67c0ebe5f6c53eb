#include <gtest/gtest.h>

#include "core/tools/run_usct.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::test {
namespace {

/// Two cubes of labels 1 and 2, the CT of which has 300 HU in the first.
class Surfaces : public testing::Test {
 protected:
  void SetUp() override {
    Grid grid;
    grid.size = {40, 30, 20};
    LabelVolume labels(grid, 0);
    CtVolume ct(grid, -1000);
    for (int k = 5; k < 15; ++k)
      for (int j = 5; j < 15; ++j)
        for (int i = 5; i < 15; ++i) {
          labels.at(i, j, k) = 1;
          labels.at(i + 20, j, k) = 2;
          ct.at(i, j, k) = 300;
        }
    write_volume(labels, path("labels.nrrd"));
    write_volume(ct, path("ct.nrrd"));
  }

  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  void expect_refused(const std::vector<std::string>& arguments, const std::string& named) const {
    std::vector<std::string> all{"surfaces"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const Outcome outcome = run_usct(all);
    EXPECT_EQ(outcome.exit_status, 2) << outcome.errors;
    EXPECT_NE(outcome.errors.find(named), std::string::npos) << outcome.errors;
  }

  TemporaryFolder folder_;
};

TEST_F(Surfaces, EachLabelGetsAFileWithASafeName) {
  write_text(path("names.yaml"), "1: {name: '../kidney left', colour: [1, 0, 0]}\n");
  const Outcome outcome = run_usct({"surfaces", "--labels", path("labels.nrrd"), "--label-table",
                                    path("names.yaml"), "--output", path("case.ply")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  const std::string kidney = read_text(path("case_1_.._kidney_left.ply"));
  EXPECT_NE(kidney.find("comment name 1 ../kidney left\n"), std::string::npos);
  EXPECT_NE(kidney.find("property uchar red\n"), std::string::npos);
  EXPECT_EQ(read_text(path("case_2_label.ply")).substr(0, 4), "ply\n");
  EXPECT_NE(outcome.output.find("case_2_label.ply: 2 label, "), std::string::npos);
}

TEST_F(Surfaces, TheSurfaceOfACtIsOneFile) {
  const Outcome outcome =
      run_usct({"surfaces", "--ct", path("ct.nrrd"), "--hu", "100", "--output", path("ct.stl")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.errors;
  EXPECT_EQ(read_text(path("ct.stl")).rfind("SPACE=LPS unit=mm CT at 100 HU", 0), 0U);
  expect_refused({"--ct", path("ct.nrrd"), "--hu", "301", "--output", path("none.stl")},
                 "is 301, which no voxel");
  EXPECT_FALSE(std::filesystem::exists(path("none.stl")));
}

TEST_F(Surfaces, BadArgumentsAreRefused) {
  const std::string labels = path("labels.nrrd");
  expect_refused({"--output", path("a.ply")}, "--labels, --ct");
  expect_refused({"--labels", labels, "--output", path("a.obj")}, ".ply or .stl");
  expect_refused({"--labels", labels, "--hu", "5", "--output", path("a.ply")}, "--ct");
  expect_refused({"--labels", labels, "--output", path("a.ply"), "--triangles", "10"}, "1000");
  write_volume(LabelVolume(Grid{{4, 4, 4}}, 0), path("empty.nrrd"));
  expect_refused({"--labels", path("empty.nrrd"), "--output", path("a.ply")}, "empty.nrrd");
}

}  // namespace
}  // namespace usct::test
