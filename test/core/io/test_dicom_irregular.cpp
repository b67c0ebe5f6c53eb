// Slices that form no regular grid must be named and refused, or resampled on request.
#include <gtest/gtest.h>

#include "core/io/dicom_writer.h"
#include "core/io/expect_input_error.h"
#include "core/io/temporary_folder.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/dicom/dicom.h"

namespace usct {
namespace {

using test::DicomSlice;
using test::expect_input_error;
using test::TemporaryFolder;

/// A linear function, which linear interpolation reproduces exactly.
double linear_hounsfield(const Eigen::Vector3d& p_mm) {
  return 11.0 * p_mm.x() - 7.0 * p_mm.y() + 5.0 * p_mm.z() + 40.0;
}

/// Slices with oblique axes; positions are steps along the normal and sideways, in mm.
class DicomIrregular : public testing::Test {
 protected:
  void add(double along_mm, double right_mm = 0.0, double down_mm = 0.0) {
    DicomSlice slice;
    slice.axes = rotation_.leftCols<2>();
    slice.position_mm = Eigen::Vector3d(-10.0, 20.0, -30.0) +
                        rotation_ * Eigen::Vector3d(right_mm, down_mm, along_mm);
    slice.hounsfield = linear_hounsfield;
    slice.intercept = -10000.0;
    slices_.push_back(slice);
  }
  void write() { test::write_shuffled(folder_.path(), slices_); }

  /// Whether a point lies between two slices (or on one), within both.
  bool is_covered(const Eigen::Vector3d& p_mm, double margin_mm) const {
    std::vector<DicomSlice> sorted = slices_;
    const Eigen::Vector3d normal = rotation_.col(2);
    const auto depth = [&](const DicomSlice& s) { return normal.dot(s.position_mm); };
    std::sort(sorted.begin(), sorted.end(),
              [&](const auto& a, const auto& b) { return depth(a) < depth(b); });
    const auto within = [&](const DicomSlice& slice) {
      const Eigen::Vector2d offset = slice.axes.transpose() * (p_mm - slice.position_mm);
      const Eigen::Vector2d extent(0.75 * 15, 1.25 * 11);
      return (offset.array() >= margin_mm).all() &&
             (offset.array() <= extent.array() - margin_mm).all();
    };
    const double d = normal.dot(p_mm);
    constexpr double kOnASlice = 1e-5;
    for (std::size_t k = 0; k < sorted.size(); ++k)
      if (std::abs(d - depth(sorted[k])) < kOnASlice) return within(sorted[k]);
    for (std::size_t k = 1; k < sorted.size(); ++k)
      if (depth(sorted[k - 1]) < d && d < depth(sorted[k]))
        return within(sorted[k - 1]) && within(sorted[k]);
    return false;
  }

  void expect_resampled(const LoadedCt& ct) const {
    const Grid& grid = ct.volume.grid;
    int covered = 0;
    int outside = 0;
    for (int k = 0; k < grid.size.z(); ++k)
      for (int j = 0; j < grid.size.y(); ++j)
        for (int i = 0; i < grid.size.x(); ++i) {
          const Eigen::Vector3d p = grid.physical_from_index(Eigen::Vector3d(i, j, k));
          if (is_covered(p, 1e-3)) {
            // Values are rounded when written, and again when resampled.
            ASSERT_NEAR(ct.volume.at(i, j, k), linear_hounsfield(p), 1.01)
                << i << " " << j << " " << k;
            ++covered;
          } else if (ct.volume.at(i, j, k) == -1024) {
            ++outside;
          } else {
            ASSERT_TRUE(is_covered(p, -1e-3)) << i << " " << j << " " << k;
          }
        }
    EXPECT_GT(covered, grid.size.prod() / 3);
    outside_ = outside;
  }

