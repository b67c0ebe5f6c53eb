#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>

#include "random_geometry.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/monotonic_table.h"

namespace usct {
namespace {

using test::integer;
using test::uneven_table;
using test::uniform;

RC_GTEST_PROP(MonotonicTable, IndexOfIsTheInverseOfAtWithinAndBeyondTheTable, ()) {
  const int count = integer(2, 300);
  const MonotonicTable table(uneven_table(count, -7.0, 11.0), "probe.yaml", "frame_angles");
  const double index = uniform(-3.0, count + 3.0);
  RC_ASSERT(std::abs(table.index_of(table.at(index)) - index) < 1e-9 * count);
}

RC_GTEST_PROP(MonotonicTable, EntriesAreFoundAtTheirOwnIndices, ()) {
  const std::vector<double> values = uneven_table(integer(2, 300), -7.0, 11.0);
  const MonotonicTable table(values, "probe.yaml", "frame_angles");
  const auto i = static_cast<std::size_t>(integer(0, static_cast<int>(values.size())));
  RC_ASSERT(std::abs(table.index_of(values[i]) - static_cast<double>(i)) < 1e-9);
  RC_ASSERT(std::abs(table.at(static_cast<double>(i)) - values[i]) < 1e-12);
}

TEST(MonotonicTable, AVeryUnevenTableIsSearchedToTheEnd) {
  std::vector<double> values;
  for (int i = 0; i < 40; ++i) values.push_back(std::pow(2.0, i));
  const MonotonicTable table(values, "t", "f");
  EXPECT_NEAR(table.index_of(3.0), 1.5, 1e-12);
  EXPECT_NEAR(table.index_of(0.5), -0.5, 1e-12);
  EXPECT_NEAR(table.index_of(std::pow(2.0, 38.0) * 1.5), 38.5, 1e-9);
}

TEST(MonotonicTable, NotANumberStaysNotANumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const auto& values : {std::vector<double>{0, 1, 3}, std::vector<double>{3, 1, 0}}) {
    const MonotonicTable table(values, "t", "f");
    EXPECT_TRUE(std::isnan(table.index_of(nan)));
    EXPECT_TRUE(std::isnan(table.at(nan)));
  }
}

TEST(MonotonicTable, RefusesWhatIsNotMonotonicAndNamesTheEntry) {
  const auto violation = [](std::vector<double> values) -> std::string {
    try {
      MonotonicTable(std::move(values), "probe.yaml", "frame_angles");
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(violation({1.0}), "probe.yaml: 'frame_angles' has 1 entries, must have at least 2");
  EXPECT_EQ(
      violation({0.0, 1.0, 1.0}),
      "probe.yaml: 'frame_angles' entry 2 is 1.000000 after 1.000000, must be strictly rising "
      "or strictly falling");
  EXPECT_NE(violation({0.0, -1.0, 2.0}).find("entry 2 is 2.0"), std::string::npos);
  EXPECT_NE(violation({0.0, std::nan("")}).find("entry 1 is nan, must be finite"),
            std::string::npos);
}

TEST(CentredTable, IsSymmetricAboutZero) {
  EXPECT_EQ(centred_table(4, 2.0), (std::vector<double>{-3.0, -1.0, 1.0, 3.0}));
  EXPECT_EQ(centred_table(3, -0.5), (std::vector<double>{0.5, 0.0, -0.5}));
}

}  // namespace
}  // namespace usct
