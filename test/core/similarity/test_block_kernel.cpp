#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Dense>
#include <array>

#include "core/geometry/random_geometry.h"
#include "core/similarity/instructions.h"
#include "similarity/block_kernel.h"

namespace usct::test {
namespace {

using Eigen::Vector3i;

constexpr int kCells = kBlockEdge * kBlockEdge * kBlockEdge;
constexpr float kValueRidge = 4.0F;
constexpr float kGradientRidge = 0.5F;

/// A block of which all cells are known, and a lattice around it.
struct BlockScene {
  Vector3i translations{integer(1, 20), integer(1, 5), integer(1, 5)};
  Vector3i first{integer(0, 3), integer(0, 3), integer(0, 3)};
  LatticeCt ct;
  std::array<float, kCells> ultrasound{};

  BlockScene() {
    ct.size = first + translations + Vector3i::Constant(kBlockEdge - 1 + integer(0, 2));
    const std::size_t count = static_cast<std::size_t>(ct.size.prod()) + kBlockLanes;
    for (std::size_t i = 0; i < count; ++i) {
      ct.value.push_back(static_cast<float>(uniform(-50.0, 150.0)));
      ct.gradient.push_back(static_cast<float>(uniform(0.0, 30.0)));
    }
    ct.invert_covariances(kValueRidge, kGradientRidge);
    for (float& value : ultrasound) value = static_cast<float>(uniform(-2.0, 2.0));
    auto u = Eigen::Map<Eigen::Matrix<float, kCells, 1>>(ultrasound.data());
    u.array() -= u.mean();
    u.normalize();
  }
  BlockMatch match() const { return {ct, first, translations, ultrasound.data(), kCells}; }
  std::size_t values() const {
    return whole_vectors(translations.x()) *
           static_cast<std::size_t>(translations.y() * translations.z());
  }
  /// The samples of the CT under the block, minus their means, as columns.
  Eigen::Matrix<double, kCells, 2> under(const Vector3i& translation) const {
    Eigen::Matrix<double, kCells, 2> columns;
    int row = 0;
    for (int k = 0; k < kBlockEdge; ++k)
      for (int j = 0; j < kBlockEdge; ++j)
        for (int i = 0; i < kBlockEdge; ++i, ++row) {
          const std::size_t at = ct.place(first + translation + Vector3i(i, j, k));
          columns(row, 0) = static_cast<double>(ct.value[at]);
          columns(row, 1) = static_cast<double>(ct.gradient[at]);
        }
    columns.rowwise() -= columns.colwise().mean();
    return columns;
  }
};

std::vector<float> values_of(const BlockScene& scene, decltype(&block_values_scalar) kernel) {
  std::vector<float> values(scene.values() + kBlockLanes);
  kernel(scene.match(), values.data());
  return values;
}

template <typename Use>
void for_translations(const BlockScene& scene, const Use& use) {
  std::size_t row = 0;
  for (int z = 0; z < scene.translations.z(); ++z)
    for (int y = 0; y < scene.translations.y(); ++y, row += whole_vectors(scene.translations.x()))
      for (int x = 0; x < scene.translations.x(); ++x)
        use(Vector3i(x, y, z), row + static_cast<std::size_t>(x));
}

/// Ridge regression by its normal equations, in double precision.
RC_GTEST_PROP(BlockKernel, ValuesAreWhatALinearFunctionOfTheCtExplains, ()) {
  const BlockScene scene;
  const std::vector<float> values = values_of(scene, block_values_scalar);
  const Eigen::Map<const Eigen::Matrix<float, kCells, 1>> u(scene.ultrasound.data());
  for_translations(scene, [&](const Vector3i& translation, std::size_t at) {
    const Eigen::Matrix<double, kCells, 2> ct = scene.under(translation);
    const Eigen::Vector2d product = ct.transpose() * u.cast<double>();
    Eigen::Matrix2d covariance = ct.transpose() * ct / kCells;
    covariance.diagonal() += Eigen::Vector2d(kValueRidge, kGradientRidge);
    const double explained = product.dot(covariance.ldlt().solve(product));
    RC_ASSERT(std::abs(static_cast<double>(values[at]) - explained) < 1e-3 * (1.0 + explained));
  });
}

RC_GTEST_PROP(BlockKernel, UltrasoundThatIsALinearFunctionOfTheCtIsExplainedThere, ()) {
  BlockScene scene;
  const Vector3i where(integer(0, scene.translations.x() - 1),
                       integer(0, scene.translations.y() - 1),
                       integer(0, scene.translations.z() - 1));
  Eigen::Map<Eigen::Matrix<float, kCells, 1>> u(scene.ultrasound.data());
  u = (scene.under(where) * Eigen::Vector2d(uniform(0.5, 2.0), uniform(-9.0, 9.0))).cast<float>();
  u.normalize();
  const std::vector<float> values = values_of(scene, block_values_scalar);
  for_translations(scene, [&](const Vector3i& translation, std::size_t at) {
    if (translation == where)
      RC_ASSERT(values[at] > 0.98F * kCells);  // all but the ridge
    else
      RC_ASSERT(values[at] < 0.9F * kCells);
  });
}

RC_GTEST_PROP(BlockKernel, AllInstructionsGiveTheValuesOfTheReference, ()) {
  const BlockScene scene;
  const std::vector<float> expected = values_of(scene, block_values_scalar);
  for (const std::int64_t target : Instructions::all()) {
    const Instructions used(target);
    const std::vector<float> values = values_of(scene, block_values_simd);
    for_translations(scene, [&](const Vector3i&, std::size_t at) {
      RC_ASSERT(std::abs(values[at] - expected[at]) < 1e-3F * (1.0F + expected[at]));
    });
  }
}

RC_GTEST_PROP(BlockKernel, SumsAreOfTheValuesAtShiftedTranslations, ()) {
  const Vector3i size(integer(1, 20), integer(1, 4), integer(1, 4));
  const Vector3i shift(integer(0, 5), integer(0, 2), integer(0, 2));
  const std::size_t row = whole_vectors(size.x() + shift.x());
  const std::size_t slice = row * static_cast<std::size_t>(size.y() + shift.y());
  std::vector<float> values(slice * static_cast<std::size_t>(size.z() + shift.z()) + kBlockLanes);
  for (float& value : values) value = static_cast<float>(integer(-99, 99));
  const auto place = [&](const Vector3i& at) {
    return static_cast<std::size_t>(at.x()) + row * static_cast<std::size_t>(at.y()) +
           slice * static_cast<std::size_t>(at.z());
  };
  const std::size_t sums_row = whole_vectors(size.x());
  const auto sums_of = [&](decltype(&add_block_scalar) add) {
    std::vector<float> sums(sums_row * static_cast<std::size_t>(size.y() * size.z()), 1.0F);
    add({values.data() + place(shift), row, slice, size, sums.data()});
    return sums;
  };
  for (const std::int64_t target : Instructions::all()) {
    const Instructions used(target);
    for (const auto& sums : {sums_of(add_block_scalar), sums_of(add_block_simd)})
      for (int z = 0; z < size.z(); ++z)
        for (int y = 0; y < size.y(); ++y)
          for (int x = 0; x < size.x(); ++x) {
            const std::size_t at =
                static_cast<std::size_t>(x) + sums_row * static_cast<std::size_t>(y + size.y() * z);
            RC_ASSERT(sums[at] == 1.0F + values[place(shift + Vector3i(x, y, z))]);
          }
  }
}

}  // namespace
}  // namespace usct::test
