#include <gtest/gtest.h>

#include "core/io/example_volumes.h"
#include "core/io/expect_input_error.h"
#include "core/io/file_size_limit.h"
#include "core/io/file_text.h"
#include "core/io/itk_oracle.h"
#include "core/io/temporary_folder.h"
#include "core/io/volume_headers.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using test::expect_input_error;
using test::expect_near_grid;
using test::expect_refused;
using test::grid_of;
using test::kBigEndianVoxels;
using test::kVoxels;
using test::replaced;
using test::TemporaryFolder;
using test::write_text;

const std::string kNrrd =
    "NRRD0005\n# comment\ntype: short\ndimension: 3\nspace: right-anterior-superior\n"
    "sizes: 2 1 3\nspace directions: (0,2,0) (0,0,3) (-1,0,0)\nkinds: domain domain domain\n"
    "endian: big\nencoding: raw\nspace origin: (10,20,30)\nspace units: \"mm\" \"mm\" \"mm\"\n"
    "key:=value: with colon\n\n";
TEST(Nrrd, RasAndBigEndianAsTheFormatDefinesThem) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.nrrd";
  write_text(path, kNrrd + kBigEndianVoxels);
  const CtVolume volume = read_volume<std::int16_t>(path);
  EXPECT_EQ(volume.voxels, kVoxels);
  // Right becomes minus left, anterior minus posterior.
  EXPECT_EQ(volume.grid.origin_mm, Eigen::Vector3d(-10, -20, 30));
  EXPECT_EQ(volume.grid.spacing_mm, Eigen::Vector3d(2, 3, 1));
  EXPECT_EQ(volume.grid.physical_from_index({1, 1, 1}), Eigen::Vector3d(-9, -22, 33));
  EXPECT_EQ(test::read_by_itk(path).voxels, kVoxels);
  expect_near_grid(grid_of(test::read_by_itk(path)), volume.grid, 1e-9);
}

/// Left stays left and superior stays superior.
TEST(Nrrd, LasIsMirroredInOneAxis) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.nrrd";
  for (const char* las : {"left-anterior-superior", "LAS"}) {
    write_text(path, replaced(kNrrd, "right-anterior-superior", las) + kBigEndianVoxels);
    const CtVolume volume = read_volume<std::int16_t>(path);
    EXPECT_EQ(volume.voxels, kVoxels);
    EXPECT_EQ(volume.grid.origin_mm, Eigen::Vector3d(10, -20, 30));
    EXPECT_EQ(volume.grid.physical_from_index({1, 1, 1}), Eigen::Vector3d(9, -22, 33));
  }
}

TEST(Nrrd, DetachedDataWithBytesBefore) {
  const TemporaryFolder folder;
  const fs::path header = folder.path() / "a.nhdr";
  write_text(folder.path() / "a.bin", "123" + kBigEndianVoxels);
  for (const char* skip : {"byte skip: 3\n", "byte skip: -1\n"}) {
    write_text(header,
               replaced(kNrrd, "encoding", std::string("data file: a.bin\n") + skip + "encoding"));
    EXPECT_EQ(read_volume<std::int16_t>(header).voxels, kVoxels);
  }
  fs::remove(folder.path() / "a.bin");
  expect_input_error([&] { read_volume<std::int16_t>(header); },
                     {header.string(), "'data file'", "a.bin", "does not exist"});
}

/// As its library and ITK read it.
TEST(Nrrd, NamesOfFieldsInCapitalsAndPairsGivenAgain) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.nrrd";
  const std::string capitals =
      replaced(replaced(kNrrd, "sizes", "Sizes"), "space origin", "SPACE Origin");
  write_text(path, replaced(capitals, "key:=", "key:=value: with colon\nKey:=2\nkey:=") +
                       kBigEndianVoxels);
  EXPECT_EQ(read_volume<std::int16_t>(path).voxels, kVoxels);
  EXPECT_EQ(test::read_by_itk(path).voxels, kVoxels);
}

