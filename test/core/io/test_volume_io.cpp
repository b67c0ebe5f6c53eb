#include <gtest/gtest.h>
#include <zlib.h>

#include <fstream>
#include <iterator>
#include <random>

#include "core/io/example_volumes.h"
#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/itk_oracle.h"
#include "core/io/temporary_folder.h"
#include "core/io/without_permission.h"
#include "test_data.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using test::expect_input_error;
using test::read_text;
using test::TemporaryFolder;
using test::write_text;

/// What NIfTI's 32-bit numbers allow is looser.
double tolerance_mm(const std::string& extension) {
  return extension.substr(0, 4) == ".nii" ? 1e-3 : 1e-9;
}

void expect_near_grid(const Grid& grid, const Grid& expected, double tolerance) {
  EXPECT_EQ(grid.size, expected.size);
  // Compared where it matters: at the corners of the volume.
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d index = Eigen::Vector3d(corner & 1, (corner >> 1) & 1, corner >> 2)
                                      .cwiseProduct(expected.size.cast<double>());
    EXPECT_LT((grid.physical_from_index(index) - expected.physical_from_index(index)).norm(),
              tolerance);
  }
}

test::ItkImage itk_image(const CtVolume& volume) {
  test::ItkImage image;
  const Grid& grid = volume.grid;
  image.size.assign(grid.size.data(), grid.size.data() + 3);
  image.spacing.assign(grid.spacing_mm.data(), grid.spacing_mm.data() + 3);
  image.origin.assign(grid.origin_mm.data(), grid.origin_mm.data() + 3);
  image.direction.assign(grid.direction.data(), grid.direction.data() + 9);
  image.voxels.assign(volume.voxels.begin(), volume.voxels.end());
  return image;
}

Grid grid_of(const test::ItkImage& image) {
  Grid grid;
  grid.size = Eigen::Map<const Eigen::Vector3i>(image.size.data());
  grid.spacing_mm = Eigen::Map<const Eigen::Vector3d>(image.spacing.data());
  grid.origin_mm = Eigen::Map<const Eigen::Vector3d>(image.origin.data());
  grid.direction = Eigen::Map<const Eigen::Matrix3d>(image.direction.data());
  return grid;
}

class VolumeFormats : public testing::TestWithParam<const char*> {
 protected:
  const std::string extension_ = GetParam();
  const TemporaryFolder folder_;
  const fs::path path_ = folder_.path() / ("ct" + extension_);
};

/// Of these, the formats that ITK compresses.
class CompressedVolumeFormats : public VolumeFormats {};

TEST_P(VolumeFormats, KeepPositionsAndValuesForAnyAxes) {
  for (const auto& [name, grid] : test::example_grids()) {
    SCOPED_TRACE(name);
    const CtVolume written = test::sampled(grid);
    write_volume(written, path_);
    const CtVolume volume = read_volume<std::int16_t>(path_);
    expect_near_grid(volume.grid, grid, tolerance_mm(extension_));
    EXPECT_EQ(volume.voxels, written.voxels);
    const VolumeInfo info = read_volume_info(path_);
    EXPECT_EQ(info.component, "int16");
    EXPECT_TRUE(same_grid(info.grid, volume.grid));
    EXPECT_EQ(info.compressed, extension_ == ".nii.gz");
    EXPECT_TRUE(info.warnings.empty());
  }
}

TEST_P(VolumeFormats, ItkReadsTheSameFromOurFiles) {
  for (const auto& [name, grid] : test::example_grids()) {
    SCOPED_TRACE(name);
    const CtVolume written = test::sampled(grid);
    write_volume(written, path_);
    const test::ItkImage image = test::read_by_itk(path_);
    expect_near_grid(grid_of(image), grid, tolerance_mm(extension_));
    EXPECT_EQ(image.voxels, written.voxels);
  }
}

TEST_P(VolumeFormats, ReadWhatItkWrites) {
  for (const auto& [name, grid] : test::example_grids())
    for (const bool compressed : {false, true}) {
      SCOPED_TRACE(name + (compressed ? ", compressed" : ""));
      const CtVolume written = test::sampled(grid);
      test::write_by_itk(itk_image(written), path_, compressed);
      const CtVolume volume = read_volume<std::int16_t>(path_);
      // ITK writes MetaImage with six digits.
      expect_near_grid(volume.grid, grid, extension_[1] == 'm' ? 2e-3 : tolerance_mm(extension_));
      EXPECT_EQ(volume.voxels, written.voxels);
    }
}

