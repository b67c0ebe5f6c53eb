#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "core/io/example_volumes.h"
#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/itk_oracle.h"
#include "core/io/temporary_folder.h"
#include "core/io/volume_headers.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using test::expect_input_error;
using test::expect_near_grid;
using test::grid_of;
using test::kBigEndianVoxels;
using test::kVoxels;
using test::TemporaryFolder;
using test::write_text;

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

/// A qform cannot hold the shear of a tilted gantry: that it disagrees is no reason to switch the
/// sform off, which would be read with a wrong geometry.
TEST_F(Nifti, ATiltIsNamedEvenIfTheQformDisagrees) {
  NiftiFile both = qform_file().put(76, -1.0F).put(254, std::int16_t{1});
  expect_refused(both.put(320, 0.5F), {"sform", "degrees", "sheared"});
}

/// Turned about x or y alone, the axes have a quaternion without a real part, since RAS is LPS
/// turned by half a turn: rounding of the others must not turn them.
TEST_F(Nifti, AxesOfATiltedCtComeBackFromEitherForm) {
  Grid grid = test::example_grids().front().grid;
  grid.size = {512, 512, 1};
  for (const double about_x : {0.0, 0.2, 7.0, 18.5, 30.0})
    for (const double about_y : {0.0, 0.1, -25.0}) {
      SCOPED_TRACE(std::to_string(about_x) + ", " + std::to_string(about_y));
      grid.direction = (Eigen::AngleAxisd(radians(about_x), Eigen::Vector3d::UnitX()) *
                        Eigen::AngleAxisd(radians(about_y), Eigen::Vector3d::UnitY()))
                           .matrix();
      write_volume(CtVolume(grid), path_);
      expect_near_grid(read_volume_info(path_).grid, grid, 1e-3);
      std::string bytes = test::read_text(path_);
      bytes.replace(254, 2, 2, '\0');  // sform_code
      write_text(path_, bytes);
      // Where neither turn is small, the real part is not small either, and what rounding makes of
      // it is.
      if (about_x * about_y == 0.0) expect_near_grid(read_volume_info(path_).grid, grid, 1e-3);
    }
}

/// The header holds no real part of the quaternion, which its readers take as positive: that of a
/// large turn may come out negative, and the axes would be turned the other way.
TEST_F(Nifti, AxesThatAreTurnedFarComeBackFromEitherForm) {
  Grid grid = test::example_grids().front().grid;
  const Eigen::Matrix3d to_ras = Eigen::Vector3d(-1.0, -1.0, 1.0).asDiagonal();
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(-1, -2, -3),
                                      Eigen::Vector3d(3, -1, 2), Eigen::Vector3d(-3, 1, -2)}) {
    grid.direction = to_ras * Eigen::AngleAxisd(radians(160.0), axis.normalized()).matrix();
    write_volume(CtVolume(grid), path_);
    expect_near_grid(read_volume_info(path_).grid, grid, 1e-3);
    std::string bytes = test::read_text(path_);
    bytes.replace(254, 2, 2, '\0');  // sform_code
    write_text(path_, bytes);
    expect_near_grid(read_volume_info(path_).grid, grid, 1e-3);
  }
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

/// As nibabel writes and reads them, and the NIfTI library.
TEST_F(Nifti, ASlopeThatIsNotFiniteScalesNothing) {
  for (const float slope : {0.0F, NAN, INFINITY, -INFINITY}) {
    for (const float inter : {5.0F, NAN, 0.0F})
      EXPECT_EQ(read(NiftiFile().put(112, slope).put(116, inter)).voxels, kVoxels) << slope;
    EXPECT_EQ(test::read_by_itk(path_).voxels, kVoxels) << slope;
  }
}

TEST_F(Nifti, LengthsBeyondItsNumbersAreNotWritten) {
  Grid grid;
  grid.size = {2, 1, 1};
  for (const double spacing_mm : {1e-160, 1e-40, 1e39, 1e150}) {
    grid.spacing_mm = {1.0, spacing_mm, 1.0};
    expect_input_error([&] { write_volume(CtVolume(grid), path_); },
                       {path_.string(), "spacing", "NIfTI"});
  }
  grid.spacing_mm.setOnes();
  grid.origin_mm = {0.0, 0.0, -1e39};
  expect_input_error([&] { write_volume(CtVolume(grid), path_); },
                     {path_.string(), "origin", "NIfTI"});
  EXPECT_TRUE(fs::is_empty(folder_.path()));
  for (const double spacing_mm : {1e-30, 1e30}) {
    grid.origin_mm = {0.0, 0.0, -1e30};
    grid.spacing_mm = {1.0, spacing_mm, 1.0};
    write_volume(CtVolume(grid), path_);
    EXPECT_NO_THROW(read_volume<std::int16_t>(path_)) << spacing_mm;
  }
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
  expect_refused(NiftiFile().put(108, 352.5F), {"'vox_offset'", "whole number"});
  expect_refused(NiftiFile().put(112, 2.0F).put(116, NAN), {"'scl_inter'", "nan"});
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

}  // namespace
}  // namespace usct