TEST(Nrrd, NamesWhatIsWrongInTheHeader) {
  const TemporaryFolder folder;
  expect_refused(
      folder.path() / "a.nrrd", kNrrd, kBigEndianVoxels,
      {{"NRRD0005", "NRRD0009", {"NRRD0009"}},
       {"dimension: 3", "dimension: 4", {"'dimension'", "4", "3"}},
       {"sizes: 2 1 3", "sizes: 2 1", {"'sizes'", "3 numbers"}},
       {"sizes: 2 1 3", "sizes: 2 0 3", {"size", "2 0 3", ">= 1"}},
       {"sizes: 2 1 3", "sizes: 2 1 4", {"'sizes'", "16 bytes", "12"}},
       {"sizes: 2 1 3", "sizes: 2 1 2", {"'sizes'", "8 bytes", "12"}},
       {"sizes: 2 1 3", "sizes: 2000000000 2000000000 2000000000", {"size"}},
       {"sizes: 2 1 3", "sizes: 2 1 99999999999", {"'sizes'", "99999999999"}},
       {"type: short", "type: block", {"'type'", "block"}},
       {"type: short", "type: short\nold min: -1024", {"'old min'", "-1024", "absent"}},
       {"type: short", "type: short\noldmax: 64511", {"'oldmax'", "64511", "absent"}},
       {"encoding: raw", "encoding: bzip2", {"'encoding'", "bzip2"}},
       {"encoding: raw", "encoding: gzip", {"damaged"}},
       {"encoding: raw", "encoding: gzip\nbyte skip: 3", {"'byte skip'", "compressed"}},
       {"endian: big\n", "", {"'endian'", "missing"}},
       {"space: right-anterior-superior\n", "", {"'space'", "missing"}},
       {"right-anterior-superior", "scanner-xyz", {"'space'", "scanner-xyz"}},
       {"space origin: (10,20,30)\n", "", {"'space origin'", "missing"}},
       {"(10,20,30)", "(10,20)", {"'space origin'"}},
       {"(10,20,30)", "(10,20,nan)", {"'space origin'", "nan"}},
       {"space directions: (0,2,0) (0,0,3) (-1,0,0)\n", "", {"'space directions'", "missing"}},
       {"(0,2,0)", "none", {"'space directions'", "none"}},
       {"(0,2,0)", "(0,nan,0)", {"'space directions'", "nan"}},
       {"(0,2,0)", "(0,0,0)", {"'space directions'", "> 0"}},
       {"(0,2,0)", "(0,2,0.2)", {"'space directions'", "90", "sheared"}},
       {"kinds: domain", "kinds: vector", {"'kinds'", "vector"}},
       {"\"mm\" \"mm\"", "\"mm\" \"um\"", {"'space units'", "um"}},
       {"endian: big", "endian: big\nEndian: little", {"'Endian'", "twice"}},
       {"key:=", "key:=other\nkey:=", {"'key'", "twice"}},
       {"# comment", "no colon", {"no colon"}}});
}

const std::string kMeta =
    "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = True\n"
    "CompressedData = False\nTransformMatrix = 0 1 0 0 0 1 1 0 0\nOffset = 10 20 30\n"
    "ElementSpacing = 2 3 1\nDimSize = 2 1 3\nElementType = MET_SHORT\nElementDataFile = LOCAL\n";

TEST(MetaImage, MatrixHoldsOneDirectionAfterTheOther) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.mha";
  write_text(path, kMeta + kBigEndianVoxels);
  const CtVolume volume = read_volume<std::int16_t>(path);
  EXPECT_EQ(volume.voxels, kVoxels);
  EXPECT_EQ(volume.grid.physical_from_index({1, 0, 0}), Eigen::Vector3d(10, 22, 30));
  EXPECT_EQ(volume.grid.physical_from_index({0, 1, 0}), Eigen::Vector3d(10, 20, 33));
  EXPECT_EQ(volume.grid.physical_from_index({0, 0, 1}), Eigen::Vector3d(11, 20, 30));
  expect_near_grid(grid_of(test::read_by_itk(path)), volume.grid, 1e-9);
}

/// A header that anyone may have written must not make the reader open other files.
TEST(VolumeHeader, NamesDataFilesInItsFolderOnly) {
  const TemporaryFolder folder;
  const fs::path inside = folder.path() / "inside";
  fs::create_directory(inside);
  write_text(folder.path() / "outside.raw", kBigEndianVoxels);
  write_text(inside / "voxels.raw", kBigEndianVoxels);
  fs::create_symlink(folder.path() / "outside.raw", inside / "link.raw");
  fs::create_symlink("voxels.raw", inside / "near.raw");
  const auto read = [&](const std::string& header, const std::string& name) {
    write_text(inside / name, header);
    return read_volume<std::int16_t>(inside / name);
  };
  const auto nrrd = [](const std::string& file) {
    return replaced(kNrrd, "encoding", "data file: " + file + "\nencoding");
  };
  const auto meta = [](const std::string& file) { return replaced(kMeta, "LOCAL", file); };
  for (const std::string file : {"voxels.raw", "./voxels.raw", "near.raw"}) {
    EXPECT_NO_THROW(read(nrrd(file), "a.nrrd")) << file;
    EXPECT_NO_THROW(read(meta(file), "a.mhd")) << file;
  }
  for (const std::string& file : {std::string("../outside.raw"), std::string("link.raw"),
                                  (folder.path() / "outside.raw").string()})
    for (const std::string name : {"a.nrrd", "a.nhdr", "a.mha", "a.mhd"}) {
      const bool is_nrrd = name[2] == 'n';
      test::expect_input_error(
          [&] { read(is_nrrd ? nrrd(file) : meta(file), name); },
          {is_nrrd ? "'data file'" : "'ElementDataFile'", file, "same folder"});
    }
}