  const Eigen::Matrix3d rotation_ =
      Eigen::AngleAxisd(0.4, Eigen::Vector3d(2.0, 1.0, -1.0).normalized()).matrix();
  const TemporaryFolder folder_;
  std::vector<DicomSlice> slices_;
  const DicomReadOptions resample_ = [] {
    DicomReadOptions options;
    options.resample_irregular = true;
    return options;
  }();
  mutable int outside_ = 0;
};

TEST_F(DicomIrregular, GantryTilt) {
  const double tangent = std::tan(radians(18.5));
  for (int k = 0; k < 6; ++k) add(2.0 * k, 0.0, -2.0 * k * tangent);
  write();
  expect_input_error([&] { read_dicom_ct(folder_.path()); },
                     {"gantry tilt of 18.5 degrees", "resample_irregular", "slice_"});
  ASSERT_EQ(find_dicom_series(folder_.path())[0].problems.size(), 1U);
  const LoadedCt ct = read_dicom_ct(folder_.path(), resample_);
  ASSERT_EQ(ct.warnings.size(), 1U);
  EXPECT_NE(ct.warnings[0].find("resampled"), std::string::npos);
  EXPECT_NE(ct.warnings[0].find("gantry tilt"), std::string::npos);
  EXPECT_EQ(ct.volume.grid.size.x(), 16);
  EXPECT_EQ(ct.volume.grid.size.z(), 6);
  EXPECT_EQ(ct.volume.grid.size.y(), 12 + static_cast<int>(std::ceil(10.0 * tangent / 1.25)));
  EXPECT_NEAR(ct.volume.grid.spacing_mm.z(), 2.0, 1e-6);
  expect_resampled(ct);
  EXPECT_GT(outside_, 0);
}

TEST_F(DicomIrregular, UnevenSpacing) {
  for (const double along : {0.0, 1.0, 2.0, 3.4, 5.1, 7.0}) add(along);
  write();
  expect_input_error([&] { read_dicom_ct(folder_.path()); },
                     {"uneven", "2 x 1 mm", "1.4 mm", "1.7 mm", "1.9 mm", "slice_"});
  const LoadedCt ct = read_dicom_ct(folder_.path(), resample_);
  EXPECT_EQ(ct.volume.grid.size, Eigen::Vector3i(16, 12, 8));
  EXPECT_NEAR(ct.volume.grid.spacing_mm.z(), 1.0, 1e-3);
  expect_resampled(ct);
  EXPECT_EQ(outside_, 0);
}

TEST_F(DicomIrregular, TiltAndUnevenSpacingTogether) {
  for (const double along : {0.0, 1.0, 2.5, 3.4, 5.1, 7.0}) add(along, 0.3 * along, -0.2 * along);
  write();
  expect_input_error([&] { read_dicom_ct(folder_.path()); }, {"uneven", "gantry tilt of 19.8"});
  expect_resampled(read_dicom_ct(folder_.path(), resample_));
}

TEST_F(DicomIrregular, SlicesShiftedSideways) {
  for (int k = 0; k < 6; ++k) add(2.0 * k, k == 3 ? 1.5 : 0.0);
  write();
  expect_input_error([&] { read_dicom_ct(folder_.path()); }, {"sideways unevenly", "slice_"});
  expect_resampled(read_dicom_ct(folder_.path(), resample_));
}

TEST_F(DicomIrregular, MissingSlicesAreNamedWithTheirGap) {
  for (const int k : {0, 1, 2, 5, 6, 7, 9}) add(2.0 * k);
  write();
  expect_input_error(
      [&] { read_dicom_ct(folder_.path()); },
      {"missing", "2 in the gap of 6 mm", "1 in the gap of 4 mm", "spacing is 2 mm", "slice_"});
  const LoadedCt ct = read_dicom_ct(folder_.path(), resample_);
  EXPECT_EQ(ct.volume.grid.size.z(), 10);
  EXPECT_NE(ct.warnings[0].find("gap of 6 mm"), std::string::npos);
  expect_resampled(ct);
}

TEST_F(DicomIrregular, SameSliceTwiceIsTakenOnceWithAWarning) {
  for (int k = 0; k < 5; ++k) add(2.0 * k);
  add(4.0);
  write();
  const LoadedCt ct = read_dicom_ct(folder_.path());
  EXPECT_EQ(ct.volume.grid.size.z(), 5);
  ASSERT_EQ(ct.warnings.size(), 1U);
  EXPECT_NE(ct.warnings[0].find("the same slice as"), std::string::npos);
  expect_resampled(ct);
}

TEST_F(DicomIrregular, InfoCountsACopyOnceAndReadsTheRest) {
  for (int k = 0; k < 5; ++k) add(2.0 * k);
  add(4.0);
  write();
  const DicomSeries series = find_dicom_series(folder_.path())[0];
  EXPECT_EQ(series.slices, 5);
  EXPECT_EQ(series.files, 6);
  EXPECT_TRUE(series.problems.empty());
  const std::string described = describe_dicom(folder_.path());
  for (const char* part : {"\"range\"", "the same slice as"})
    EXPECT_NE(described.find(part), std::string::npos) << described;
}

TEST_F(DicomIrregular, OtherPixelsAtTheSamePlaceAreRefused) {
  for (int k = 0; k < 5; ++k) add(2.0 * k);
  add(4.0);
  slices_.back().hounsfield = [](const Eigen::Vector3d& p) { return linear_hounsfield(p) + 1.0; };
  write();
  expect_input_error([&] { read_dicom_ct(folder_.path()); },
                     {"one place", "differ in their pixels", "slice_"});
  const std::vector<std::string> problems = find_dicom_series(folder_.path())[0].problems;
  ASSERT_EQ(problems.size(), 1U);
  EXPECT_NE(problems[0].find("differ in their pixels"), std::string::npos) << problems[0];
}

TEST_F(DicomIrregular, OneOfTwoAcquisitionsAtTheSamePlaceCanBeTaken) {
  for (int phase = 1; phase <= 2; ++phase)
    for (int k = 0; k < 5; ++k) {
      add(2.0 * k);
      slices_.back().acquisition_number = phase;
      if (phase == 2) slices_.back().hounsfield = [](const Eigen::Vector3d&) { return 7.0; };
    }
  write();
  expect_input_error([&] { read_dicom_ct(folder_.path()); }, {"one place", "acquisition_number"});
  DicomReadOptions options;
  options.acquisition_number = 1;
  expect_resampled(read_dicom_ct(folder_.path(), options));
  options.acquisition_number = 2;
  EXPECT_EQ(read_dicom_ct(folder_.path(), options).volume.at(3, 3, 3), 7);
  options.acquisition_number = 3;
  expect_input_error([&] { read_dicom_ct(folder_.path(), options); },
                     {"'acquisition_number' is 3"});
}

/// Half a slice apart, as two phases may be: one CT of alternating slices.
TEST_F(DicomIrregular, TwoAcquisitionsThatAlternateAreRefused) {
  for (int k = 0; k < 6; ++k) {
    add(2.0 * k);
    slices_.back().acquisition_number = k % 2 == 0 ? 1 : 2;
  }
  write();
  expect_input_error([&] { read_dicom_ct(folder_.path()); },
                     {"2 acquisitions alternate", "acquisition_number"});
}

TEST_F(DicomIrregular, ACopyOfASliceDoesNotHideThatAcquisitionsAlternate) {
  for (int k = 0; k < 6; ++k) {
    add(2.0 * k);
    slices_.back().acquisition_number = k % 2 == 0 ? 1 : 2;
  }
  slices_.push_back(slices_[3]);
  write();
  expect_input_error([&] { read_dicom_ct(folder_.path()); },
                     {"2 acquisitions alternate", "acquisition_number"});
}

TEST_F(DicomIrregular, AcquisitionsOneAfterTheOtherAreOneCt) {
  for (int k = 0; k < 6; ++k) {
    add(2.0 * k);
    slices_.back().acquisition_number = k / 2 + 1;
  }
  write();
  EXPECT_EQ(read_dicom_ct(folder_.path()).volume.grid.size.z(), 6);
}

TEST_F(DicomIrregular, LinksThatHideSlicesAreNotPassedOver) {
  for (int k = 0; k < 5; ++k) add(2.0 * k);
  write();
  const auto read = [&] { return read_dicom_ct(folder_.path()); };
  std::filesystem::create_directory_symlink("/", folder_.path() / "all");
  const std::vector<std::string> warnings = read().warnings;
  EXPECT_TRUE(std::any_of(warnings.begin(), warnings.end(), [](const std::string& warning) {
    return warning.find("1 links to folders") != std::string::npos;
  }));
  std::filesystem::create_symlink("not_fetched", folder_.path() / "slice_99.dcm");
  expect_input_error(read, {"slice_99.dcm", "link to a file that does not exist"});
}

TEST_F(DicomIrregular, MixturesAreRefusedEvenWhenResamplingIsAllowed) {
  for (int k = 0; k < 5; ++k) add(2.0 * k);
  const DicomSlice good = slices_[2];
  const auto refuse = [&](const std::vector<std::string>& named) {
    const TemporaryFolder folder;
    test::write_shuffled(folder.path(), slices_);
    expect_input_error([&] { read_dicom_ct(folder.path(), resample_); }, named);
    slices_[2] = good;
  };
  slices_[2].axes = Eigen::Matrix3d::Identity().leftCols<2>();
  refuse({"differ in orientation", "slice_"});
  slices_[2].size = {16, 13};
  refuse({"differ in size", "16 12", "16 13", "slice_"});
  slices_[2].spacing_mm.x() *= 1.01;
  refuse({"differ in pixel spacing", "0.75", "0.7575", "slice_"});
  slices_[2].frame_of_reference_uid += ".1";
  refuse({"differ in 'FrameOfReferenceUID'", "slice_"});
  const TemporaryFolder single;
  test::write_shuffled(single.path(), {good});
  expect_input_error([&] { read_dicom_ct(single.path(), resample_); }, {"one place", ">= 2"});
}

TEST_F(DicomIrregular, SlicesFarBesideEachOtherAreRefused) {
  for (const double right_mm : {1e5, 1e13}) {
    slices_.clear();
    for (int k = 0; k < 4; ++k) add(k, k == 2 ? right_mm : 0.0);
    const TemporaryFolder folder;
    test::write_shuffled(folder.path(), slices_);
    expect_input_error([&] { read_dicom_ct(folder.path(), resample_); },
                       {"beside each other", "more columns or rows", "8192"});
  }
}

}  // namespace
}  // namespace usct
