#include <gtest/gtest.h>
#include <itkMetaImageIO.h>

#include "core/io/bad_files.h"
#include "core/io/igsio_text.h"
#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::good_file;
using test::kData;
using test::read_sequence;
using test::replaced;
using test::spit;
using test::TemporaryFolder;

std::string text_of(const OrientedImage& image) {
  return {image.pixels.begin(), image.pixels.end()};
}

TEST(Igsio, ReadsPosesStampsStatusAndOtherFields) {
  const IgsioSequence sequence = read_sequence(good_file());
  EXPECT_EQ(sequence.width, 3);
  EXPECT_EQ(sequence.height, 2);
  EXPECT_EQ(sequence.orientation, "MFA");
  EXPECT_EQ(sequence.image_type, "BRIGHTNESS");
  EXPECT_EQ(sequence.fields.at("ElementSpacing"), "1 1 1");
  EXPECT_EQ(sequence.data, test::to_bytes(kData));
  ASSERT_EQ(sequence.frames.size(), 2U);
  EXPECT_EQ(sequence.frames[0].timestamp_s, 12.5);
  EXPECT_EQ(sequence.frames[0].image_status, "OK");
  const IgsioTransform& probe = sequence.frames[0].transforms.at("ProbeToTracker");
  EXPECT_TRUE(probe.valid());
  EXPECT_EQ(probe.T * Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(10, 1 + 2e-16, 30));
  EXPECT_FALSE(sequence.frames[1].transforms.at("ProbeToTracker").valid());
  EXPECT_FALSE(sequence.frames[1].transforms.at("ReferenceToTracker").valid());  // no status
  EXPECT_FALSE(sequence.frames[1].timestamp_s.has_value());
  EXPECT_EQ(sequence.frames[1].fields.at("UnfilteredTimestamp"), "13.25");
}

TEST(Igsio, ReadsASingleFrameWithTwoAxesAndDetachedData) {
  const TemporaryFolder folder;
  spit(folder.path() / "frame.raw", "abcdefghijkl");
  const auto read_header = [&](const std::string& name) {
    return read_igsio(spit(folder.path() / "frame.igs.mhd",
                           "ObjectType = Image\r\nNDims = 2\r\nDimSize = 3 2\r\n"
                           "ElementType = MET_SHORT\r\nUltrasoundImageType = RF_REAL\r\n"
                           "ElementDataFile = " +
                               name + "\r\n"));
  };
  const IgsioSequence sequence = read_header("frame.raw");
  EXPECT_EQ(sequence.element, IgsioElement::kInt16);
  EXPECT_EQ(sequence.frames.size(), 1U);
  EXPECT_EQ(sequence.data.size(), 12U);
  expect_input_error([&] { read_header("../frame.raw"); }, {"ElementDataFile", "same folder"});
  expect_input_error([&] { read_header("/etc/passwd"); }, {"ElementDataFile", "same folder"});
  expect_input_error([&] { read_header("none.raw"); },
                     {"frame.igs.mhd", "'ElementDataFile'", "none.raw", "does not exist"});
  expect_input_error([&] { read_header("LIST"); }, {"ElementDataFile", "LIST"});
  expect_input_error([&] { read_header("frame%02d.raw 1 2 1"); }, {"ElementDataFile"});
}

/// Its frames would become the slices of a CT, since it has the ending of a volume.
TEST(Igsio, IsNoVolume) {
  const TemporaryFolder folder;
  const std::filesystem::path path = spit(folder.path() / "sweep.igs.mha", good_file());
  const std::vector<std::string> named = {"sweep.igs.mha", "ultrasound sequence, must be a volume"};
  expect_input_error([&] { read_ct(path); }, named);
  expect_input_error([&] { read_volume<std::uint16_t>(path); }, named);  // as of a label map
}