TEST(MetaImage, NamesWhatIsWrongInTheHeader) {
  const TemporaryFolder folder;
  expect_refused(
      folder.path() / "a.mha", kMeta, kBigEndianVoxels,
      {{"ObjectType = Image", "ObjectType = Mesh", {"'ObjectType'", "Mesh"}},
       {"NDims = 3", "NDims = 2", {"'NDims'", "2"}},
       {"DimSize = 2 1 3", "DimSize = 2 1 -3", {"size", "-3", ">= 1"}},
       {"DimSize = 2 1 3", "DimSize = 60000 60000 60000", {"'DimSize'", "must be the same"}},
       {"ElementSpacing = 2 3 1\n", "", {"'ElementSpacing'", "missing"}},
       {"ElementSpacing = 2 3 1", "ElementSpacing = 2 nan 1", {"'ElementSpacing'", "nan"}},
       {"ElementSpacing = 2 3 1", "ElementSpacing = 2 -3 1", {"'ElementSpacing'", "> 0"}},
       {"TransformMatrix = 0 1 0 0 0 1 1 0 0\n", "", {"'TransformMatrix'", "missing"}},
       {"0 1 0 0 0 1 1 0 0", "0 1 0 0 0 1 1 0.1 0", {"'TransformMatrix'"}},
       {"0 1 0 0 0 1 1 0 0", "0 1 0 0 0 1 1 0", {"'TransformMatrix'", "9 numbers"}},
       {"0 1 0 0 0 1 1 0 0", "0 2 0 0 0 1 1 0 0", {"'TransformMatrix'", "unit vectors"}},
       {"NDims = 3", "NDims = 3\nDistanceUnits = cm", {"'DistanceUnits'", "cm", "mm"}},
       {"NDims = 3", "NDims = 3\nHeaderSize = 400", {"'HeaderSize'", "400"}},
       {"Offset = 10 20 30\n", "", {"'Offset'", "missing"}},
       {"MET_SHORT",
        "MET_LONG",
        {"'ElementType' is 'MET_LONG'", "MET_INT", "MET_LONG_LONG", "MET_FLOAT"}},
       {"NDims = 3",
        "NDims = 3\nElementToIntensityFunctionSlope = 2.0",
        {"FunctionSlope' is '2.0'", "1"}},
       {"NDims = 3",
        "NDims = 3\nElementToIntensityFunctionOffset = -1024",
        {"FunctionOffset'", "0"}},
       {"BinaryDataByteOrderMSB = True\n", "", {"'BinaryDataByteOrderMSB'", "missing"}},
       {"BinaryData = True", "BinaryData = False", {"'BinaryData'"}},
       {"CompressedData = False", "CompressedData = True", {"damaged"}},
       {"NDims = 3", "NDims = 3\nElementNumberOfChannels = 3", {"'ElementNumberOfChannels'"}},
       {"ElementDataFile = LOCAL",
        "ElementDataFile = gone.raw",
        {"'ElementDataFile'", "gone.raw", "does not exist"}},
       {"ElementDataFile = LOCAL", "ElementDataFile = LIST", {"'ElementDataFile'", "LIST"}},
       {"ElementDataFile = LOCAL\n", "", {"must be 'Field = value'"}}});
}

TEST(MetaImage, AFieldThatIsGivenTwiceMustAgree) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.mha";
  const std::string twice = replaced(kMeta, "ElementType", "Position = 10 20 30\nElementType");
  write_text(path, twice + kBigEndianVoxels);
  EXPECT_NO_THROW(read_volume<std::int16_t>(path));
  write_text(path, replaced(twice, "Position = 10 20 30", "Position = 1 2 3") + kBigEndianVoxels);
  expect_input_error([&] { read_volume<std::int16_t>(path); },
                     {path.string(), "'Position' is '1 2 3'", "'Offset'", "10 20 30"});
}

TEST(MetaImage, AScaleOfOneIsNoneInAnySpelling) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.mha";
  write_text(path, replaced(kMeta, "NDims = 3",
                            "NDims = 3\nElementToIntensityFunctionSlope = 1.0\n"
                            "ElementToIntensityFunctionOffset = -0.0") +
                       kBigEndianVoxels);
  EXPECT_EQ(read_volume<std::int16_t>(path).voxels, kVoxels);
}