TEST_P(VolumeFormats, KeepEveryTypeOfVoxel) {
  Grid grid;
  grid.size = {2, 1, 1};
  const auto round_trip = [&](auto low, auto high) {
    Volume<decltype(low)> volume(grid);
    volume.voxels = {low, high};
    write_volume(volume, path_);
    EXPECT_EQ(read_volume<decltype(low)>(path_).voxels, volume.voxels);
  };
  round_trip(std::uint8_t{0}, std::uint8_t{255});
  round_trip(std::int16_t{-32768}, std::int16_t{32767});
  round_trip(std::uint16_t{0}, std::uint16_t{65535});
  round_trip(-1.5e30F, 0.1F);
}

TEST_P(VolumeFormats, TruncatedAnywhereIsRefused) {
  write_volume(test::sampled(test::example_grids().back().grid), path_);
  const fs::path cut_file =
      extension_ == ".mhd" ? fs::path(path_).replace_extension(".raw") : path_;
  const std::string whole = read_text(cut_file);
  for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
    write_text(cut_file, whole.substr(0, bytes));
    EXPECT_THROW(read_volume<std::int16_t>(path_), InputError) << "cut to " << bytes;
  }
}

TEST_P(VolumeFormats, DamagedBytesNeverDoWorseThanAnInputError) {
  write_volume(test::sampled(test::example_grids().back().grid), path_);
  const std::string whole = read_text(path_);
  std::mt19937 random(17);
  int refused = 0;
  for (int round = 0; round < 1000; ++round) {
    std::string damaged = whole;
    for (int flips = 0; flips < 1 + round % 4; ++flips)
      damaged[random() % damaged.size()] = static_cast<char>(random());
    write_text(path_, damaged);
    try {
      const CtVolume volume = read_volume<std::int16_t>(path_);
      volume.grid.validate("read");
    } catch (const InputError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 100);
}

TEST_P(CompressedVolumeFormats, DamagedDataAreRefusedOrHarmless) {
  const CtVolume written = test::sampled(test::example_grids()[0].grid);
  test::write_by_itk(itk_image(written), path_, true);
  const std::string whole = read_text(path_);
  int refused = 0;
  for (std::size_t from_end = 1; from_end <= 120; ++from_end) {  // within the compressed stream
    std::string damaged = whole;
    char& byte = damaged[damaged.size() - from_end];
    byte = static_cast<char>(byte ^ 0x10);
    write_text(path_, damaged);
    try {
      EXPECT_EQ(read_volume<std::int16_t>(path_).voxels, written.voxels) << from_end;
    } catch (const InputError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 100);
}

TEST_P(VolumeFormats, RefuseWhatIsNotAFileThatCanBeRead) {
  const auto read = [&] { read_volume<std::int16_t>(path_); };
  const std::string name = path_.string();
  expect_input_error(read, {name, "does not exist"});
  write_text(path_, "");
  expect_input_error(read, {name, "is empty"});
  write_text(path_, "GIF89a, to be sure, and a little longer than the shortest header: " +
                        std::string(400, 'x'));
  expect_input_error(read, {name});
  fs::remove(path_);
  fs::create_directory(path_);
  expect_input_error(read, {name, "is a folder"});
}

TEST_P(VolumeFormats, RefuseToReadWithoutPermission) {
  write_volume(test::sampled(test::example_grids()[0].grid), path_);
  const test::WithoutPermission lock(path_);
  expect_input_error([&] { read_volume<std::int16_t>(path_); },
                     {path_.string(), "Permission denied"});
}

TEST_P(VolumeFormats, RefuseToWriteWhatIsNoVolume) {
  CtVolume volume = test::sampled(test::example_grids()[0].grid);
  volume.voxels.pop_back();
  expect_input_error([&] { write_volume(volume, path_); }, {path_.string(), "140"});
  volume = test::sampled(test::example_grids()[0].grid);
  volume.grid.spacing_mm.x() = 0.0;
  expect_input_error([&] { write_volume(volume, path_); }, {path_.string(), "spacing"});
  EXPECT_TRUE(fs::is_empty(folder_.path()));
}

INSTANTIATE_TEST_SUITE_P(All, VolumeFormats,
                         testing::Values(".nrrd", ".mha", ".mhd", ".nii", ".nii.gz"));

INSTANTIATE_TEST_SUITE_P(All, CompressedVolumeFormats, testing::Values(".nrrd", ".mha", ".nii.gz"));

TEST(VolumeIo, UnknownExtensionIsRefused) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "ct.tiff";
  write_text(path, "x");
  expect_input_error([&] { read_volume<float>(path); }, {path.string(), ".tiff", ".nrrd"});
  expect_input_error([&] { write_volume(Volume<float>(test::example_grids()[0].grid), path); },
                     {path.string(), ".tiff"});
  EXPECT_FALSE(has_volume_extension(path));
  EXPECT_TRUE(has_volume_extension("CT.NII.GZ"));
  EXPECT_FALSE(has_volume_extension(".nrrd"));
}

/// One header with one thing changed, and what the message must name.
struct BadHeader {
  std::string from, to;
  std::vector<std::string> named;
};

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

void expect_refused(const fs::path& path, const std::string& header, const std::string& voxels,
                    const std::vector<BadHeader>& cases) {
  write_text(path, header + voxels);
  read_volume<std::int16_t>(path);  // does not throw
  for (const BadHeader& bad : cases) {
    SCOPED_TRACE(bad.from + " -> " + bad.to);
    write_text(path, replaced(header, bad.from, bad.to) + voxels);
    std::vector<std::string> named = bad.named;
    named.push_back(path.string());
    expect_input_error([&] { read_volume<std::int16_t>(path); }, named);
  }
}

const std::string kNrrd =
    "NRRD0005\n# comment\ntype: short\ndimension: 3\nspace: right-anterior-superior\n"
    "sizes: 2 1 3\nspace directions: (0,2,0) (0,0,3) (-1,0,0)\nkinds: domain domain domain\n"
    "endian: big\nencoding: raw\nspace origin: (10,20,30)\nspace units: \"mm\" \"mm\" \"mm\"\n"
    "key:=value: with colon\n\n";
const std::string kBigEndianVoxels("\x00\x01\xFF\xFE\x00\x03\x00\x04\x00\x05\x01\x00", 12);
const std::vector<std::int16_t> kVoxels{1, -2, 3, 4, 5, 256};

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
  expect_input_error([&] { read_volume<std::int16_t>(header); }, {"a.bin", "does not exist"});
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
       {"encoding: raw", "encoding: bzip2", {"'encoding'", "bzip2"}},
       {"encoding: raw", "encoding: gzip", {"damaged"}},
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
       {"endian: big", "endian: big\nendian: little", {"'endian'", "twice"}},
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
       {"Offset = 10 20 30\n", "", {"'Offset'", "missing"}},
       {"MET_SHORT", "MET_LONG", {"'ElementType'", "MET_LONG"}},
       {"BinaryDataByteOrderMSB = True\n", "", {"'BinaryDataByteOrderMSB'", "missing"}},
       {"BinaryData = True", "BinaryData = False", {"'BinaryData'"}},
       {"CompressedData = False", "CompressedData = True", {"damaged"}},
       {"NDims = 3", "NDims = 3\nElementNumberOfChannels = 3", {"'ElementNumberOfChannels'"}},
       {"ElementDataFile = LOCAL", "ElementDataFile = gone.raw", {"gone.raw", "does not exist"}},
       {"ElementDataFile = LOCAL", "ElementDataFile = LIST", {"'ElementDataFile'", "LIST"}},
       {"ElementDataFile = LOCAL\n", "", {"must be 'Field = value'"}}});
}

