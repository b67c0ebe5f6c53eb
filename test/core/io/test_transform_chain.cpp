#include <gtest/gtest.h>

#include <map>

#include "core/io/bad_files.h"
#include "core/io/igsio_text.h"
#include "test_data.h"
#include "us_ct_registration/io/ultrasound/igsio.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::good_file;
using test::read_sequence;
using test::replaced;
using test::spit;
using test::TemporaryFolder;

TEST(TransformChain, GoesForwardsAndBackwardsThroughTheCalibration) {
  const IgsioFrame frame = read_sequence(good_file()).frames[0];
  IgsioTransforms calibration;
  IgsioTransform image_to_probe;
  image_to_probe.T = Eigen::Translation3d(1, 2, 3) * Eigen::Scaling(0.5);
  image_to_probe.status = "OK";
  calibration["ImageToProbe"] = image_to_probe;
  const Eigen::Affine3d T = transform_chain(frame, calibration, "Image", "Reference", "frame 0");
  // Computed by hand: image (4, 0, 0) -> probe (3, 2, 3) -> tracker (-2 + 10, 3, 33) -> minus (5,
  // 6, 7).
  EXPECT_LT((T * Eigen::Vector3d(4, 0, 0) - Eigen::Vector3d(3, -3, 26)).norm(), 1e-12);
  const Eigen::Affine3d back = transform_chain(frame, calibration, "Reference", "Image", "frame 0");
  EXPECT_LT((back * T).matrix().isIdentity(1e-12) ? 0.0 : 1.0, 0.5);
  EXPECT_TRUE(
      transform_chain(frame, calibration, "Probe", "Probe", "frame 0").matrix().isIdentity());
}

IgsioTransform along_x(double mm) {
  return {Eigen::Affine3d(Eigen::Translation3d(mm, 0, 0)), "OK"};
}

/// A new calibration of 105 mm; the frames hold the old one, of 5 mm.
TEST(TransformChain, ACalibrationTakesThePlaceOfTheFramesOwn) {
  const std::vector<IgsioTransforms> calibrations{
      {{"ImageToProbe", along_x(105)}},
      {{"ProbeToImage", along_x(-105)}},
      {{"ImageToTransducerOrigin", along_x(100)}, {"TransducerOriginToProbe", along_x(5)}}};
  for (const auto& [name, old_mm] :
       std::map<std::string, double>{{"ImageToProbe", 5}, {"ProbeToImage", -5}}) {
    IgsioFrame frame;
    frame.transforms = {{name, along_x(old_mm)}, {"ProbeToTracker", along_x(1000)}};
    for (const IgsioTransforms& calibration : calibrations)
      EXPECT_DOUBLE_EQ(
          transform_chain(frame, calibration, "Image", "Tracker", "f").translation().x(), 1105.0);
    EXPECT_DOUBLE_EQ(transform_chain(frame, {}, "Image", "Tracker", "f").translation().x(), 1005.0);
  }
}

TEST(TransformChain, NamesTheLinkThatIsInvalidOrMissing) {
  const IgsioSequence sequence = read_sequence(good_file());
  const auto refuse = [&](int frame, const std::string& from, const std::string& to,
                          std::initializer_list<std::string> fragments) {
    expect_input_error(
        [&] {
          transform_chain(sequence.frames[static_cast<std::size_t>(frame)], {}, from, to,
                          "frame 1");
        },
        fragments);
  };
  refuse(1, "Probe", "Tracker", {"frame 1", "'Probe' to 'Tracker'", "ProbeToTracker is INVALID"});
  refuse(1, "Probe", "Reference",
         {"ProbeToTracker is INVALID", "ReferenceToTracker is without status"});
  refuse(0, "Image", "Tracker", {"'Image' to 'Tracker'", "no chain", "nothing"});
  refuse(0, "Probe", "Image", {"'Probe' to 'Image'", "no chain", "Reference, Tracker"});
}

TEST(TransformChain, ReadsNamesThatHoldToMoreThanOnce) {
  IgsioFrame frame;
  for (const char* name : {"ToolToTracker", "StylusToToolTip", "ToolTipToTool"})
    frame.transforms[name] = {Eigen::Affine3d(Eigen::Translation3d(1, 0, 0)), "OK"};
  EXPECT_NEAR(transform_chain(frame, {}, "Stylus", "Tracker", "frame").translation().x(), 3.0,
              1e-15);
}

TEST(PlusCalibration, ReadsTheTransformsOfAConfiguration) {
  const std::string good =
      "<PlusConfiguration><CoordinateDefinitions>"
      "<Transform From=\"Image\" To=\"Probe\" Matrix=\" 2 0 0 1\n 0 2 0 2\n 0 0 2 3\n 0 0 0 1\" "
      "Error=\"0.4\"/>"
      "</CoordinateDefinitions><Transform From=\"Other\" To=\"Thing\"/></PlusConfiguration>";
  const TemporaryFolder folder;
  const auto read_text = [&](const std::string& text) {
    return read_plus_calibration(spit(folder.path() / "config.xml", text));
  };
  const IgsioTransforms transforms = read_text(good);
  ASSERT_EQ(transforms.size(), 1U);
  EXPECT_TRUE(transforms.at("ImageToProbe").valid());
  EXPECT_EQ(transforms.at("ImageToProbe").T * Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(3, 4, 5));
  const auto refuse = [&](const std::string& from, const std::string& to,
                          std::initializer_list<std::string> fragments) {
    expect_input_error([&] { read_text(replaced(good, from, to)); }, fragments);
  };
  refuse("From=\"Image\" ", "", {"config.xml", "line 1", "From"});
  refuse(" 0 0 0 1\"", "\"", {"ImageToProbe", "12", "16"});
  refuse("2 0 0 1", "x 0 0 1", {"ImageToProbe", "x"});
  refuse("</CoordinateDefinitions>", "</Other>", {"config.xml", "line 4", "mismatched"});
  refuse("CoordinateDefinitions>", "Other>", {"config.xml"});
  expect_input_error([&] { read_text("<PlusConfiguration/>"); }, {"CoordinateDefinitions"});
  const std::string one =
      good.substr(good.find("<Transform"), good.find("</Coord") - good.find("<Transform"));
  refuse("</CoordinateDefinitions>", one + "</CoordinateDefinitions>", {"ImageToProbe", "twice"});
  test::expect_refuses_broken_files([](const auto& path) { read_plus_calibration(path); },
                                    test::to_bytes(good), ".xml");
}

TEST(PlusRealData, ReadsTheCalibrationOfADeviceSet) {
  const std::filesystem::path path =
      test::data_root() / "plus_us" / "PlusDeviceSet_fCal_Sim_SpatialCalibration_1.2.xml";
  USCT_REQUIRE_DATA(path);
  const IgsioTransforms transforms = read_plus_calibration(path);
  EXPECT_EQ(transforms.size(), 3U);
  EXPECT_EQ(transforms.at("StylusTipToStylus").T.translation(),
            Eigen::Vector3d(203.772, -12.283, 1.17469));
  EXPECT_EQ(transforms.at("PhantomToReference").T.matrix()(1, 1), -0.9996);
  EXPECT_EQ(transforms.at("ImageToTransducerOriginPixel").T.translation(),
            Eigen::Vector3d(-410, 5, 0));
}

}  // namespace
}  // namespace usct
