// The reader must answer every damaged DICOM file with an error that names it, never with a crash
// or with invented pixels.
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <random>

#include "core/io/dicom_writer.h"
#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/temporary_folder.h"
#include "core/io/without_permission.h"
#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/threads.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using test::DicomSlice;
using test::expect_input_error;
using test::read_text;
using test::short_bytes;
using test::TemporaryFolder;
using test::write_text;

/// Three slices, one of which is spoilt by the test.
class DicomBadInput : public testing::Test {
 protected:
  void SetUp() override {
    Grid grid = test::example_grids()[0].grid;
    grid.size = {16, 12, 3};
    slices_ = test::slices_of(grid);
    for (DicomSlice& slice : slices_) {
      slice.bits_stored = 12;
      slice.intercept = -5500.0;
    }
    for (std::size_t i = 0; i < slices_.size(); ++i)
      test::write_dicom(folder_.path() / ("slice_" + std::to_string(i) + ".dcm"), slices_[i]);
  }

  fs::path spoilt() const { return folder_.path() / "slice_1.dcm"; }
  void expect_refused(std::vector<std::string> named) {
    named.push_back("slice_1.dcm");
    expect_input_error([&] { read_dicom_ct(folder_.path()); }, named);
  }

  const TemporaryFolder folder_;
  std::vector<DicomSlice> slices_;
  const ThreadCount one_thread_{1};  // thousands of tiny files are too little work for more
};

TEST_F(DicomBadInput, NamesTheAttributeTheValueAndTheConstraint) {
  struct Case {
    gdcm::Tag tag;
    std::optional<std::string> bytes;
    std::vector<std::string> named;
  };
  const gdcm::Tag rows(0x28, 0x10), columns(0x28, 0x11), spacing(0x28, 0x30),
      allocated(0x28, 0x100), stored(0x28, 0x101), high(0x28, 0x102), sign(0x28, 0x103),
      position(0x20, 0x32), orientation(0x20, 0x37), slope(0x28, 0x1053), intercept(0x28, 0x1052),
      samples(0x28, 0x2), meaning(0x28, 0x4), modality(0x8, 0x60), pixels(0x7fe0, 0x10),
      frames(0x28, 0x8);
  const std::vector<Case> cases = {
      {rows, short_bytes(0), {"'Rows' is 0", "within [1, 8192]"}},
      {rows, std::nullopt, {"'Rows' is missing"}},
      {rows, std::string(4, '\1'), {"'Rows'", "4 bytes"}},
      {rows, short_bytes(6000), {"size", "6000"}},
      {columns, short_bytes(0), {"'Columns' is 0"}},
      {spacing, "nan\\1", {"'PixelSpacing'", "nan"}},
      {spacing, "0\\1", {"'PixelSpacing'", "> 0"}},
      {spacing, "1", {"'PixelSpacing'", "2 numbers"}},
      {spacing, std::nullopt, {"'PixelSpacing' is missing"}},
      {allocated, short_bytes(12), {"'BitsAllocated' is 12"}},
      {stored, short_bytes(17), {"'BitsStored' is 17"}},
      {high, short_bytes(15), {"'HighBit' is 15", "11"}},
      {sign, short_bytes(7), {"'PixelRepresentation' is 7"}},
      {samples, short_bytes(3), {"'SamplesPerPixel' is 3"}},
      {meaning, "MONOCHROME1", {"'PhotometricInterpretation'", "MONOCHROME1"}},
      {position, "1\\2", {"'ImagePositionPatient'", "3 numbers"}},
      {position, "1\\2\\inf", {"'ImagePositionPatient'", "inf"}},
      {position, std::nullopt, {"'ImagePositionPatient' is missing"}},
      {orientation, "1\\0\\0\\0\\0\\0", {"'ImageOrientationPatient'", "unit vectors"}},
      {orientation, "1\\0\\0\\0.9\\0.1\\0", {"'ImageOrientationPatient'", "perpendicular"}},
      {slope, "0", {"'RescaleSlope' is 0"}},
      {slope, "1e9", {"HU", "-32768"}},
      {slope, std::nullopt, {"'RescaleSlope' is missing"}},
      {intercept, "", {"'RescaleIntercept' is missing"}},
      {intercept, "-1O24", {"'RescaleIntercept'", "-1O24"}},
      {frames, "3", {"'PerFrameFunctionalGroupsSequence'", "3 frames"}},
      {frames, "-3", {"'NumberOfFrames' is -3"}},
      {modality, std::nullopt, {"'Modality' is missing"}},
      {pixels, std::nullopt, {"'PixelData' is missing"}},
      {pixels, std::string(100, 'x'), {"'PixelData' has 100 bytes", "384"}},
  };
  for (const Case& bad : cases) {
    SCOPED_TRACE(bad.named.front());
    DicomSlice slice = slices_[1];
    slice.changes[bad.tag] = bad.bytes;
    test::write_dicom(spoilt(), slice);
    expect_refused(bad.named);
  }
}

