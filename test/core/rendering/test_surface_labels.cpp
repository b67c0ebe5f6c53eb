#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "us_ct_registration/error.h"
#include "us_ct_registration/rendering/surface_labels.h"

namespace usct {
namespace {

TEST(SurfaceLabels, NamesAreReadStrictly) {
  const auto names = parse_label_names("1 left kidney;2 tumour ; 300 x", "~label_names");
  EXPECT_THAT(names, testing::ElementsAre(testing::Pair(1, "left kidney"),
                                          testing::Pair(2, "tumour"), testing::Pair(300, "x")));
  EXPECT_TRUE(parse_label_names("", "~label_names").empty());
  for (const char* wrong :
       {"kidney", "1", "1 a; ;2 b", "0 background", "65536 x", "-1 x", "1 a;1 b"})
    EXPECT_THROW(parse_label_names(wrong, "~label_names"), InputError) << wrong;
}

TEST(SurfaceLabels, ALabelWithoutNameIsShownByItsNumber) {
  EXPECT_EQ(label_text(2, {{2, "kidney"}}), "2 kidney");
  EXPECT_EQ(label_text(5, {{2, "kidney"}}), "5 label");
}

TEST(SurfaceLabels, NeighboursHaveDifferentColours) {
  for (int label = 0; label < 20; ++label) EXPECT_NE(label_colour(label), label_colour(label + 1));
}

}  // namespace
}  // namespace usct