/// Its new header had stood beside the voxels of the old one.
TEST(MetaImage, ALinkIsFollowedToHeaderAndVoxels) {
  const TemporaryFolder folder;
  fs::create_directory(folder.path() / "store");
  fs::create_directory(folder.path() / "case");
  const CtVolume old = test::sampled(test::example_grids().front().grid);
  CtVolume volume = old;
  for (std::int16_t& voxel : volume.voxels) voxel = static_cast<std::int16_t>(voxel + 1);
  write_volume(old, folder.path() / "store" / "there.mhd");
  for (const std::string name : {"there.mhd", "new.mhd"}) {
    SCOPED_TRACE(name);
    const fs::path link = folder.path() / "case" / name;
    fs::create_symlink(fs::path("../store") / name, link);
    write_volume(volume, link);
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_EQ(read_volume<std::int16_t>(folder.path() / "store" / name).voxels, volume.voxels);
    EXPECT_EQ(read_volume<std::int16_t>(link).voxels, volume.voxels);
    EXPECT_FALSE(fs::exists(fs::path(link).replace_extension(".raw")));
  }
}

TEST(MetaImage, NamesThatAHeaderCannotHoldAreNotWritten) {
  const TemporaryFolder folder;
  const CtVolume volume = test::sampled(test::example_grids().front().grid);
  for (const char* name : {"a%d.mhd", " a.mhd", "a\nb.mhd", "LIST.mhd"})
    expect_input_error([&] { write_volume(volume, folder.path() / name); },
                       {folder.path().string(), "name", ".mha"});
  EXPECT_TRUE(fs::is_empty(folder.path()));
  for (const char* name : {"a%d.mha", " a.mha", "a b.mhd", "LOCAL.mhd"}) {
    write_volume(volume, folder.path() / name);
    EXPECT_EQ(read_volume<std::int16_t>(folder.path() / name).voxels, volume.voxels) << name;
  }
}

TEST(MetaImage, AFullDiskLeavesTheOldHeaderAndVoxels) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.mhd";
  const CtVolume volume = test::sampled(test::example_grids().front().grid);
  write_volume(volume, path);
  CtVolume larger = volume;
  larger.grid.size = {100, 100, 1};
  larger.voxels.resize(10000);
  // The header has some hundred bytes.
  for (const auto& [limit, written] :
       {std::pair<rlim_t, const char*>{100, "a.mhd"}, {1000, "a.raw"}}) {
    try {
      const test::FileSizeLimit full(limit);
      write_volume(larger, path);
      ADD_FAILURE() << "no error was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_EQ(error.what(),
                (folder.path() / written).string() + ": writing failed: File too large");
    }
    EXPECT_EQ(read_volume<std::int16_t>(path).voxels, volume.voxels);
  }
}

/// The voxels of another volume may be those of the one that is converted.
TEST(MetaImage, VoxelsOfAnotherHeaderAreNotReplaced) {
  const TemporaryFolder folder;
  const fs::path own = folder.path() / "a.mhd";
  const fs::path data = folder.path() / "a.raw";
  const CtVolume volume = test::sampled(test::example_grids().front().grid);
  write_volume(volume, own);
  EXPECT_NO_THROW(write_volume(volume, own));  // its own may be
  const std::string before = test::read_text(data);
  fs::remove(own);
  expect_input_error([&] { write_volume(volume, own); }, {data.string(), "exists", own.string()});
  EXPECT_EQ(test::read_text(data), before);
  EXPECT_FALSE(fs::exists(own));
}

TEST(MetaImage, ATargetThatCannotBeWrittenLeavesNothing) {
  const TemporaryFolder folder;
  fs::create_directory(folder.path() / "a.mhd");
  expect_input_error(
      [&] {
        write_volume(test::sampled(test::example_grids().front().grid), folder.path() / "a.mhd");
      },
      {"a.mhd", "is a folder"});
  EXPECT_FALSE(fs::exists(folder.path() / "a.raw"));
}

TEST(MetaImage, HeaderIsNotThereWithoutItsVoxels) {
  const TemporaryFolder folder;
  const fs::path header = folder.path() / "a.mhd";
  fs::create_directory(folder.path() / "a.raw");  // in the way
  expect_input_error([&] { write_volume(test::sampled(test::example_grids()[0].grid), header); },
                     {"a.raw"});
  EXPECT_FALSE(fs::exists(header));
}

}  // namespace
}  // namespace usct