TEST_F(DicomBadInput, EveryTruncationIsRefused) {
  const std::string whole = read_text(spoilt());
  for (std::size_t bytes = 0; bytes < whole.size(); bytes += 3) {
    write_text(spoilt(), whole.substr(0, bytes));
    EXPECT_THROW(read_dicom_ct(folder_.path()), InputError) << "cut to " << bytes;
  }
}

TEST_F(DicomBadInput, EveryTruncationOfAnEnhancedImageIsRefused) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "e.dcm";
  test::write_enhanced_dicom(path, slices_);
  const std::string whole = read_text(path);
  for (std::size_t bytes = 0; bytes < whole.size(); bytes += 11) {
    write_text(path, whole.substr(0, bytes));
    EXPECT_THROW(read_dicom_ct(folder.path()), InputError) << "cut to " << bytes;
  }
}

TEST_F(DicomBadInput, EveryTruncationOfCompressedPixelsIsRefused) {
  for (const char* command : {"dcmcrle", "dcmcjpls +el", "dcmcjpeg +e1", "gdcmconv --j2k"}) {
    SCOPED_TRACE(command);
    test::write_dicom(spoilt(), slices_[1]);
    const fs::path compressed = folder_.path() / "slice_1.dcm.new";
    if (std::system((std::string(command) + " '" + spoilt().string() + "' '" + compressed.string() +
                     "' 2>/dev/null")
                        .c_str()) != 0)
      FAIL() << command << " failed; dcmtk and GDCM's tools are needed by the tests";
    fs::rename(compressed, spoilt());
    const std::string whole = read_text(spoilt());
    for (std::size_t bytes = 700; bytes < whole.size(); bytes += 5) {
      write_text(spoilt(), whole.substr(0, bytes));
      EXPECT_THROW(read_dicom_ct(folder_.path()), InputError) << "cut to " << bytes;
    }
  }
}

/// A changed pixel cannot be detected without a checksum; everything else must be an InputError.
TEST_F(DicomBadInput, DamagedBytesNeverDoWorseThanAnInputError) {
  const TemporaryFolder enhanced;
  test::write_enhanced_dicom(enhanced.path() / "e.dcm", slices_);
  for (const fs::path& path : {spoilt(), enhanced.path() / "e.dcm"}) {
    const std::string whole = read_text(path);
    std::mt19937 random(23);
    int refused = 0;
    for (int round = 0; round < 600; ++round) {
      std::string damaged = whole;
      for (int flips = 0; flips < 1 + round % 3; ++flips)
        damaged[132 + random() % (damaged.size() - 500)] = static_cast<char>(random());
      write_text(path, damaged);
      try {
        read_dicom_ct(path.parent_path()).volume.grid.validate("read");
      } catch (const InputError&) {
        ++refused;
      }
    }
    EXPECT_GT(refused, 100);
  }
}

TEST_F(DicomBadInput, CompressedStreamOfAnotherSizeIsRefused) {
  DicomSlice slice = slices_[1];
  slice.size = {16, 13};
  test::write_dicom(spoilt(), slice);
  const fs::path compressed = folder_.path() / "slice_1.dcm.new";
  if (std::system(("dcmcjpls '" + spoilt().string() + "' '" + compressed.string() + "'").c_str()) !=
      0)
    FAIL() << "dcmcjpls failed; dcmtk is needed by the tests";
  fs::rename(compressed, spoilt());
  std::string bytes = read_text(spoilt());
  const std::string rows("\x28\x00\x10\x00US\x02\x00", 8);
  bytes[bytes.find(rows) + rows.size()] = 12;
  write_text(spoilt(), bytes);
  expect_refused({"16 x 13", "16 x 12"});
}

