#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <Eigen/Dense>
#include <new>

#include "core/geometry/random_geometry.h"
#include "core/similarity/instructions.h"
#include "similarity/lattice_ct.h"

namespace usct::test {
namespace {

using Eigen::Affine3d;
using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr double kBackgroundHu = 40.0;
constexpr double kStepHu = 2.0;  // of a byte

PackedCt random_ct() {
  Grid grid;
  grid.size = Vector3i(integer(2, 9), integer(2, 9), integer(2, 9));
  grid.spacing_mm = Vector3d(uniform(1.0, 4.0), uniform(1.0, 4.0), uniform(1.0, 4.0));
  Volume<float> ct(grid);
  for (float& voxel : ct.voxels) voxel = static_cast<float>(kStepHu * integer(0, 255) - 100.0);
  return {ct, {-100.0, 410.0}, kBackgroundHu};
}

/// A lattice that leaves the CT, along directions of its own.
Affine3d random_lattice() {
  Affine3d T_index_lattice = Affine3d::Identity();
  T_index_lattice.linear() = uniform(0.3, 1.5) * random_rotation();
  T_index_lattice.translation() =
      Vector3d(uniform(-3.0, 9.0), uniform(-3.0, 9.0), uniform(-3.0, 9.0));
  return T_index_lattice;
}

/// Trilinear interpolation of `byte`(i, j, k).
template <typename Byte>
double interpolated(const Vector3d& index, const Byte& byte) {
  const Vector3i cell = index.cast<int>();
  const Vector3d t = index - cell.cast<double>();
  double sum = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3i of(corner & 1, corner >> 1 & 1, corner >> 2);
    double weight = 1.0;
    for (int axis = 0; axis < 3; ++axis) weight *= of[axis] == 1 ? t[axis] : 1.0 - t[axis];
    sum += weight * byte(cell + of);
  }
  return sum;
}

/// The distance from an index to where the CT ends; negative outside.
double inside(const PackedCt& ct, const Vector3d& index) {
  return index.cwiseMin((ct.grid().size.array() - 1).cast<double>().matrix() - index).minCoeff();
}

/// A word of the packed gradient holds the voxel, and its neighbour along j in the next byte.
double byte_of(const PackedCt& ct, const Vector3i& voxel, int first_byte) {
  const int j = std::min(voxel.y(), ct.grid().size.y() - 2);
  const std::size_t at = static_cast<std::size_t>(voxel.x()) +
                         static_cast<std::size_t>(j) * ct.stride_j() +
                         static_cast<std::size_t>(voxel.z()) * ct.stride_k();
  return ct.gradient().words[at] >> 8 * (first_byte + voxel.y() - j) & 0xFFU;
}

/// All points by all instructions, against the interpolation of the eight voxels around each.
RC_GTEST_PROP(LatticeCt, HasTheValueAndGradientOfTheCtAtEachPoint, ()) {
  const PackedCt ct = random_ct();
  const Affine3d T_index_lattice = random_lattice();
  const Vector3i size(integer(4, 19), integer(4, 6), integer(4, 6));
  for (const std::int64_t target : Instructions::all()) {
    const Instructions used(target);
    const LatticeCt lattice = sampled_lattice(ct, T_index_lattice, size, 10.0, 3.0);
    for (int k = 0; k < size.z(); ++k)
      for (int j = 0; j < size.y(); ++j)
        for (int i = 0; i < size.x(); ++i) {
          const Vector3d index = T_index_lattice * Vector3d(i, j, k);
          if (std::abs(inside(ct, index)) < 1e-4) continue;  // which side is a matter of rounding
          double value = (kBackgroundHu + 100.0) / kStepHu;
          double gradient = 0.0;
          if (inside(ct, index) > 0.0) {
            value = interpolated(index, [&](const Vector3i& v) { return byte_of(ct, v, 0); });
            gradient = interpolated(index, [&](const Vector3i& v) { return byte_of(ct, v, 2); });
          }
          const auto is = [](std::uint32_t byte, double steps) {
            return std::abs(byte - steps) < 0.51;
          };
          // The neighbours before it have the point as well.
          for (int before = 0; before <= std::min(i, kBlockEdge - 1); ++before) {
            const std::size_t at = lattice.place({i - before, j, k});
            RC_ASSERT(is(lattice.value[at] >> (8 * before) & 0xFFU, value));
            RC_ASSERT(is(lattice.gradient[at] >> (8 * before) & 0xFFU, gradient));
          }
        }
  }
}

/// A page with another one behind it at which any access ends the program.
class GuardedPage {
 public:
  GuardedPage()
      : first_(static_cast<char*>(
            mmap(nullptr, 2 * size_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0))) {
    if (first_ == MAP_FAILED || mprotect(first_ + size_, size_, PROT_NONE) != 0)
      throw std::bad_alloc();
  }
  ~GuardedPage() { munmap(first_, 2 * size_); }
  GuardedPage(const GuardedPage&) = delete;
  GuardedPage& operator=(const GuardedPage&) = delete;

  /// The last words of the page.
  std::uint32_t* last(std::size_t words) const {
    return reinterpret_cast<std::uint32_t*>(first_ + size_) - words;
  }