TEST(MetaImage, HeaderIsNotThereWithoutItsVoxels) {
  const TemporaryFolder folder;
  const fs::path header = folder.path() / "a.mhd";
  fs::create_directory(folder.path() / "a.raw");  // in the way
  expect_input_error([&] { write_volume(test::sampled(test::example_grids()[0].grid), header); },
                     {"a.raw"});
  EXPECT_FALSE(fs::exists(header));
}

/// A NIfTI header of 2 x 1 x 3 int16 voxels, by the offsets of nifti1.h.
class NiftiFile {
 public:
  NiftiFile() {
    put(0, std::int32_t{348});
    const std::int16_t dim[8] = {3, 2, 1, 3, 1, 1, 1, 1};
    for (std::size_t i = 0; i < 8; ++i) put(40 + 2 * i, dim[i]);
    put(70, std::int16_t{4});
    put(72, std::int16_t{16});
    const float pixdim[4] = {1, 2, 3, 1};
    for (std::size_t i = 0; i < 4; ++i) put(76 + 4 * i, pixdim[i]);
    put(108, 352.0F);
    put(123, std::uint8_t{2});
    put(254, std::int16_t{2});
    const float srow[12] = {0, 0, -1, 10, 2, 0, 0, 20, 0, 3, 0, 30};
    for (std::size_t i = 0; i < 12; ++i) put(280 + 4 * i, srow[i]);
    bytes_.replace(344, 4, std::string("n+1\0", 4));
  }

