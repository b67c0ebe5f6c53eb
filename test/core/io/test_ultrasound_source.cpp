#include <gtest/gtest.h>

#include <fstream>

#include "core/io/expect_input_error.h"
#include "core/io/temporary_folder.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct::test {
namespace {

constexpr int kWidth = 60;
constexpr int kHeight = 40;
constexpr double kPixelMm = 0.5;

/// Pose of frame `f`: frames follow each other along elevation, and a rotation turns every axis.
Eigen::Affine3d T_reference_probe(int f) {
  return Eigen::AngleAxisd(0.6, Eigen::Vector3d(1, 2, -1).normalized()) *
         Eigen::Translation3d(0.0, 0.0, 0.4 * f) * Eigen::Affine3d::Identity();
}

/// Eight upright B-mode frames, 0.4 mm apart; brightness rises along columns and rows.
IgsioSequence b_mode_sweep() {
  IgsioSequence sequence;
  sequence.width = kWidth;
  sequence.height = kHeight;
  sequence.orientation = "MF";
  sequence.image_type = "BRIGHTNESS";
  for (int f = 0; f < 8; ++f) {
    IgsioFrame frame;
    frame.timestamp_s = 0.1 * f;
    frame.image_status = "OK";
    frame.transforms["ProbeToReference"] = {T_reference_probe(f), "OK"};
    sequence.frames.push_back(frame);
    for (int row = 0; row < kHeight; ++row)
      for (int column = 0; column < kWidth; ++column)
        sequence.data.push_back(static_cast<std::uint8_t>(50 + 2 * column + row));
  }
  return sequence;
}

class UltrasoundSourceTest : public testing::Test {
 protected:
  /// Writes the sequence and a calibration that puts pixel (30, 0) at the probe's origin.
  UltrasoundSource source_of(const IgsioSequence& sequence) const {
    UltrasoundSource source;
    source.path = folder_.path() / "sweep.igs.mha";
    write_igsio(sequence, source.path, true);
    source.calibration = folder_.path() / "calibration.xml";
    std::ofstream(source.calibration)
        << "<PlusConfiguration><CoordinateDefinitions><Transform From=\"Image\" To=\"Probe\" "
           "Matrix=\"0.5 0 0 -15  0 0.5 0 0  0 0 1 0  0 0 0 1\"/>"
           "</CoordinateDefinitions></PlusConfiguration>";
    return source;
  }

  /// The same with a further, constant transform in the calibration.
  UltrasoundSource with_constant(const std::string& from, const std::string& to,
                                 const IgsioSequence& sequence = b_mode_sweep()) const {
    UltrasoundSource source = source_of(sequence);
    std::ofstream(source.calibration)
        << "<PlusConfiguration><CoordinateDefinitions><Transform From=\"Image\" To=\"Probe\" "
           "Matrix=\"0.5 0 0 -15  0 0.5 0 0  0 0 1 0  0 0 0 1\"/><Transform From=\""
        << from << "\" To=\"" << to
        << "\" Matrix=\"1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1\"/>"
           "</CoordinateDefinitions></PlusConfiguration>";
    return source;
  }

  std::filesystem::path probe_yaml() const {
    const auto path = folder_.path() / "probe.yaml";
    std::ofstream(path) << "name: test\nkind: linear\nlines: 21\nline_pitch_mm: 1\n"
                           "start_depth_mm: 1\nsample_spacing_mm: 0.5\n";
    return path;
  }

