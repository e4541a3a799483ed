// SPDX-License-Identifier: BSD-3-Clause
#include "scene/features.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(Keypoints, ScaleIsThatOfTheColumns) {
  EXPECT_EQ((Keypoints{1, 2, {5, 6}}).Scale(0), 0.0f);
  EXPECT_EQ((Keypoints{2, 4, {5, 6, 1, 0, 7, 8, 2, 0}}).Scale(1), 2.0f);
  // Columns (3, 4) and (-6, 8) of the affine shape are 5 and 10 long.
  EXPECT_EQ((Keypoints{1, 6, {5, 6, 3, -6, 4, 8}}).Scale(0), 7.5f);
}

}  // namespace
}  // namespace vgtw