  template <typename T>
  NiftiFile& put(std::size_t offset, T value) {
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    if (big_endian_) std::reverse(raw, raw + sizeof(T));
    bytes_.replace(offset, sizeof(T), raw, sizeof(T));
    return *this;
  }

  std::string with_voxels() const {
    std::string voxels(12, '\0');
    std::memcpy(voxels.data(), kVoxels.data(), 12);
    return bytes_ + voxels;
  }
  std::string bytes_ = std::string(352, '\0');
  bool big_endian_ = false;
};

class Nifti : public testing::Test {
 protected:
  CtVolume read(const NiftiFile& file) {
    write_text(path_, file.with_voxels());
    return read_volume<std::int16_t>(path_);
  }
  void expect_refused(const NiftiFile& file, std::vector<std::string> named) {
    named.push_back(path_.string());
    expect_input_error([&] { read(file); }, named);
  }

  const TemporaryFolder folder_;
  const fs::path path_ = folder_.path() / "a.nii";
};

TEST_F(Nifti, SformInRasBecomesLps) {
  const CtVolume volume = read(NiftiFile());
  EXPECT_EQ(volume.voxels, kVoxels);
  EXPECT_EQ(volume.grid.origin_mm, Eigen::Vector3d(-10, -20, 30));
  EXPECT_EQ(volume.grid.physical_from_index({1, 1, 1}), Eigen::Vector3d(-9, -22, 33));
  expect_near_grid(grid_of(test::read_by_itk(path_)), volume.grid, 1e-5);
}

/// The quaternion 1/2 (1, i, j, k) turns x to y, y to z, z to x.
NiftiFile qform_file() {
  NiftiFile file;
  file.put(254, std::int16_t{0}).put(252, std::int16_t{1});
  for (std::size_t i = 0; i < 3; ++i) file.put(256 + 4 * i, 0.5F);
  file.put(268, 10.0F).put(272, 20.0F).put(276, 30.0F);
  return file;
}

TEST_F(Nifti, QformWithEitherHandedness) {
  EXPECT_LT((read(qform_file()).grid.physical_from_index({1, 1, 1}) - Eigen::Vector3d(-11, -22, 33))
                .norm(),
            1e-6);
  const CtVolume flipped = read(qform_file().put(76, -1.0F));
  EXPECT_LT((flipped.grid.physical_from_index({1, 1, 1}) - Eigen::Vector3d(-9, -22, 33)).norm(),
            1e-6);
  expect_near_grid(grid_of(test::read_by_itk(path_)), flipped.grid, 1e-5);
}

TEST_F(Nifti, FormsThatAgreeAreReadAndOthersRefused) {
  NiftiFile both = qform_file().put(76, -1.0F).put(254, std::int16_t{1});
  EXPECT_EQ(read(both).grid.origin_mm, Eigen::Vector3d(-10, -20, 30));
  expect_refused(both.put(268, 11.0F), {"qform", "sform", "1 mm apart"});
}

