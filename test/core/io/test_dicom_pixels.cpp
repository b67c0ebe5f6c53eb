// From the stored values of a pixel to its Hounsfield units: padding, units, and compressed
// streams.
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
using test::read_text;
using test::short_bytes;
using test::TemporaryFolder;
using test::write_text;

constexpr int kStoredInTheMiddle = 1000;

/// Slices of 16 x 16 with one stored value, and another one in the first column.
std::vector<DicomSlice> slices_with_first_column(long stored, bool is_signed, int bits_stored) {
  std::vector<DicomSlice> slices = test::slices_of(test::small_grid());
  for (DicomSlice& slice : slices) {
    slice.size = {16, 16};
    slice.is_signed = is_signed;
    slice.bits_stored = bits_stored;
    slice.intercept = -1024.0;
    const double left_mm = slice.position_mm.x();
    slice.hounsfield = [=](const Eigen::Vector3d& p) {
      return (p.x() - left_mm < 0.1 ? static_cast<double>(stored) : kStoredInTheMiddle) - 1024.0;
    };
  }
  return slices;
}

LoadedCt read_slices(const std::vector<DicomSlice>& slices) {
  const TemporaryFolder folder;
  test::write_shuffled(folder.path(), slices);
  return read_dicom_ct(folder.path());
}

struct Padding {
  int value;
  std::optional<int> limit;
  long stored;
  bool is_signed;
  int bits_stored;
  const char* warning;
  int hu = -1024;
};

TEST(DicomPixels, PaddingIsAirUnlessItMayBeTissue) {
  for (const Padding& padding :
       {Padding{-2000, {}, -2000, true, 16, ""}, Padding{0, {}, 0, false, 16, ""},
        Padding{4095, {}, 4095, false, 12, "up to 3071 HU"},
        Padding{63536, {}, 63536, false, 16, "up to 62512 HU"},
        Padding{3000, 4000, 3500, false, 16, "up to 2976 HU"},
        Padding{4000, 3000, 3500, false, 16, "up to 2976 HU"},
        Padding{1024, {}, 1024, false, 16, "up to 0 HU", 0}}) {
    SCOPED_TRACE(padding.value);
    auto slices = slices_with_first_column(padding.stored, padding.is_signed, padding.bits_stored);
    for (DicomSlice& slice : slices) {
      slice.changes[{0x0028, 0x0120}] = short_bytes(padding.value);
      if (padding.limit) slice.changes[{0x0028, 0x0121}] = short_bytes(*padding.limit);
    }
    const LoadedCt ct = read_slices(slices);
    EXPECT_EQ(ct.volume.at(0, 3, 1), padding.hu);
    EXPECT_EQ(ct.volume.at(1, 3, 1), kStoredInTheMiddle - 1024);
    ASSERT_EQ(ct.warnings.size(), *padding.warning ? 1U : 0U);
    const std::string warning = ct.warnings.empty() ? "" : ct.warnings[0];
    EXPECT_NE(warning.find(padding.warning), std::string::npos) << warning;
  }
}

TEST(DicomPixels, AnotherUnitIsNamedWhicheverFileComesFirst) {
  const std::vector<DicomSlice> good = slices_with_first_column(0, true, 16);
  std::vector<DicomSlice> slices = good;
  for (DicomSlice& slice : slices) slice.rescale_type = "HU_MOD";
  const LoadedCt ct = read_slices(slices);
  ASSERT_EQ(ct.warnings.size(), 1U);
  EXPECT_NE(ct.warnings[0].find("'RescaleType' is 'HU_MOD'"), std::string::npos);
  for (DicomSlice& slice : slices) slice.rescale_type = "";  // HU, where it is absent
  EXPECT_TRUE(read_slices(slices).warnings.empty());
  for (std::size_t i = 0; i < good.size(); ++i) {
    slices = good;
    slices[i].rescale_type = "US";
    expect_input_error([&] { read_slices(slices); },
                       {"differ in 'RescaleType'", "'HU' in 'slice_", "'US' in 'slice_"});
  }
}

TEST(DicomPixels, FramesOfDifferentUnitsAreRefused) {
  const TemporaryFolder folder;
  std::vector<DicomSlice> frames = slices_with_first_column(0, true, 16);
  frames.back().rescale_type = "US";
  test::write_enhanced_dicom(folder.path() / "e.dcm", frames);
  expect_input_error([&] { read_dicom_ct(folder.path()); },
                     {"'HU' in 'e.dcm frame 1'", "'US' in 'e.dcm frame 4'"});
}

void compress(const std::string& command, const fs::path& in, const fs::path& out) {
  ASSERT_EQ(
      std::system((command + " '" + in.string() + "' '" + out.string() + "' 2>/dev/null").c_str()),
      0)
      << command << " failed; dcmtk and GDCM's tools are needed by the tests";
}

/// Slices as JPEG 2000, whose headers then get the other PixelRepresentation.
void write_jpeg_2000_of_other_sign(const fs::path& folder, const std::vector<DicomSlice>& slices) {
  const std::string sign("\x28\x00\x03\x01US\x02\x00", 8);
  for (std::size_t i = 0; i < slices.size(); ++i) {
    const fs::path path = folder / ("slice_" + std::to_string(i) + ".dcm");
    const TemporaryFolder plain;
    test::write_dicom(plain.path() / "plain", slices[i]);
    ASSERT_NO_FATAL_FAILURE(compress("gdcmconv --j2k", plain.path() / "plain", path));
    std::string bytes = read_text(path);
    bytes[bytes.find(sign) + sign.size()] ^= 1;
    write_text(path, bytes);
  }
}