TEST(Igsio, WhatIsWrittenComesBackAndIsAMetaImageForOtherPrograms) {
  const IgsioSequence sequence = read_sequence(good_file());
  for (const bool compressed : {false, true}) {
    const TemporaryFolder folder;
    const std::string path = (folder.path() / "out.mha").string();
    write_igsio(sequence, path, compressed);
    const IgsioSequence back = read_igsio(path);
    EXPECT_TRUE(is_igsio(path));
    EXPECT_EQ(back.data, sequence.data);
    EXPECT_EQ(back.orientation, sequence.orientation);
    EXPECT_EQ(back.image_type, sequence.image_type);
    EXPECT_EQ(back.fields, sequence.fields);
    ASSERT_EQ(back.frames.size(), sequence.frames.size());
    for (std::size_t i = 0; i < back.frames.size(); ++i) {
      EXPECT_EQ(back.frames[i].timestamp_s, sequence.frames[i].timestamp_s);
      EXPECT_EQ(back.frames[i].image_status, sequence.frames[i].image_status);
      EXPECT_EQ(back.frames[i].fields, sequence.frames[i].fields);
      ASSERT_EQ(back.frames[i].transforms.size(), sequence.frames[i].transforms.size());
      for (const auto& [name, transform] : sequence.frames[i].transforms) {
        EXPECT_EQ(back.frames[i].transforms.at(name).T.matrix(), transform.T.matrix());
        EXPECT_EQ(back.frames[i].transforms.at(name).status, transform.status);
      }
    }
    const auto io = itk::MetaImageIO::New();
    ASSERT_TRUE(io->CanReadFile(path.c_str()));
    io->SetFileName(path);
    io->ReadImageInformation();
    ASSERT_EQ(io->GetImageSizeInBytes(), 12);
    EXPECT_EQ(io->GetDimensions(0), 3U);
    EXPECT_EQ(io->GetDimensions(2), 2U);
    itk::ImageIORegion region(3);
    for (unsigned axis = 0; axis < 3; ++axis) region.SetSize(axis, io->GetDimensions(axis));
    io->SetIORegion(region);
    std::vector<std::uint8_t> bytes(12);
    io->Read(bytes.data());
    EXPECT_EQ(bytes, test::to_bytes(kData));
  }
}

TEST(Igsio, AFileWithTwoAxesIsWrittenWithThree) {
  const TemporaryFolder folder;
  const IgsioSequence sequence = read_sequence(
      "ObjectType = Image\nNDims = 2\nDimSize = 3 2\nOffset = 0 0\nTransformMatrix = 1 0 0 1\n"
      "ElementSpacing = 1 1\nKinds = domain domain\nElementType = MET_UCHAR\n"
      "ElementDataFile = LOCAL\nabcdef");
  const std::string path = (folder.path() / "out.mha").string();
  write_igsio(sequence, path, false);
  const auto io = itk::MetaImageIO::New();
  io->SetFileName(path);
  io->ReadImageInformation();
  ASSERT_EQ(io->GetNumberOfDimensions(), 3U);
  EXPECT_EQ(io->GetDimensions(1), 2U);
  EXPECT_EQ(io->GetDimensions(2), 1U);
  EXPECT_EQ(io->GetSpacing(1), 1.0);
}

