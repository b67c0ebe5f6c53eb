// Series of real scanners, compared to the values that dcmdump and others read from the same files.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <random>
#include <sstream>

#include "core/io/expect_input_error.h"
#include "test_data.h"
#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

namespace fs = std::filesystem;

/// The numbers of one attribute, as dcmdump prints them; empty if dcmdump is not installed.
std::vector<double> dumped_numbers(const fs::path& path, const std::string& tag) {
  const std::string command = "dcmdump -q +P " + tag + " '" + path.string() + "' 2>/dev/null";
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
  std::string out(4096, '\0');
  out.resize(std::fread(out.data(), 1, out.size(), pipe.get()));
  const std::size_t begin = out.find('[');
  const std::size_t end = out.find(']');
  if (begin == std::string::npos || end == std::string::npos) return {};
  std::string list = out.substr(begin + 1, end - begin - 1);
  std::replace(list.begin(), list.end(), '\\', ' ');
  std::istringstream in(list);
  std::vector<double> numbers;
  for (double number = 0.0; in >> number;) numbers.push_back(number);
  return numbers;
}

std::vector<fs::path> files_of(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

TEST(DicomRealData, AbdomenLiesWhereItsPositionsSay) {
  const fs::path folder = test::data_root() / "totalseg_ct" / "example_ct_dicom";
  USCT_REQUIRE_DATA(folder);
  const std::vector<fs::path> files = files_of(folder);
  ASSERT_FALSE(dumped_numbers(files[0], "0020,0032").empty())
      << "dcmdump failed; dcmtk is needed by the tests";
  const LoadedCt ct = read_ct(folder);
  const Grid& grid = ct.volume.grid;
  ASSERT_EQ(grid.size, Eigen::Vector3i(512, 512, 20));
  EXPECT_NEAR(grid.spacing_mm.z(), 2.0, 1e-9);  // not its SliceThickness
  EXPECT_EQ(dumped_numbers(files[0], "0018,0050"), std::vector<double>{3.0});
  for (const fs::path& file : files) {
    const std::vector<double> p = dumped_numbers(file, "0020,0032");
    const Eigen::Vector3d index = grid.index_from_physical({p[0], p[1], p[2]});
    EXPECT_NEAR(index.x(), 0.0, 1e-9);
    EXPECT_NEAR(index.y(), 0.0, 1e-9);
    EXPECT_NEAR(index.z(), std::round(index.z()), 1e-9);
  }
  const auto range = std::minmax_element(ct.volume.voxels.begin(), ct.volume.voxels.end());
  EXPECT_EQ(*range.first, -1024);
  EXPECT_LT(*range.second, 3072);
}

/// The label map of the organs was made by another group, with another DICOM reader.
TEST(DicomRealData, OrgansOfTheLabelMapHaveTheirDensities) {
  const fs::path folder = test::data_root() / "totalseg_ct";
  USCT_REQUIRE_DATA(folder);
  const CtVolume ct = read_ct(folder / "example_ct_dicom").volume;
  const auto labels = read_volume<std::uint8_t>(folder / "example_seg_dicom.nii.gz");
  struct Sums {
    double count = 0.0, sum = 0.0, squares = 0.0;
    double mean() const { return sum / count; }
    double deviation() const { return std::sqrt(squares / count - mean() * mean()); }
  };
  std::vector<Sums> organs(256);
  const Eigen::Vector3i& size = labels.grid.size;
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        const Eigen::Vector3d index =
            ct.grid.index_from_physical(labels.grid.physical_from_index(Eigen::Vector3d(i, j, k)));
        const Eigen::Vector3i nearest = index.array().round().cast<int>();
        ASSERT_LT((index - nearest.cast<double>()).norm(), 1e-3);
        const double hu = ct.at(nearest.x(), nearest.y(), nearest.z());
        Sums& organ = organs[labels.at(i, j, k)];
        organ.count += 1.0;
        organ.sum += hu;
        organ.squares += hu * hu;
      }
  // A flip or a shift by a few voxels would mix other tissues in and widen these ranges.
  EXPECT_NEAR(organs[5].mean(), 90.0, 15.0);  // liver, portal venous phase
  EXPECT_LT(organs[5].deviation(), 25.0);
  EXPECT_NEAR(organs[1].mean(), 80.0, 15.0);  // spleen
  EXPECT_LT(organs[1].deviation(), 25.0);
  EXPECT_GT(organs[32].mean(), 200.0);  // a vertebra
  EXPECT_GT(organs[69].mean(), 500.0);  // a humerus
}

/// The slices as read by dcmdump and from the last bytes of the files.
struct TiltedSlice {
  std::string name;
  Eigen::Vector3d position_mm, row, column;
  double depth_mm = 0.0;
  std::vector<std::int16_t> pixels;