  TemporaryFolder folder_;
};

TEST_F(UltrasoundSourceTest, BModeImagesLandWhereTheChainOfTransformsPutsThem) {
  const UltrasoundInput input = read_ultrasound(source_of(b_mode_sweep()));
  EXPECT_TRUE(input.warnings.empty());
  const ScanConverted space = in_space(input.data, 0.4, CompoundOptions{});
  for (const auto& [column, row] : {std::pair{10, 8}, {30, 20}, {50, 33}}) {
    const Eigen::Vector3d p_probe(kPixelMm * (column - 30), kPixelMm * row, 1.4);
    const Eigen::Vector3d p_us = T_reference_probe(0) * p_probe;
    EXPECT_EQ(sample(space.mask, p_us, Interpolation::kNearest, Outside::constant(0)), 255.0F);
    EXPECT_NEAR(sample(space.volume, p_us, Interpolation::kTrilinear, Outside::constant(0)),
                50 + 2 * column + row, 2.0);
  }
}

TEST_F(UltrasoundSourceTest, BModeImagesAreResampledAlongTheBeamsOfAProbe) {
  UltrasoundSource source = source_of(b_mode_sweep());
  source.probe = probe_yaml();
  expect_input_error([&] { read_ultrasound(source); }, {"sweep.igs.mha", "number of samples"});
  source.image_origin_px = Eigen::Vector2d(30.0, 0.0);
  source.image_spacing_mm = Eigen::Vector2d(kPixelMm, kPixelMm);
  source.samples = 30;
  const UltrasoundInput input = read_ultrasound(source);
  const auto& volume = std::get<PreScanVolume>(input.data);
  ASSERT_EQ(volume.geometry.frames(), 8);
  // Line 0 is at x = -10 mm, column 10; sample 0 at 1 mm, row 2.
  EXPECT_NEAR(volume.at(0, 0, 3), 50 + 2 * 10 + 2, 1);
  EXPECT_NEAR(volume.at(20, 15, 3), 50 + 2 * 40 + 22, 1);
  const Eigen::Vector3d p_us = us_from_scan(volume.geometry, {0, 0, 3});
  EXPECT_LT((p_us - T_reference_probe(3) * Eigen::Vector3d(-10, 1, 0)).norm(), 1e-4);
  EXPECT_EQ(std::get<TrackedSweep>(volume.geometry.motion).frame_times_s.size(), 8U);
}

/// All frames would lie in one place, without a word.
TEST_F(UltrasoundSourceTest, ACalibrationDoesNotReplaceTrackedPoses) {
  expect_input_error([&] { read_ultrasound(with_constant("Probe", "Reference")); },
                     {"calibration.xml", "'ProbeToReference'", "sweep.igs.mha", "changes"});
  expect_input_error([&] { read_ultrasound(with_constant("Reference", "Probe")); },
                     {"calibration.xml", "'ProbeToReference'", "sweep.igs.mha", "changes"});
  IgsioSequence by_tracker = b_mode_sweep();
  for (IgsioFrame& frame : by_tracker.frames) {
    frame.transforms["ProbeToTracker"] = frame.transforms.at("ProbeToReference");
    frame.transforms.erase("ProbeToReference");
  }
  expect_input_error([&] { read_ultrasound(with_constant("Image", "Reference", by_tracker)); },
                     {"calibration.xml", "'Image' to 'Reference'", "one place"});
  EXPECT_NO_THROW(read_ultrasound(with_constant("Reference", "Room")));
}

TEST_F(UltrasoundSourceTest, AnOptionThatTheSequenceCannotUseIsRefused) {
  UltrasoundSource images = source_of(b_mode_sweep());
  images.samples = 30;  // without a probe
  expect_input_error([&] { read_ultrasound(images); }, {"sweep.igs.mha", "a probe YAML is needed"});
  IgsioSequence lines = b_mode_sweep();
  lines.orientation = "FM";
  UltrasoundSource beams = source_of(lines);
  beams.probe = probe_yaml();
  beams.samples = 30;
  expect_input_error([&] { read_ultrasound(beams); }, {"'samples' is '30'", "not images"});
}

TEST_F(UltrasoundSourceTest, WhatIsWrongWithTheImagesNamesTheFile) {
  IgsioSequence sequence = b_mode_sweep();
  sequence.frames[3].timestamp_s = 0.1;  // before frame 2
  expect_input_error([&] { read_ultrasound(source_of(sequence)); }, {"sweep.igs.mha", "times_s"});
  UltrasoundSource outside = source_of(b_mode_sweep());
  outside.probe = probe_yaml();
  outside.image_origin_px = Eigen::Vector2d(1000.0, 0.0);
  outside.image_spacing_mm = Eigen::Vector2d(kPixelMm, kPixelMm);
  outside.samples = 30;
  expect_input_error([&] { read_ultrasound(outside); },
                     {"sweep.igs.mha", "image placement leaves every sample outside"});
}

TEST_F(UltrasoundSourceTest, InvalidFramesAreAnErrorUnlessTheyAreToBeLeftOut) {
  IgsioSequence sequence = b_mode_sweep();
  sequence.frames[2].transforms["ProbeToReference"].status = "INVALID";
  sequence.frames[5].image_status = "INVALID";
  UltrasoundSource source = source_of(sequence);
  expect_input_error([&] { read_ultrasound(source); }, {"frame 2", "ProbeToReference"});
  source.skip_invalid_frames = true;
  const UltrasoundInput input = read_ultrasound(source);
  EXPECT_EQ(std::get<TrackedImages>(input.data).count(), 6);
  ASSERT_EQ(input.warnings.size(), 2U);
  EXPECT_NE(input.warnings[0].find("frame 2"), std::string::npos);
  EXPECT_NE(input.warnings[1].find("frame 5"), std::string::npos);

  for (IgsioFrame& frame : sequence.frames) frame.image_status = "INVALID";
  source = source_of(sequence);
  source.skip_invalid_frames = true;
  expect_input_error([&] { read_ultrasound(source); }, {"no valid frame"});
}

TEST_F(UltrasoundSourceTest, PreScanFramesKeepTheirSamplesAndDropInvalidOnes) {
  IgsioSequence sequence = b_mode_sweep();
  sequence.orientation = "FM";  // 40 lines of 60 samples
  for (std::size_t f = 0; f < 8; ++f)
    sequence.data[f * kWidth * kHeight] = static_cast<std::uint8_t>(f);
  sequence.frames[1].image_status = "INVALID";
  UltrasoundSource source = source_of(sequence);
  source.skip_invalid_frames = true;
  expect_input_error([&] { read_ultrasound(source); }, {"a probe YAML is needed"});
  source.probe = folder_.path() / "probe.yaml";
  std::ofstream(source.probe) << "name: test\nkind: linear\nlines: 40\nline_pitch_mm: 1\n"
                                 "start_depth_mm: 0\nsample_spacing_mm: 0.5\n";
  const UltrasoundInput input = read_ultrasound(source);
  const auto& volume = std::get<PreScanVolume>(input.data);
  ASSERT_EQ(volume.geometry.frames(), 7);
  EXPECT_EQ(volume.at(0, 0, 0), 0);
  EXPECT_EQ(volume.at(0, 0, 1), 2);
  EXPECT_EQ(volume.at(3, 1, 6), 50 + 2 * 3 + 1);
}

TEST_F(UltrasoundSourceTest, AScaledPoseIsRefusedForBeams) {
  IgsioSequence sequence = b_mode_sweep();
  sequence.orientation = "FM";
  for (IgsioFrame& frame : sequence.frames) frame.transforms["ProbeToReference"].T.linear() *= 1.01;
  UltrasoundSource source = source_of(sequence);
  source.probe = folder_.path() / "probe.yaml";
  std::ofstream(source.probe) << "name: test\nkind: linear\nlines: 40\nline_pitch_mm: 1\n"
                                 "start_depth_mm: 0\nsample_spacing_mm: 0.5\n";
  expect_input_error([&] { read_ultrasound(source); }, {"deviates from a rotation"});
}

}  // namespace
}  // namespace usct::test
