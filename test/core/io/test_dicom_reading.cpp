#include <gtest/gtest.h>

#include <cstdlib>

#include "core/io/dicom_patient.h"
#include "core/io/dicom_writer.h"
#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/temporary_folder.h"
#include "us_ct_registration/io/dicom/dicom.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using test::DicomSlice;
using test::expect_input_error;
using test::expect_shows_the_patient;
using test::kRounding;
using test::small_grid;
using test::TemporaryFolder;

TEST(DicomReading, PutsSlicesWherePositionsSayForAnyAxes) {
  for (const auto& [name, grid] : test::example_grids()) {
    SCOPED_TRACE(name);
    const TemporaryFolder folder;
    test::write_shuffled(folder.path(), test::slices_of(grid));
    const LoadedCt ct = read_dicom_ct(folder.path());
    EXPECT_EQ(ct.volume.grid.size, grid.size);
    EXPECT_LT((ct.volume.grid.spacing_mm - grid.spacing_mm).norm(), 1e-6);
    EXPECT_NEAR((ct.volume.grid.centre_mm() - grid.centre_mm()).norm(), 0.0, 1e-6);
    EXPECT_GT(ct.volume.grid.direction.determinant(), 0.0);
    expect_shows_the_patient(ct.volume, kRounding);
    EXPECT_EQ(ct.format, "DICOM");
    EXPECT_EQ(ct.series_uid, DicomSlice().series_uid);
    EXPECT_EQ(ct.frame_of_reference_uid, DicomSlice().frame_of_reference_uid);
    EXPECT_TRUE(ct.warnings.empty()) << ct.warnings.front();
  }
}

TEST(DicomReading, EachSliceHasItsOwnRescaleAndKindOfPixel) {
  const TemporaryFolder folder;
  std::vector<DicomSlice> slices = test::slices_of(small_grid());
  slices[0].intercept = 0.0;
  slices[0].is_signed = true;
  slices[0].bits_stored = 13;
  slices[0].unused_bits = 5;  // overlays were once kept there
  slices[1].slope = 0.5;
  slices[1].intercept = -4000.0;
  slices[1].bits_stored = 14;
  slices[1].unused_bits = 3;
  slices[2].slope = -1.0;
  slices[2].intercept = 3000.0;
  slices[3].bits_stored = 12;
  slices[3].intercept = -5500.0;
  test::write_shuffled(folder.path(), slices);
  expect_shows_the_patient(read_dicom_ct(folder.path()).volume, kRounding + 0.25);
}

TEST(DicomReading, PositionsMayBeRoundedWithinTheTolerance) {
  const TemporaryFolder folder;
  const Grid grid = small_grid();
  std::vector<DicomSlice> slices = test::slices_of(grid);
  slices[1].position_mm.z() += 0.04 * grid.spacing_mm.z();
  slices[2].position_mm.y() -= 0.04 * grid.spacing_mm.z();
  test::write_shuffled(folder.path(), slices);
  const LoadedCt ct = read_dicom_ct(folder.path());
  EXPECT_NEAR(ct.volume.grid.spacing_mm.z(), grid.spacing_mm.z(), 0.02 * grid.spacing_mm.z());
  DicomReadOptions strict;
  strict.position_tolerance = 0.005;
  expect_input_error([&] { read_dicom_ct(folder.path(), strict); }, {"uneven"});
}

/// An icon may hold compressed pixels of its own: fragments, which are no items with elements.
TEST(DicomReading, AnIconWithFragmentsIsPassedOver) {
  const TemporaryFolder folder;
  const Grid grid = test::example_grids().front().grid;
  test::write_shuffled(folder.path(), test::slices_of(grid));
  const CtVolume before = read_dicom_ct(folder.path()).volume;
  const auto element = [](const char* tag, const char* vr) {
    return std::string(tag, 4) + vr + std::string("\0\0\xff\xff\xff\xff", 6);
  };
  const auto item = [](const std::string& bytes) {
    return std::string("\xfe\xff\x00\xe0", 4) + static_cast<char>(bytes.size()) +
           std::string(3, '\0') + bytes;
  };
  const std::string end("\xfe\xff\xdd\xe0\0\0\0\0", 8);
  const std::string icon = element("\x88\x00\x00\x02", "SQ") +
                           std::string("\xfe\xff\x00\xe0\xff\xff\xff\xff", 8) +
                           element("\xe0\x7f\x10\x00", "OB") + item("") +
                           item(std::string("\xff\xd8\xff\xe0\x00\x10", 6)) + end +
                           std::string("\xfe\xff\x0d\xe0\0\0\0\0", 8) + end;
  for (const auto& file : fs::directory_iterator(folder.path())) {
    std::string bytes = test::read_text(file.path());
    const std::string pixels("\xe0\x7f\x10\x00OW", 6);
    bytes.insert(bytes.find(pixels), icon);
    test::write_text(file.path(), bytes);
  }
  EXPECT_EQ(read_dicom_ct(folder.path()).volume.voxels, before.voxels);
}

/// A way to compress, by programs that share no code with the reader if Debian has such programs.
struct Compression {
  const char* name;
  const char* command;  // with two file names as arguments
  double tolerance_hu;
  int bits_stored;
};

class DicomCompression : public testing::TestWithParam<Compression> {};

bool run(const std::string& command, const fs::path& in, const fs::path& out) {
  return std::system(
             (command + " '" + in.string() + "' '" + out.string() + "' 2>/dev/null").c_str()) == 0;
}