/// A compressed slice of a few bytes may claim any size, for which memory would be taken.
TEST_F(DicomBadInput, SizesOfNoScannerAreRefused) {
  for (const auto& [tag, name] : {std::pair(0x0010, "'Rows'"), std::pair(0x0011, "'Columns'")}) {
    DicomSlice slice = slices_[1];
    slice.changes[gdcm::Tag(0x0028, static_cast<std::uint16_t>(tag))] = short_bytes(60000);
    test::write_dicom(spoilt(), slice);
    expect_refused({name, "60000", "8192"});
  }
}

TEST_F(DicomBadInput, CompressionThatIsNotKnownIsNamed) {
  std::string bytes = read_text(spoilt());
  const std::string syntax = "1.2.840.10008.1.2.1";
  std::string other = bytes;
  write_text(spoilt(), other.replace(bytes.find(syntax), syntax.size(), "1.2.840.10008.1.2.9"));
  expect_refused({"1.2.840.10008.1.2.9"});
}

/// A recursive parser without a limit would overflow the stack and end the program.
TEST_F(DicomBadInput, SequencesNestedTooDeepAreRefused) {
  const std::string sequence("\x08\x00\x40\x11SQ\x00\x00\xff\xff\xff\xff", 12);
  const std::string item("\xfe\xff\x00\xe0\xff\xff\xff\xff", 8);
  std::string bytes = read_text(spoilt());
  const std::size_t elements = bytes.find(std::string("\x08\x00\x60\x00", 4));
  ASSERT_NE(elements, std::string::npos);
  bytes.resize(elements);
  for (int level = 0; level < 100000; ++level) bytes += sequence + item;
  write_text(spoilt(), bytes);
  expect_refused({"nested sequences"});
}

TEST_F(DicomBadInput, FilesThatAreNotDicomDespiteTheirName) {
  write_text(spoilt(), "");
  expect_refused({});
  write_text(spoilt(), std::string(4000, 'x'));
  expect_refused({});
  write_text(spoilt(), std::string(128, '\0') + "DICM");
  expect_refused({});
  fs::remove(spoilt());
  fs::create_directory(spoilt());  // a folder of that name holds nothing, so a slice is missing
  expect_input_error([&] { find_dicom_series(spoilt()); }, {"slice_1.dcm", "no DICOM files"});
}

TEST_F(DicomBadInput, PathsWithoutACt) {
  const TemporaryFolder empty;
  const fs::path path = empty.path();
  expect_input_error([&] { read_ct(path / "missing"); }, {"missing", "does not exist"});
  expect_input_error([&] { read_ct(path); }, {path.string(), "no DICOM files (0 others)"});
  write_text(path / "notes.txt", "CT of last week");
  expect_input_error([&] { read_ct(path); }, {path.string(), "no DICOM files (1 others)"});
  expect_input_error([&] { read_ct(path / "notes.txt"); }, {"notes.txt", "not a DICOM file"});
  DicomSlice mr;
  mr.modality = "MR";
  test::write_dicom(path / "mr.dcm", mr);
  expect_input_error([&] { read_ct(path); }, {path.string(), "no CT images", "MR"});
  DicomSlice index;
  index.modality = "";
  index.changes[{0x0004, 0x1220}] = "";
  test::write_dicom(path / "DICOMDIR", index);
  expect_input_error([&] { read_ct(path / "DICOMDIR"); }, {"DICOMDIR", "folder"});
}

TEST_F(DicomBadInput, WithoutPermission) {
  const test::WithoutPermission lock(spoilt());
  expect_refused({"cannot be opened", "Permission denied"});
}

TEST_F(DicomBadInput, OptionsAreValidated) {
  DicomReadOptions options;
  options.position_tolerance = 0.0;
  expect_input_error([&] { read_dicom_ct(folder_.path(), options); },
                     {"'position_tolerance' is 0"});
  options.position_tolerance = std::nan("");
  expect_input_error([&] { read_dicom_ct(folder_.path(), options); }, {"'position_tolerance'"});
}

}  // namespace
}  // namespace usct