TEST(DicomPixels, ASignedStreamOfAnUnsignedHeaderIsRefused) {
  const TemporaryFolder folder;
  write_jpeg_2000_of_other_sign(folder.path(), slices_with_first_column(-500, true, 12));
  expect_input_error([&] { read_dicom_ct(folder.path()); },
                     {"slice_", "'PixelRepresentation' is 0, must be 1"});
}

/// Some writers compress the two's complement as if it were unsigned. The header is right then.
TEST(DicomPixels, AnUnsignedStreamOfASignedHeaderIsTwosComplement) {
  for (const int bits : {12, 16}) {
    const TemporaryFolder folder;
    write_jpeg_2000_of_other_sign(folder.path(),
                                  slices_with_first_column((1L << bits) - 24, false, bits));
    const CtVolume ct = read_dicom_ct(folder.path()).volume;
    EXPECT_EQ(ct.at(0, 3, 1), -24 - 1024);
    EXPECT_EQ(ct.at(1, 3, 1), kStoredInTheMiddle - 1024);
  }
}

std::string long_bytes(std::size_t value) {
  std::string bytes;
  for (int byte = 0; byte < 4; ++byte) bytes += static_cast<char>(value >> (8 * byte));
  return bytes;
}

std::size_t long_at(const std::string& bytes, std::size_t at) {
  std::size_t value = 0;
  for (std::size_t byte = 4; byte-- > 0;)
    value = value << 8 | static_cast<unsigned char>(bytes[at + byte]);
  return value;
}

/// An enhanced CT whose frames are compressed and cut into two fragments each.
class DicomFragments : public testing::Test {
 protected:
  void SetUp() override {
    frames_ = test::slices_of(test::small_grid());
    const TemporaryFolder plain;
    test::write_enhanced_dicom(plain.path() / "plain", frames_);
    ASSERT_NO_FATAL_FAILURE(compress("dcmcjpls +el", plain.path() / "plain", path_));
    const std::string bytes = read_text(path_);
    const std::string element("\xe0\x7f\x10\x00OB\0\0\xff\xff\xff\xff", 12);
    std::size_t at = bytes.find(element);
    ASSERT_NE(at, std::string::npos);
    at += element.size();
    header_ = bytes.substr(0, at);
    at += 8 + long_at(bytes, at + 4);  // the table that the compression wrote
    while (at + 8 < bytes.size()) {
      const std::size_t length = long_at(bytes, at + 4);
      const std::string stream = bytes.substr(at + 8, length);
      offsets_.push_back(fragments_.size());
      for (const std::string& part : {stream.substr(0, 10), stream.substr(10)})
        fragments_ += item(part);
      at += 8 + length;
    }
    ASSERT_EQ(offsets_.size(), frames_.size());
  }

  static std::string item(const std::string& bytes) {
    return std::string("\xfe\xff\x00\xe0", 4) + long_bytes(bytes.size()) + bytes;
  }
  void write(const std::vector<std::size_t>& offsets) {
    std::string table;
    for (const std::size_t offset : offsets) table += long_bytes(offset);
    write_text(path_,
               header_ + item(table) + fragments_ + std::string("\xfe\xff\xdd\xe0\0\0\0\0", 8));
  }
  void expect_refused(const std::vector<std::size_t>& offsets, const std::string& named) {
    write(offsets);
    expect_input_error([&] { read_dicom_ct(folder_.path()); }, {"e.dcm", named});
  }

  const TemporaryFolder folder_;
  const fs::path path_ = folder_.path() / "e.dcm";
  std::vector<DicomSlice> frames_;
  std::string header_, fragments_;
  std::vector<std::size_t> offsets_;
};

TEST_F(DicomFragments, TheTableOfOffsetsSaysWhichAreAFrame) {
  write(offsets_);
  test::expect_shows_the_patient(read_dicom_ct(folder_.path()).volume, test::kRounding);
}

TEST_F(DicomFragments, ATableThatContradictsThemIsRefused) {
  expect_refused({}, "'PixelData' has 8 fragments, must have one for each of 4 frames");
  std::vector<std::size_t> offsets = offsets_;
  offsets.pop_back();
  expect_refused(offsets, "or a table of their offsets");
  offsets = offsets_;
  ++offsets[1];
  expect_refused(offsets, "frame 2 begins at byte " + std::to_string(offsets[1]));
  offsets[1] = 0;
  expect_refused(offsets, "frame 2 begins at byte 0");
  offsets = offsets_;
  offsets[0] = 18;  // the second fragment
  expect_refused(offsets, "frame 1 begins at byte 18");
  offsets = offsets_;
  std::swap(offsets[1], offsets[2]);
  expect_refused(offsets, "frame 3 begins");
  offsets = offsets_;
  offsets[3] = 0xffffffff;
  expect_refused(offsets, "frame 4 begins at byte 4294967295");
}

}  // namespace
}  // namespace usct
