// SPDX-License-Identifier: BSD-3-Clause
#include "scene/disjoint_sets.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(DisjointSets, JoinOnlyOnce) {
  DisjointSets<> sets(5);
  EXPECT_TRUE(sets.Join(0, 1));
  EXPECT_TRUE(sets.Join(3, 2));
  EXPECT_TRUE(sets.Join(2, 0));
  EXPECT_FALSE(sets.Join(1, 3));
  EXPECT_EQ(sets.num_sets(), 2u);
  EXPECT_EQ(sets.Find(3), sets.Find(1));
  EXPECT_NE(sets.Find(4), sets.Find(1));
}

}  // namespace
}  // namespace vgtw