TEST(Igsio, TurnsFramesBetweenOrientations) {
  // Rows "abc" (near) and "def" (far), columns from the marked to the other side as stored.
  IgsioSequence sequence = read_sequence(good_file());
  const auto turned = [&](const std::string& from, const std::string& to) {
    sequence.orientation = from;
    return text_of(oriented_frame(sequence, 0, to, "sweep"));
  };
  EXPECT_EQ(turned("MF", "MF"), "abcdef");
  EXPECT_EQ(turned("MFA", "UF"), "cbafed");
  EXPECT_EQ(turned("MF", "MN"), "defabc");
  EXPECT_EQ(turned("MF", "UN"), "fedcba");
  EXPECT_EQ(turned("MF", "FM"), "adbecf");  // columns become contiguous lines
  EXPECT_EQ(turned("MF", "NM"), "daebfc");
  EXPECT_EQ(turned("MF", "FU"), "cfbead");
  EXPECT_EQ(turned("FM", "MF"), "adbecf");
  EXPECT_EQ(turned("NM", "FM"), "cbafed");
  EXPECT_EQ(turned("FU", "FM"), "defabc");
  EXPECT_EQ(turned("UND", "MF"), "fedcba");
  sequence.orientation = "MF";
  const OrientedImage image = oriented_frame(sequence, 1, "FM", "sweep");
  EXPECT_EQ(image.width, 2);
  EXPECT_EQ(image.height, 3);
  EXPECT_EQ(text_of(image), "gjhkil");
  expect_input_error([&] { oriented_frame(sequence, 2, "FM", "sweep"); }, {"sweep", "2 frames"});
  expect_input_error([&] { oriented_frame(sequence, 0, "FF", "sweep"); }, {"FF"});
  sequence.orientation = "";
  expect_input_error([&] { oriented_frame(sequence, 0, "FM", "sweep"); }, {"sweep", "orientation"});
  sequence.image_type = "RF_REAL";
  expect_input_error([&] { oriented_frame(sequence, 0, "FM", "sweep"); }, {"sweep", "RF_REAL"});
}

TEST(Igsio, LinesWithPosesBecomeAPreScanVolume) {
  ProbeConfig probe;
  probe.array = LinearArray{{-1.0, 1.0}};
  probe.sampling.imaging_depth_mm = 6.0;
  const TrackedSweep sweep{{Eigen::Isometry3d::Identity(), Eigen::Isometry3d::Identity()}, {}};
  IgsioSequence sequence = read_sequence(replaced(good_file(), "MFA", "NM"));
  const PreScanVolume volume = to_prescan(sequence, probe, sweep, "sweep");
  EXPECT_EQ(volume.geometry.axial.spacing_mm, 2.0);
  EXPECT_EQ(volume.at(0, 0, 0), 'c');  // near is last in the file, first in the volume
  EXPECT_EQ(volume.at(0, 1, 1), 'l');
  sequence.orientation = "MF";
  expect_input_error([&] { to_prescan(sequence, probe, sweep, "sweep"); }, {"sweep", "MF", "FM"});
}