TEST_F(Nifti, UnitsOfLength) {
  EXPECT_LT((read(NiftiFile().put(123, std::uint8_t{3})).grid.origin_mm -
             Eigen::Vector3d(-0.010, -0.020, 0.030))
                .norm(),
            1e-12);
  read(NiftiFile().put(123, std::uint8_t{0}));
  EXPECT_EQ(read_volume_info(path_).warnings.size(), 1U);
  expect_refused(NiftiFile().put(123, std::uint8_t{5}), {"'xyzt_units'", "5"});
}

TEST_F(Nifti, ScaledValues) {
  NiftiFile file = NiftiFile().put(112, 0.5F).put(116, -1024.0F);
  write_text(path_, file.with_voxels());
  EXPECT_EQ(read_volume<float>(path_).voxels,
            (std::vector<float>{-1023.5F, -1025.0F, -1022.5F, -1022.0F, -1021.5F, -896.0F}));
  EXPECT_EQ(read_volume<std::int16_t>(path_).voxels.back(), -896);
  EXPECT_EQ(read_volume_info(path_).scale, 0.5);
}

TEST_F(Nifti, NamesWhatIsWrongInTheHeader) {
  expect_refused(NiftiFile().put(0, std::int32_t{540}), {"NIfTI-2"});
  expect_refused(NiftiFile().put(0, std::int32_t{17}), {"'sizeof_hdr'", "17"});
  expect_refused(NiftiFile().put(344, std::int32_t{0}), {"'magic'"});
  expect_refused(NiftiFile().put(344, std::uint8_t{'n'}).put(345, std::uint8_t{'i'}), {"pair"});
  expect_refused(NiftiFile().put(40, std::int16_t{2}), {"'dim[0]'", "2"});
  expect_refused(NiftiFile().put(40, std::int16_t{4}).put(48, std::int16_t{2}), {"'dim[4]'", "2"});
  expect_refused(NiftiFile().put(42, std::int16_t{-2}), {"'dim'", "-2"});
  expect_refused(NiftiFile().put(42, std::int16_t{30000}), {"'dim'", "must be the same"});
  expect_refused(NiftiFile().put(70, std::int16_t{128}), {"'datatype'", "128"});
  expect_refused(NiftiFile().put(108, 0.0F), {"'vox_offset'", ">= 352"});
  expect_refused(NiftiFile().put(108, 1e30F), {"'vox_offset'", "<= 2^31"});
  expect_refused(NiftiFile().put(108, NAN), {"'vox_offset'", "nan"});
  expect_refused(NiftiFile().put(112, NAN), {"'scl_slope'", "nan"});
  expect_refused(NiftiFile().put(254, std::int16_t{0}), {"'qform_code'", "both 0"});
  expect_refused(NiftiFile().put(280, NAN), {"'srow'", "nan"});
  expect_refused(NiftiFile().put(280, 0.3F), {"sheared"});
  expect_refused(NiftiFile().put(288, 0.0F), {"spacing", "> 0"});
  expect_refused(qform_file().put(80, 0.0F), {"'pixdim'", "> 0"});
  expect_refused(qform_file().put(256, 1.0F), {"'quatern_b/c/d'"});
  read(NiftiFile().put(40, std::int16_t{4}));  // a fourth axis of size 1 is fine
}

TEST_F(Nifti, BigEndianHeaderAndVoxels) {
  NiftiFile file;
  const std::string little = file.bytes_;
  file.big_endian_ = true;
  file.put(0, std::int32_t{348});
  for (std::size_t i = 40; i < 76; i += 2) {
    std::int16_t value;
    std::memcpy(&value, &little[i], 2);
    file.put(i, value);
  }
  for (std::size_t i :
       {76, 80, 84, 88, 108, 280, 284, 288, 292, 296, 300, 304, 308, 312, 316, 320, 324}) {
    float value;
    std::memcpy(&value, &little[i], 4);
    file.put(i, value);
  }
  file.put(254, std::int16_t{2});
  write_text(path_, file.bytes_ + kBigEndianVoxels);
  const CtVolume volume = read_volume<std::int16_t>(path_);
  EXPECT_EQ(volume.voxels, kVoxels);
  EXPECT_EQ(volume.grid.physical_from_index({1, 1, 1}), Eigen::Vector3d(-9, -22, 33));
}

