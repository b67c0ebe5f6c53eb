#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "expect_input_error.h"
#include "temporary_folder.h"
#include "us_ct_registration/io/camera_file.h"
#include "us_ct_registration/io/volumes/label_table.h"

namespace usct {
namespace {

using test::expect_input_error;

class YamlFile : public testing::Test {
 protected:
  std::filesystem::path file(const std::string& text) const {
    const std::filesystem::path path = folder_.path() / "file.yaml";
    std::ofstream(path) << text;
    return path;
  }
  test::TemporaryFolder folder_;
};

using LabelTableFile = YamlFile;
using CameraFile = YamlFile;

TEST_F(LabelTableFile, HasNamesAndColours) {
  const LabelTable table = read_label_table(
      file("1: {name: left kidney, colour: [1, 0.5, 0]}\n65535: {name: tumour}\n"));
  ASSERT_EQ(table.size(), 2U);
  EXPECT_EQ(table.at(1).name, "left kidney");
  EXPECT_EQ(label_colour(1, table), (std::array<float, 3>{1.0F, 0.5F, 0.0F}));
  EXPECT_EQ(table.at(65535).name, "tumour");
  EXPECT_FALSE(table.at(65535).colour);
  EXPECT_EQ(label_text(1, table), "1 left kidney");
  EXPECT_EQ(label_text(5, table), "5 label");
}

TEST_F(LabelTableFile, IsReadStrictly) {
  const auto refused = [&](const std::string& text, const std::vector<std::string>& named) {
    expect_input_error([&] { read_label_table(file(text)); }, named);
  };
  refused("kidney: {name: kidney}", {"file.yaml", "label", "kidney"});
  refused("0: {name: background}", {"label 0", "[1, 65535]"});
  refused("65536: {name: a}", {"label 65536"});
  refused("1: kidney", {"'1'"});
  refused("1: {colour: [1, 0, 0]}", {"'1.name' is missing"});
  refused("1: {name: ''}", {"'1.name' is empty"});
  refused("1: {name: a}\n2: {name: a}", {"'a' is given twice"});
  refused("02: {name: a}\n2: {name: b}", {"the label", "is given twice"});
  refused("1: {name: a, colour: [1, 0]}", {"'1.colour'", "red, green and blue"});
  refused("1: {name: a, colour: [1, 0, 2]}", {"'1.colour'"});
  refused("1: {name: a, color: [1, 0, 0]}", {"color"});
  refused("[1, 2]", {"file.yaml"});
}

TEST_F(LabelTableFile, NeighboursWithoutColourDifferClearly) {
  for (int label = 0; label < 20; ++label)
    EXPECT_NE(label_colour(label, {}), label_colour(label + 1, {}));
}

std::string camera_text(const std::string& model, const std::string& coefficients) {
  return "image_width: 640\nimage_height: 480\ncamera_name: endoscope\n"
         "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [500, 0, 310, 0, 510, 250, 0, 0, 1]\n"
         "distortion_model: " +
         model + "\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: " + coefficients +
         "\nprojection_matrix:\n  rows: 3\n  cols: 4\n  data: [1, 2]\n";
}

TEST_F(CameraFile, IsThatOfCameraCalibration) {
  const Camera camera = read_camera(file(camera_text("plumb_bob", "[-0.2, 0.1, 0.001, 0.002, 0]")));
  const CameraIntrinsics& c = camera.intrinsics();
  EXPECT_EQ(c.width, 640);
  EXPECT_EQ(c.height, 480);
  EXPECT_EQ(c.fx, 500.0);
  EXPECT_EQ(c.fy, 510.0);
  EXPECT_EQ(c.cx, 310.0);
  EXPECT_EQ(c.cy, 250.0);
  EXPECT_THAT(c.distortion, testing::ElementsAre(-0.2, 0.1, 0.001, 0.002, 0, 0, 0, 0));
}

TEST_F(CameraFile, IsReadStrictly) {
  const auto refused = [&](const std::string& text, const std::vector<std::string>& named) {
    expect_input_error([&] { read_camera(file(text)); }, named);
  };
  refused(camera_text("equidistant", "[0, 0, 0, 0]"), {"file.yaml", "'equidistant'"});
  refused(camera_text("plumb_bob", "[0, 0, 0, 0]"), {"has 4 numbers, must have 5"});
  refused(camera_text("rational_polynomial", "[0, 0, 0, 0, 0]"), {"must have 8"});
  refused("image_width: 640", {"image_height"});
  refused(camera_text("plumb_bob", "[-3, 0, 0, 0, 0]"), {"folds back"});
  for (const char* data :
       {"[500, 5, 310, 0, 510, 250, 0, 0, 1]", "[500, 0, 310, 0, 510, 250, 0, 0, 7]"}) {
    std::string text = camera_text("plumb_bob", "[0, 0, 0, 0, 0]");
    const std::string good = "[500, 0, 310, 0, 510, 250, 0, 0, 1]";
    refused(text.replace(text.find(good), good.size(), data), {"'camera_matrix'", "no skew"});
  }
}

}  // namespace
}  // namespace usct
