#include <gtest/gtest.h>

#include <cstdint>
#include <random>
#include <vector>

#include "volume/combine_rows.h"

namespace usct::test {
namespace {

constexpr std::size_t kRows = 7;
/// More than four vectors of every instruction set, so that every remainder of lanes occurs.
constexpr std::size_t kMostCount = 150;

template <typename T>
std::vector<T> random_row(std::mt19937& random) {
  std::uniform_int_distribution<int> number(0, 255);
  std::vector<T> row(kMostCount);
  for (T& value : row) value = static_cast<T>(number(random) - (T(-1) < T(0) ? 128 : 0));
  return row;
}

std::vector<float> random_weights(std::mt19937& random, std::size_t count) {
  std::normal_distribution<float> number;
  std::vector<float> weights(count);
  for (float& weight : weights) weight = number(random);
  return weights;
}

/// Calls `combine(count, out)` for every count, and compares with sums in double precision. The
/// bits of a sum must not depend on its place in a vector, so that those of all counts are equal.
template <typename Combine, typename Sum>
void expect_sums(const Combine& combine, const Sum& sum_at) {
  std::vector<float> all(kMostCount);
  combine(kMostCount, all.data());
  for (std::size_t i = 0; i < kMostCount; ++i) ASSERT_NEAR(all[i], sum_at(i), 1e-3) << i;
  for (std::size_t count = 0; count < kMostCount; ++count) {
    std::vector<float> out(kMostCount, -7.0F);
    combine(count, out.data());
    for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(out[i], all[i]) << i << " of " << count;
    ASSERT_EQ(out[count], -7.0F) << "writes beyond " << count;
  }
}

template <typename T>
class CombineRows : public testing::Test {};
using Types = testing::Types<std::uint8_t, std::int16_t, std::uint16_t, float>;
TYPED_TEST_SUITE(CombineRows, Types);

TYPED_TEST(CombineRows, IsALoopOverTheRows) {
  std::mt19937 random(1);
  std::vector<std::vector<TypeParam>> rows;
  std::vector<const TypeParam*> pointers;
  for (std::size_t row = 0; row < kRows; ++row) rows.push_back(random_row<TypeParam>(random));
  for (const auto& row : rows) pointers.push_back(row.data());
  const std::vector<float> weights = random_weights(random, kRows);
  expect_sums([&](std::size_t count,
                  float* out) { combine_rows(pointers.data(), weights.data(), kRows, count, out); },
              [&](std::size_t i) {
                double sum = 0.0;
                for (std::size_t row = 0; row < kRows; ++row)
                  sum += static_cast<double>(weights[row]) * static_cast<double>(rows[row][i]);
                return sum;
              });
}

TEST(CombineTables, IsALoopOverTheRowsOfEachRange) {
  std::mt19937 random(2);
  constexpr std::size_t kStride = 40;
  constexpr std::size_t kOutStride = 55;
  constexpr std::size_t kAt = 16;
  const std::vector<RowRange> ranges{{0, 1, 0}, {2, 5, 16}, {0, kRows, 96}};
  const std::vector<float> weights = random_weights(random, 96 + kRows * kRowPart);
  for (std::size_t count = 1; count <= 9; ++count) {  // more than two groups of four tables
    std::vector<std::vector<float>> tables;
    std::vector<std::vector<float>> sums(count, std::vector<float>(ranges.size() * kOutStride, -7));
    std::vector<const float*> in;
    std::vector<float*> out;
    for (std::size_t t = 0; t < count; ++t) {
      tables.push_back(random_weights(random, kRows * kStride));
      in.push_back(tables[t].data());
      out.push_back(sums[t].data());
    }
    combine_tables(ranges, weights.data(), kAt, count, {in.data(), kStride},
                   {out.data(), kOutStride});
    for (std::size_t t = 0; t < count; ++t)
      for (std::size_t n = 0; n < ranges.size(); ++n)
        for (std::size_t i = 0; i < kOutStride; ++i) {
          double sum = -7.0;  // remains beside the part that is summed
          if (i >= kAt && i < kAt + kRowPart) {
            sum = 0.0;
            for (std::size_t r = 0; r < ranges[n].rows; ++r)
              sum += static_cast<double>(weights[ranges[n].first_weight + r * kRowPart + i - kAt]) *
                     static_cast<double>(tables[t][(ranges[n].first_row + r) * kStride + i]);
          }
          ASSERT_NEAR(sums[t][n * kOutStride + i], sum, 1e-5) << count << ' ' << t << ' ' << n;
        }
  }
}

}  // namespace
}  // namespace usct::test