TEST(VolumeConversion, NothingIsCutOffInSilence) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.nrrd";
  Grid grid;
  grid.size = {3, 1, 1};
  Volume<float> volume(grid);
  const auto put_values = [&](std::vector<float> values) {
    volume.voxels = std::move(values);
    write_volume(volume, path);
  };
  put_values({-1024.4F, 0.5F, 3071.6F});
  EXPECT_EQ(read_volume<std::int16_t>(path).voxels, (std::vector<std::int16_t>{-1024, 0, 3072}));
  expect_input_error([&] { read_volume<std::uint16_t>(path); },
                     {path.string(), "-1024.4 to 3071.6", "65535"});
  put_values({0.0F, 0.5F, 2.0F});
  expect_input_error([&] { read_volume<std::uint8_t>(path); }, {path.string(), "fractions"});
  put_values({0.0F, NAN, 2.0F});
  expect_input_error([&] { read_volume<std::int16_t>(path); }, {path.string(), "NaN"});
  put_values({0.0F, 40000.0F, 2.0F});
  expect_input_error([&] { read_volume<std::int16_t>(path); }, {path.string(), "0 to 40000"});
  put_values({0.0F, INFINITY, 2.0F});
  expect_input_error([&] { read_volume<std::int16_t>(path); }, {path.string(), "inf"});
}

TEST(VolumeRealData, CtHeaderAgreesWithItsRawBytes) {
  const fs::path path = test::data_root() / "totalseg_ct" / "example_ct.nii.gz";
  USCT_REQUIRE_DATA(path);
  char header[352];
  const gzFile file = gzopen(path.c_str(), "rb");
  ASSERT_EQ(gzread(file, header, sizeof(header)), 352);
  float srow[12];
  std::memcpy(srow, header + 280, sizeof(srow));
  std::int32_t first_voxels[200];  // datatype 8
  ASSERT_EQ(gzread(file, first_voxels, sizeof(first_voxels)), 800);
  gzclose(file);

  const CtVolume volume = read_volume<std::int16_t>(path);
  EXPECT_EQ(volume.grid.size, Eigen::Vector3i(122, 101, 112));
  for (int axis = 0; axis < 3; ++axis) {
    const double sign = axis < 2 ? -1.0 : 1.0;
    Eigen::Vector3d index(7, 11, 13);
    const double expected = srow[4 * axis] * index.x() + srow[4 * axis + 1] * index.y() +
                            srow[4 * axis + 2] * index.z() + srow[4 * axis + 3];
    EXPECT_NEAR(volume.grid.physical_from_index(index)(axis), sign * expected, 1e-4);
  }
  for (std::size_t i = 0; i < 200; ++i) EXPECT_EQ(volume.voxels[i], first_voxels[i]);
}

TEST(VolumeRealData, KidneyMasksHaveTheirVolumesAndSides) {
  const fs::path folder = test::data_root() / "totalseg_ct";
  USCT_REQUIRE_DATA(folder);
  const auto measure = [&](const char* side, Eigen::Vector3d* centre_mm) {
    const auto mask =
        read_volume<std::uint8_t>(folder / (std::string("example_ct_kidney_") + side + ".nii.gz"));
    double voxels = 0.0;
    centre_mm->setZero();
    for (int k = 0; k < mask.grid.size.z(); ++k)
      for (int j = 0; j < mask.grid.size.y(); ++j)
        for (int i = 0; i < mask.grid.size.x(); ++i)
          if (mask.at(i, j, k) != 0) {
            voxels += 1.0;
            *centre_mm += mask.grid.physical_from_index(Eigen::Vector3d(i, j, k));
          }
    *centre_mm /= voxels;
    return voxels * mask.grid.spacing_mm.prod() / 1000.0;
  };
  Eigen::Vector3d left_mm, right_mm;
  EXPECT_NEAR(measure("left", &left_mm), 139.0, 1.0);  // ml, from the data's description
  EXPECT_NEAR(measure("right", &right_mm), 189.0, 1.0);
  EXPECT_GT(left_mm.x(), right_mm.x() + 50.0);  // LPS: the left kidney is on the left
}

}  // namespace
}  // namespace usct
