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
#include "core/io/volume_headers.h"
#include "core/io/without_permission.h"
#include "test_data.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using test::expect_input_error;
using test::expect_near_grid;
using test::grid_of;
using test::read_text;
using test::TemporaryFolder;
using test::write_text;

/// NIfTI holds positions as 32-bit numbers, which are less exact.
double tolerance_mm(const std::string& extension) {
  return extension.substr(0, 4) == ".nii" ? 1e-3 : 1e-9;
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

class VolumeFormats : public testing::TestWithParam<const char*> {
 protected:
  const std::string extension_ = GetParam();
  const TemporaryFolder folder_;
  const fs::path path_ = folder_.path() / ("ct" + extension_);
};

/// The formats that ITK compresses.
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
