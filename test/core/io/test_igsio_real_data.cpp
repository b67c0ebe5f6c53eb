#include <gtest/gtest.h>
#include <itkMetaImageIO.h>

#include <set>
#include <sstream>

#include "core/io/bad_files.h"
#include "test_data.h"
#include "test_paths.h"
#include "us_ct_registration/io/ultrasound/igsio.h"

namespace usct {
namespace {

using test::expect_input_error;

/// Expected content of a recording, counted by plain text search in its header, so that no code is
/// shared with the reader.
struct Counted {
  std::string text;

  explicit Counted(const std::filesystem::path& path) {
    const test::FileBytes bytes = test::slurp(path);
    text.assign(bytes.begin(), bytes.end());
    text.resize(text.find("ElementDataFile"));
  }
  int lines_with(const std::string& name, const std::string& value = "") const {
    std::istringstream stream(text);
    int count = 0;
    for (std::string line; std::getline(stream, line);) {
      const std::size_t equals = line.find(" = ");
      if (equals == std::string::npos || line.substr(0, 9) != "Seq_Frame") continue;
      const std::string key = line.substr(0, equals);
      const bool named = key.size() >= name.size() && key.substr(key.size() - name.size()) == name;
      std::string found = line.substr(equals + 3);
      while (!found.empty() && (found.back() == ' ' || found.back() == '\r')) found.pop_back();
      count += named && (value.empty() || found == value) ? 1 : 0;
    }
    return count;
  }
};

TEST(IgsioRealData, EverySequenceReadsWithAllPosesStampsAndFlags) {
  const std::filesystem::path folder = test::data_root() / "plus_us";
  USCT_REQUIRE_DATA(folder);
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.find(".igs.mh") == std::string::npos) continue;
    SCOPED_TRACE(name);
    ++files;
    const Counted counted(entry.path());
    EXPECT_TRUE(is_igsio(entry.path()));
    const IgsioSequence sequence = read_igsio(entry.path());
    int stamps = 0, images_ok = 0, transforms = 0, valid = 0, invalid = 0;
    double last = -1.0;
    for (const IgsioFrame& frame : sequence.frames) {
      stamps += frame.timestamp_s.has_value() ? 1 : 0;
      EXPECT_GT(frame.timestamp_s.value_or(-2.0), last);
      last = frame.timestamp_s.value_or(-2.0);
      images_ok += frame.image_status == "OK" ? 1 : 0;
      for (const auto& [key, transform] : frame.transforms) {
        ++transforms;
        valid += transform.valid() ? 1 : 0;
        invalid += transform.status == "INVALID" ? 1 : 0;
        EXPECT_NEAR(transform.T.linear().determinant(), 1.0, 1e-4) << key;
      }
    }
    EXPECT_EQ(stamps, counted.lines_with("_Timestamp"));
    EXPECT_EQ(static_cast<int>(sequence.frames.size()), stamps);
    EXPECT_EQ(images_ok, counted.lines_with("_ImageStatus", "OK"));
    EXPECT_EQ(transforms, counted.lines_with("Transform"));
    EXPECT_EQ(valid, counted.lines_with("TransformStatus", "OK"));
    EXPECT_EQ(invalid, counted.lines_with("TransformStatus", "INVALID"));
    EXPECT_EQ(sequence.data.size(), sequence.frame_bytes() * sequence.frames.size());
  }
  EXPECT_EQ(files, 12);
}

TEST(IgsioRealData, PixelsAreThoseOfItksReader) {
  const std::filesystem::path path = test::data_root() / "plus_us" / "SpinePhantomFreehand.igs.mha";
  USCT_REQUIRE_DATA(path);
  const IgsioSequence sequence = read_igsio(path);
  const auto io = itk::MetaImageIO::New();
  io->SetFileName(path.string());
  io->ReadImageInformation();
  itk::ImageIORegion region(3);
  for (unsigned axis = 0; axis < 3; ++axis) region.SetSize(axis, io->GetDimensions(axis));
  io->SetIORegion(region);
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(io->GetImageSizeInBytes()));
  io->Read(bytes.data());
  EXPECT_TRUE(bytes == sequence.data);
  EXPECT_GT(std::set<std::uint8_t>(bytes.begin(), bytes.end()).size(), 100U);
}

TEST(IgsioRealData, TheBrightnessFramesFitTheShippedProbe) {
  const std::filesystem::path path =
      test::data_root() / "plus_us" / "UltrasonixCurvilinearBrightnessData.igs.mha";
  USCT_REQUIRE_DATA(path);
  const ProbeConfig probe =
      read_probe_config(std::filesystem::path(USCT_SOURCE_DIR) / "config/probes/bpc8-4_10.yaml");
  const TrackedSweep sweep{std::vector<Eigen::Isometry3d>(5, Eigen::Isometry3d::Identity()), {}};
  const PreScanVolume volume = to_prescan(read_igsio(path), probe, sweep, path.string());
  EXPECT_EQ(volume.geometry.samples(), 3640);
  EXPECT_NEAR(volume.geometry.axial.spacing_mm * 3640, 72.0, 1e-9);
}

TEST(IgsioRealData, AMovingProbeHasAChainOnlyWhereItWasSeen) {
  const std::filesystem::path path = test::data_root() / "plus_us" / "NwirePhantomFreehand.igs.mha";
  USCT_REQUIRE_DATA(path);
  const IgsioSequence sequence = read_igsio(path);
  EXPECT_NO_THROW(transform_chain(sequence.frames[0], {}, "Probe", "Reference", "frame 0"));
  expect_input_error(
      [&] { transform_chain(sequence.frames[0], {}, "Stylus", "Reference", "frame 0"); },
      {"StylusToTracker is INVALID"});
}

}  // namespace
}  // namespace usct