  /// Interpolates at the point's projection onto the slice. Returns false outside the slice.
  bool sample(const Eigen::Vector3d& p_mm, double spacing_mm, double* value) const {
    const double x = row.dot(p_mm - position_mm) / spacing_mm;
    const double y = column.dot(p_mm - position_mm) / spacing_mm;
    if (x < 0.0 || y < 0.0 || x > 511.0 || y > 511.0) return false;
    const int i = std::min(static_cast<int>(x), 510);
    const int j = std::min(static_cast<int>(y), 510);
    const auto at = [&](int a, int b) {
      return std::max<double>(
          pixels[static_cast<std::size_t>(b) * 512 + static_cast<std::size_t>(a)],
          -1024.0);  // padding of -1500
    };
    *value = (at(i, j) * (i + 1 - x) + at(i + 1, j) * (x - i)) * (j + 1 - y) +
             (at(i, j + 1) * (i + 1 - x) + at(i + 1, j + 1) * (x - i)) * (y - j);
    return true;
  }
};

std::vector<TiltedSlice> read_tilted(const fs::path& folder) {
  std::vector<TiltedSlice> slices;
  for (const fs::path& file : files_of(folder)) {
    TiltedSlice slice;
    const std::vector<double> p = dumped_numbers(file, "0020,0032");
    const std::vector<double> axes = dumped_numbers(file, "0020,0037");
    if (p.size() != 3 || axes.size() != 6) return {};
    slice.name = file.filename().string();
    slice.position_mm = {p[0], p[1], p[2]};
    slice.row = {axes[0], axes[1], axes[2]};
    slice.column = {axes[3], axes[4], axes[5]};
    slice.depth_mm = slice.row.cross(slice.column).dot(slice.position_mm);
    slice.pixels.resize(512 * 512);
    std::ifstream in(file, std::ios::binary);
    in.seekg(-static_cast<std::streamoff>(2 * slice.pixels.size()), std::ios::end);
    in.read(reinterpret_cast<char*>(slice.pixels.data()),
            static_cast<std::streamsize>(2 * slice.pixels.size()));
    slices.push_back(std::move(slice));
  }
  std::sort(slices.begin(), slices.end(),
            [](const TiltedSlice& a, const TiltedSlice& b) { return a.depth_mm < b.depth_mm; });
  return slices;
}

TEST(DicomRealData, GantryTiltAndUnevenSpacingAreNamedAndRefused) {
  const fs::path folder = test::data_root() / "dicom_gantry_tilt" / "gantry_tilt_GE_uneven";
  USCT_REQUIRE_DATA(folder);
  test::expect_input_error([&] { read_ct(folder); },
                           {"gantry tilt of 18.5 degrees", "uneven", "1.14 mm", "4.22 mm",
                            "7.38 mm", "'14.dcm' and '15.dcm'", "resample_irregular"});
  EXPECT_EQ(find_dicom_series(folder)[0].problems.size(), 2U);
}

TEST(DicomRealData, GantryTiltIsResampledAtTruePositions) {
  const fs::path folder = test::data_root() / "dicom_gantry_tilt" / "gantry_tilt_GE_uneven";
  USCT_REQUIRE_DATA(folder);
  const std::vector<TiltedSlice> slices = read_tilted(folder);
  ASSERT_FALSE(slices.empty()) << "dcmdump failed; dcmtk is needed by the tests";
  DicomReadOptions options;
  options.resample_irregular = true;
  const LoadedCt ct = read_ct(folder, options);
  const Grid& grid = ct.volume.grid;
  EXPECT_EQ(ct.warnings.size(), 2U);
  EXPECT_NEAR(grid.spacing_mm.z(), 1.081, 0.01);

  const Eigen::Vector3d normal = slices[0].row.cross(slices[0].column);
  std::mt19937 random(3);
  int compared = 0;
  for (int n = 0; n < 20000; ++n) {
    const Eigen::Vector3i index(static_cast<int>(random() % static_cast<unsigned>(grid.size.x())),
                                static_cast<int>(random() % static_cast<unsigned>(grid.size.y())),
                                static_cast<int>(random() % static_cast<unsigned>(grid.size.z())));
    const Eigen::Vector3d p = grid.physical_from_index(index.cast<double>());
    const double depth = normal.dot(p);
    std::size_t b = 1;
    while (b + 1 < slices.size() && slices[b].depth_mm < depth) ++b;
    const TiltedSlice& above = slices[b];
    const TiltedSlice& below = slices[b - 1];
    double at_below = 0.0;
    double at_above = 0.0;
    if (!below.sample(p, 0.4882812, &at_below) || !above.sample(p, 0.4882812, &at_above)) continue;
    const double weight = (depth - below.depth_mm) / (above.depth_mm - below.depth_mm);
    ASSERT_NEAR(ct.volume.at(index.x(), index.y(), index.z()),
                (1.0 - weight) * at_below + weight * at_above, 0.6)
        << "at " << index.transpose() << " between " << below.name << " and " << above.name;
    ++compared;
  }
  EXPECT_GT(compared, 15000);
}

}  // namespace
}  // namespace usct