TEST(Igsio, NamesTheFieldThatIsWrong) {
  const auto refuse = [](const std::string& from, const std::string& to,
                         std::initializer_list<std::string> fragments) {
    SCOPED_TRACE(from + " -> " + to);
    expect_input_error([&] { read_sequence(replaced(good_file(), from, to)); }, fragments);
  };
  refuse("ObjectType = Image\n", "ObjectType = Mesh\n", {"sweep.igs.mha", "ObjectType"});
  refuse("NDims = 3", "NDims = 4", {"NDims", "4"});
  refuse("DimSize = 3 2 2", "DimSize = 3 2", {"DimSize", "3 numbers"});
  refuse("DimSize = 3 2 2", "DimSize = 3 2 x", {"DimSize", "x"});
  refuse("DimSize = 3 2 2", "DimSize = 3 2 -2", {"DimSize", "-2"});
  refuse("DimSize = 3 2 2", "DimSize = 3 2 3", {"DimSize", "18", "12"});
  refuse("DimSize = 3 2 2", "DimSize = 2147483647 2147483647 2147483647", {"DimSize", "too large"});
  refuse("DimSize = 3 2 2", "DimSize = 1 1 2147483647", {"DimSize", "2147483647", "12"});
  refuse("MET_UCHAR", "MET_FLOAT", {"ElementType", "MET_FLOAT"});
  refuse("MET_UCHAR", "MET_UCHAR\nElementNumberOfChannels = 3", {"ElementNumberOfChannels", "3"});
  refuse("BRIGHTNESS", "RGB_COLOR", {"UltrasoundImageType", "RGB_COLOR"});
  refuse("MFA", "MM", {"UltrasoundImageOrientation", "MM"});
  refuse("MFA", "MFX", {"UltrasoundImageOrientation", "MFX"});
  refuse("CompressedData = False", "CompressedData = Maybe", {"CompressedData", "Maybe"});
  refuse("0 0 1 30 0 0 0 1", "0 0 1 30 0 0 1", {"frame 0", "ProbeToTracker", "15", "16"});
  refuse("0 0 1 30 0 0 0 1", "0 0 1 30 0 0 0 2", {"frame 0", "ProbeToTracker", "last row"});
  refuse("0 0 1 30 0 0 0 1", "0 0 1 nan 0 0 0 1", {"frame 0", "ProbeToTracker", "nan", "finite"});
  refuse("Seq_Frame0001_U", "Seq_Frame0002_U", {"frame 2", "2 frames"});
  refuse("Seq_Frame0001_U", "Seq_Frame-1_U", {"frame -1"});
  refuse("Seq_Frame0001_U", "Seq_Framex_U", {"Seq_Frame", "x"});
  refuse("Seq_Frame0001_UnfilteredTimestamp", "Seq_Frame0001", {"Seq_Frame<number>_<name>"});
  refuse("Timestamp = 12.5", "Timestamp = noon", {"frame 0", "Timestamp", "noon"});
  refuse("Seq_Frame0000_ImageStatus = OK",
         "Seq_Frame0000_ImageStatus = OK\nSeq_Frame0000_ImageStatus = OK",
         {"ImageStatus", "twice"});
  refuse("Seq_Frame0001_Unfiltered", "nonsense\nSeq_Frame0001_Unfiltered", {"nonsense"});
  refuse("Seq_Frame0001_UnfilteredTimestamp", "Seq_Frame0001_StylusToTrackerTransformStatus",
         {"frame 1", "StylusToTracker"});
  refuse("CompressedData = False", "CompressedData = True", {"compressed data"});
  refuse("CompressedData = False", "CompressedData = True\nCompressedDataSize = 11",
         {"CompressedDataSize", "11", "12"});
  std::string huge = replaced(good_file(), "DimSize = 3 2 2", "DimSize = 2147483647 1000 2");
  expect_input_error(
      [&] { read_sequence(replaced(huge, "CompressedData = False", "CompressedData = True")); },
      {"cannot hold"});
  std::string big = replaced(good_file(), "DimSize = 3 2 2", "DimSize = 3 1 2");
  big = replaced(big, "OrderMSB = False", "OrderMSB = True");
  EXPECT_NO_THROW(read_sequence(
      replaced(replaced(good_file(), "OrderMSB = False", "OrderMSB = True"), "3 2 2", "3 2 2")));
  expect_input_error([&] { read_sequence(replaced(big, "MET_UCHAR", "MET_SHORT")); }, {"OrderMSB"});
}

TEST(Igsio, RefusesBrokenFiles) {
  const auto read_path = [](const std::filesystem::path& path) { read_igsio(path); };
  test::expect_refuses_broken_files(read_path, test::to_bytes(good_file()), ".igs.mha");
  const TemporaryFolder folder;
  write_igsio(read_sequence(good_file()), folder.path() / "compressed.mha", true);
  test::expect_refuses_broken_files(read_path, test::slurp(folder.path() / "compressed.mha"),
                                    ".mha");
}

TEST(Igsio, WhatCannotStandInAHeaderIsNotWritten) {
  const TemporaryFolder folder;
  IgsioSequence sequence = read_sequence(good_file());
  sequence.frames[0].fields["Note"] = "a\nElementDataFile = /etc/passwd";
  expect_input_error([&] { write_igsio(sequence, folder.path() / "out.mha", false); }, {"Note"});
  sequence = read_sequence(good_file());
  sequence.data.pop_back();
  expect_input_error([&] { write_igsio(sequence, folder.path() / "out.mha", false); },
                     {"11", "12"});
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace usct
