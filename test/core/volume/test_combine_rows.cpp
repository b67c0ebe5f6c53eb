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

TEST(CombineWeightedRows, IsALoopOverTheRows) {
  std::mt19937 random(2);
  std::vector<std::vector<float>> values;
  std::vector<std::vector<float>> weights;
  std::vector<WeightedRow> rows;
  for (std::size_t row = 0; row < kRows; ++row) {
    values.push_back(random_row<float>(random));
    weights.push_back(random_weights(random, kMostCount));
  }
  for (std::size_t row = 0; row < kRows; ++row)
    rows.push_back({weights[row].data(), values[row].data()});
  expect_sums([&](std::size_t count, float* out) { combine_rows(rows.data(), kRows, count, out); },
              [&](std::size_t i) {
                double sum = 0.0;
                for (std::size_t row = 0; row < kRows; ++row)
                  sum += static_cast<double>(weights[row][i]) * static_cast<double>(values[row][i]);
                return sum;
              });
}

}  // namespace
}  // namespace usct::test