std::vector<DicomSlice> slices_to_compress(const Compression& compression) {
  std::vector<DicomSlice> slices = test::slices_of(small_grid());
  for (DicomSlice& slice : slices) {
    slice.size = {32, 24};  // lossy JPEG needs some blocks
    slice.bits_stored = compression.bits_stored;
    if (compression.bits_stored == 8) {
      slice.bits_allocated = 8;
      slice.slope = 16.0;
      slice.intercept = -5500.0;
    } else if (compression.bits_stored == 12) {
      slice.intercept = -5500.0;
    } else {
      slice.is_signed = true;
      slice.intercept = 0.0;
    }
  }
  return slices;
}

TEST_P(DicomCompression, ReadsTheSame) {
  const Compression& compression = GetParam();
  const TemporaryFolder plain, compressed;
  test::write_shuffled(plain.path(), slices_to_compress(compression));
  for (const auto& entry : fs::directory_iterator(plain.path()))
    ASSERT_TRUE(run(compression.command, entry.path(), compressed.path() / entry.path().filename()))
        << compression.command << " failed; dcmtk and GDCM's tools are needed by the tests";
  const CtVolume expected = read_dicom_ct(plain.path()).volume;
  testing::internal::CaptureStderr();
  const LoadedCt ct = read_dicom_ct(compressed.path());
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");  // libraries are silent
  EXPECT_TRUE(same_grid(ct.volume.grid, expected.grid));
  ASSERT_EQ(ct.volume.voxels.size(), expected.voxels.size());
  int worst = 0;
  for (std::size_t i = 0; i < expected.voxels.size(); ++i)
    worst = std::max(worst, std::abs(ct.volume.voxels[i] - expected.voxels[i]));
  EXPECT_LE(worst, compression.tolerance_hu);
  EXPECT_NE(find_dicom_series(compressed.path())[0].transfer_syntax_uid,
            find_dicom_series(plain.path())[0].transfer_syntax_uid);
}

INSTANTIATE_TEST_SUITE_P(
    All, DicomCompression,
    testing::Values(Compression{"implicit", "dcmconv +ti", 0, 16},
                    Compression{"big_endian", "dcmconv +tb", 0, 16},
                    Compression{"jpeg_baseline", "dcmcjpeg +eb", 64, 8},
                    Compression{"jpeg_extended_12_bit", "dcmcjpeg +ee +q 95", 64, 12},
                    Compression{"jpeg_lossless", "dcmcjpeg +el", 0, 16},
                    Compression{"jpeg_lossless_first_order", "dcmcjpeg +e1", 0, 16},
                    Compression{"jpeg_lossless_12_bit", "dcmcjpeg +e1", 0, 12},
                    Compression{"jpeg_ls", "dcmcjpls +el", 0, 16},
                    Compression{"jpeg_ls_near_lossless", "dcmcjpls +en +md 2", 2, 12},
                    Compression{"rle", "dcmcrle", 0, 16}, Compression{"rle_8_bit", "dcmcrle", 0, 8},
                    Compression{"jpeg_2000", "gdcmconv --j2k", 0, 16},
                    Compression{"jpeg_2000_12_bit", "gdcmconv --j2k", 0, 12}),
    [](const auto& parameter) { return parameter.param.name; });

TEST(DicomReading, EnhancedMultiFrameIsTheSameAsItsSlices) {
  for (const auto& [name, grid] : test::example_grids()) {
    SCOPED_TRACE(name);
    const TemporaryFolder folder;
    std::vector<DicomSlice> frames = test::slices_of(grid);
    frames[1].intercept = -9000.0;
    frames[2].slope = 0.5;
    frames[2].intercept = -6000.0;
    std::swap(frames[0], frames[2]);
    test::write_enhanced_dicom(folder.path() / "enhanced.dcm", frames);
    const LoadedCt ct = read_dicom_ct(folder.path());
    EXPECT_EQ(ct.volume.grid.size, grid.size);
    expect_shows_the_patient(ct.volume, kRounding + 0.25);
    EXPECT_TRUE(ct.warnings.empty());
    EXPECT_EQ(find_dicom_series(folder.path())[0].slices, grid.size.z());
    for (const char* command : {"gdcmconv --j2k", "dcmcrle", "dcmcjpls +el"}) {
      const TemporaryFolder compressed;
      if (!run(command, folder.path() / "enhanced.dcm", compressed.path() / "c.dcm")) continue;
      EXPECT_EQ(read_dicom_ct(compressed.path()).volume.voxels, ct.volume.voxels) << command;
    }
  }
}

TEST(DicomReading, EnhancedLocalizerFrameIsPassedOver) {
  const TemporaryFolder folder;
  std::vector<DicomSlice> frames = test::slices_of(small_grid());
  frames.push_back(frames[0]);
  frames.back().image_type = "ORIGINAL\\PRIMARY\\LOCALIZER\\NONE";
  frames.back().hounsfield = [](const Eigen::Vector3d&) { return 0.0; };
  test::write_enhanced_dicom(folder.path() / "e.dcm", frames);
  const LoadedCt ct = read_dicom_ct(folder.path());
  expect_shows_the_patient(ct.volume, kRounding);
  ASSERT_EQ(ct.warnings.size(), 1U);
  EXPECT_NE(ct.warnings[0].find("e.dcm frame 5"), std::string::npos) << ct.warnings[0];
}

}  // namespace
}  // namespace usct
