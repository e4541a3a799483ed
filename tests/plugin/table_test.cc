// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/table.h"

#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(Table, AlignsFirstColumnLeftAndOthersRight) {
  EXPECT_EQ(FormatTable({{"photo", "points"}, {"a.jpg", "7"}, {"long name.jpg", "1234567"}}),
            "photo           points\n"
            "----------------------\n"
            "a.jpg                7\n"
            "long name.jpg  1234567\n");
}

TEST(Table, ShortRowsLeaveCellsEmpty) {
  EXPECT_EQ(FormatTable({{"a", "b"}, {"x"}}), "a  b\n----\nx\n");
}

TEST(FormatNumber, RoundsAndMarksMissing) {
  EXPECT_EQ(FormatNumber(1.2345, 2), "1.23");
  EXPECT_EQ(FormatNumber(-0.5, 0), "-0");
  EXPECT_EQ(FormatNumber(std::numeric_limits<double>::quiet_NaN(), 3), "-");
  EXPECT_EQ(FormatNumber(std::numeric_limits<double>::infinity(), 3), "-");
}

}  // namespace
}  // namespace vgtw
