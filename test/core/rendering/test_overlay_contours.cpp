#include <gtest/gtest.h>

#include "rendering/overlay_contours.h"

namespace usct::test {
namespace {

/// The number of pixels of a small image that a disc in its middle marks.
int marked_by_disc(double radius_px) {
  rendering::Marks marks;
  marks.reset(40, 30);
  marks.add_disc(20, 15, radius_px);
  int count = 0;
  for (int y = 0; y < marks.height(); ++y)
    for (int x = 0; x < 40; ++x) count += marks.row(y)[x] != 0 ? 1 : 0;
  return count;
}

TEST(Marks, HoldTheWholeImageHoweverFarADiscReaches) {
  EXPECT_EQ(marked_by_disc(2.0), 13);
  for (const double radius_px : {50.0, 1e6, 3e9, 1e12, 1e200})
    EXPECT_EQ(marked_by_disc(radius_px), 40 * 30) << radius_px;
}

}  // namespace
}  // namespace usct::test
