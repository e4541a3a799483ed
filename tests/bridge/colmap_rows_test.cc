// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_rows.h"

#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

// Evaluates "SELECT <values>" and gives its row to `read`.
template <typename Read>
void WithRow(const std::string& values, const Read& read) {
  const TemporaryFolder folder;
  SqliteConnection connection(folder / "a.db", SqliteConnection::Mode::kPrivate);
  SqliteQuery query(connection, "SELECT " + values);
  ASSERT_TRUE(query.Next());
  read(query);
}

TEST(MatrixBlob, SizeMustBeTheProduct) {
  WithRow("2, 3, zeroblob(24)", [](const SqliteQuery& query) {
    const MatrixBlob blob = ReadMatrixBlob(query, 0, 4, "x");
    EXPECT_EQ(blob.rows, 2u);
    EXPECT_EQ(blob.cols, 3u);
    EXPECT_EQ(blob.bytes.size(), 24u);
  });
  // The last two products are 0 modulo 2^64 and 2^32.
  for (const std::string values : {"2, 3, zeroblob(23)",
                                   "2, 3, NULL",
                                   "-1, -24, zeroblob(96)",
                                   "4611686018427387904, 4, NULL",
                                   "65536, 16384, NULL"}) {
    WithRow(values, [&](const SqliteQuery& query) {
      EXPECT_THAT(ErrorOf([&] { ReadMatrixBlob(query, 0, 4, "keypoints of image 3"); }),
                  HasSubstr("keypoints of image 3 has "))
          << values;
    });
  }
}

TEST(MatrixBlob, KeypointsHaveTwoFourOrSixColumns) {
  for (const int cols : {2, 4, 6}) {
    WithRow("1, " + std::to_string(cols) + ", zeroblob(" + std::to_string(4 * cols) + ")",
            [&](const SqliteQuery& query) { EXPECT_EQ(ReadKeypointsBlob(query, 0, 3).rows, 1u); });
  }
  WithRow("1, 3, zeroblob(12)", [](const SqliteQuery& query) {
    EXPECT_THAT(ErrorOf([&] { ReadKeypointsBlob(query, 0, 3); }), HasSubstr("3 columns"));
  });
  WithRow("0, 0, NULL",
          [](const SqliteQuery& query) { EXPECT_EQ(ReadKeypointsBlob(query, 0, 3).rows, 0u); });
}

TEST(Matches, AreLittleEndianPairs) {
  WithRow("2, 2, x'01000000020000000300000000010000'", [](const SqliteQuery& query) {
    EXPECT_EQ(ReadMatchesBlob(query, 0, "m"), (FeatureMatches{{1, 2}, {3, 256}}));
  });
  WithRow("1, 3, zeroblob(12)", [](const SqliteQuery& query) {
    EXPECT_THAT(ErrorOf([&] { ReadMatchesBlob(query, 0, "m"); }), HasSubstr("3 columns"));
  });
}

TEST(CheckedImageIds, OnlyOrderedPairsPass) {
  WithRow("1", [](const SqliteQuery& query) {
    // 2147483647 * 3 + 7, by hand.
    EXPECT_EQ(CheckedImageIds(query, 6442450948), (std::pair<ImageId, ImageId>{3, 7}));
    for (const int64_t pair_id : {int64_t{-1}, int64_t{0}, int64_t{6442450944}, INT64_MAX}) {
      EXPECT_THAT(ErrorOf([&] { CheckedImageIds(query, pair_id); }), HasSubstr("holds pair id"))
          << pair_id;
    }
  });
}

TEST(CheckedId, FitsIn32Bits) {
  WithRow("4294967295, 4294967296, -1", [](const SqliteQuery& query) {
    EXPECT_EQ(CheckedId(query, 0, "camera"), 4294967295u);
    EXPECT_THAT(ErrorOf([&] { CheckedId(query, 1, "camera"); }), HasSubstr("camera id 4294967296"));
    EXPECT_THAT(ErrorOf([&] { CheckedId(query, 2, "camera"); }), HasSubstr("camera id -1"));
  });
}

TEST(ReadDoubles, NullIsNothingAndOtherSizesAreErrors) {
  WithRow("NULL, zeroblob(16), zeroblob(15)", [](const SqliteQuery& query) {
    EXPECT_FALSE(ReadDoubles<2>(query, 0, "x"));
    EXPECT_EQ(ReadDoubles<2>(query, 1, "x"), (std::array<double, 2>{0.0, 0.0}));
    EXPECT_THAT(ErrorOf([&] { ReadDoubles<2>(query, 2, "x"); }), HasSubstr("15 bytes"));
  });
}

}  // namespace
}  // namespace vgtw
