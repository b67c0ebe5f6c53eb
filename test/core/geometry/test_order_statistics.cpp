#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

#include "order_statistics.h"

namespace usct::test {
namespace {

TEST(OrderStatistics, MedianIsTheMiddleValueOrTheMeanOfTheTwoInTheMiddle) {
  EXPECT_EQ(median({7.0}), 7.0);
  EXPECT_EQ(median({9.0, 1.0, 4.0}), 4.0);
  EXPECT_EQ(median({9.0, 1.0, 4.0, 5.0}), 4.5);
}

TEST(OrderStatistics, AQuantileIsTheValueOfTheNearestRank) {
  const std::vector<float> values{30.0F, 10.0F, 50.0F, 20.0F, 40.0F};
  EXPECT_EQ(nearest_quantile(values, 0.0), 10.0F);
  EXPECT_EQ(nearest_quantile(values, 0.12), 10.0F);  // rank 0.48
  EXPECT_EQ(nearest_quantile(values, 0.13), 20.0F);  // rank 0.52
  EXPECT_EQ(nearest_quantile(values, 1.0), 50.0F);
}

RC_GTEST_PROP(OrderStatistics, AsManyValuesAreBelowAndAboveAsTheRankSays,
              (const std::vector<int>& any)) {
  RC_PRE(!any.empty());
  const auto rank = *rc::gen::inRange<std::size_t>(0, any.size());
  const int value = value_of_rank(any, rank);
  const auto count = [&](auto is_counted) {
    return static_cast<std::size_t>(std::count_if(any.begin(), any.end(), is_counted));
  };
  RC_ASSERT(count([&](int other) { return other < value; }) <= rank);
  RC_ASSERT(count([&](int other) { return other <= value; }) > rank);
}

}  // namespace
}  // namespace usct::test