 private:
  std::size_t size_ = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  char* first_;
};

TEST(LatticeCt, TouchesNothingBeyondItsArrays) {
  Grid grid;
  grid.size.setConstant(2);
  const PackedCt ct(Volume<float>(grid), {-100.0, 410.0}, kBackgroundHu);
  const GuardedPage value, gradient;
  for (int count = 4; count < 40; ++count) {
    const std::size_t words = LatticeCt({count, 1, 1}).value.size();
    const LatticeRow row{ct.gradient().words,
                         {1.0F, 1.0F, 1.0F},
                         static_cast<int>(ct.stride_j()),
                         static_cast<int>(ct.stride_k()),
                         70.0F,
                         {-0.5F, 0.5F, 0.5F},
                         {0.25F, 0.0F, 0.0F}};
    for (const std::int64_t target : Instructions::all()) {
      const Instructions used(target);
      sample_row_simd(row, count, value.last(words), gradient.last(words));
      EXPECT_EQ(LatticeCt::byte(value.last(words)[0]), 70);
    }
  }
}

/// The inverse covariances of the bytes of each cube, in double precision.
RC_GTEST_PROP(LatticeCt, HasTheInverseCovariancesOfEachCube, ()) {
  LatticeCt lattice =
      sampled_lattice(random_ct(), random_lattice(),
                      Vector3i(integer(4, 19), integer(4, 6), integer(4, 6)), 10.0, 3.0);
  const Ridges ridges{static_cast<float>(uniform(1.0, 50.0)),
                      static_cast<float>(uniform(1.0, 50.0))};
  const auto holds = [&] {
    for (int k = 0; k + kBlockEdge <= lattice.size.z(); ++k)
      for (int j = 0; j + kBlockEdge <= lattice.size.y(); ++j)
        for (int i = 0; i + kBlockEdge <= lattice.size.x(); ++i) {
          Eigen::Matrix<double, kBlockEdge * kBlockEdge * kBlockEdge, 2> bytes;
          for (int cell = 0; cell < bytes.rows(); ++cell) {
            const std::size_t at = lattice.place({i + cell % 4, j + cell / 4 % 4, k + cell / 16});
            bytes.row(cell) << LatticeCt::byte(lattice.value[at]),
                LatticeCt::byte(lattice.gradient[at]);
          }
          bytes.rowwise() -= bytes.colwise().mean();
          Eigen::Matrix2d covariance =
              bytes.transpose() * bytes / static_cast<double>(bytes.rows());
          covariance.diagonal() += Eigen::Vector2d(ridges.value, ridges.gradient);
          const double product = covariance.diagonal().prod();
          // Not closer to singular than this.
          const double determinant = std::max(covariance.determinant(), 1e-3 * product);
          const std::size_t at = lattice.place({i, j, k});
          const auto is = [&](float inverse, double expected) {
            const double scale = covariance.cwiseAbs().maxCoeff() / determinant;
            return std::abs(inverse - expected / determinant) < 1e-3 * scale;
          };
          RC_ASSERT(is(lattice.inverse_vv[at], covariance(1, 1)));
          RC_ASSERT(is(lattice.inverse_vg[at], -covariance(0, 1)));
          RC_ASSERT(is(lattice.inverse_gg[at], covariance(0, 0)));
        }
  };
  invert_covariances_scalar(lattice, ridges);
  holds();
  for (const std::int64_t target : Instructions::all()) {
    const Instructions used(target);
    invert_covariances_simd(lattice, ridges);
    holds();
  }
}

/// The scalar reference, point by point.
RC_GTEST_PROP(LatticeCt, AllInstructionsSampleARowAsTheReferenceDoes, ()) {
  const PackedCt ct = random_ct();
  const PackedGradient packed = ct.gradient();
  const Affine3d T_index_lattice = random_lattice();
  const int count = integer(1, 40);
  const LatticeRow row{packed.words,
                       (ct.grid().size.array() - 1).cast<float>(),
                       static_cast<int>(ct.stride_j()),
                       static_cast<int>(ct.stride_k()),
                       static_cast<float>(ct.background()),
                       T_index_lattice.translation().cast<float>(),
                       T_index_lattice.linear().col(0).cast<float>()};
  const auto sampled = [&](decltype(&sample_row_scalar) kernel) {
    std::vector<std::uint32_t> words(2 * (static_cast<std::size_t>(count) + kBeyondPoints));
    kernel(row, count, words.data(), words.data() + words.size() / 2);
    return words;
  };
  const std::vector<std::uint32_t> expected = sampled(sample_row_scalar);
  for (const std::int64_t target : Instructions::all()) {
    const Instructions used(target);
    const std::vector<std::uint32_t> words = sampled(sample_row_simd);
    for (int i = 0; i < count; ++i) {
      const Vector3d index = T_index_lattice * Vector3d(i, 0, 0);
      if (std::abs(inside(ct, index)) < 1e-4) continue;
      for (const std::size_t first : {std::size_t{0}, words.size() / 2}) {
        const std::size_t at = first + static_cast<std::size_t>(i);
        RC_ASSERT(std::abs(LatticeCt::byte(words[at]) - LatticeCt::byte(expected[at])) <= 1);
      }
    }
  }
}

}  // namespace
}  // namespace usct::test
