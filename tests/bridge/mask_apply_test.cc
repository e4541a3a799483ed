// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_apply.h"

#include "tests/bridge/sample_databases.h"
#include "tests/bridge/sample_masks.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

class MaskApplyTest : public testing::Test {
 protected:
  MaskApplyTest() {
    MakeSampleDatabase(database_path_);
    WriteSampleMasks(mask_folder_);
  }

  const TemporaryFolder folder_;
  const std::filesystem::path database_path_ = folder_ / "a.db";
  const std::filesystem::path mask_folder_ = folder_ / "masks";
  const std::filesystem::path output_path_ = folder_ / "b.db";
};

TEST_F(MaskApplyTest, ExactlyTheRowsWithAnExcludedEndpointGo) {
  const auto before = Snapshot(folder_.path());
  ApplyMasks(database_path_, mask_folder_, output_path_, {});
  const ColmapDatabase output(output_path_, ColmapDatabase::Mode::kReadOnly);
  EXPECT_EQ(output.ReadMatches(1, 2), (FeatureMatches{{1, 1}, {2, 2}, {1, 1}}));
  EXPECT_EQ(output.ReadMatches(1, 3), (FeatureMatches{{1, 0}}));
  EXPECT_TRUE(output.ReadMatches(2, 3).empty());
  EXPECT_EQ(output.ReadMatchPairs().size(), 3u);
  const TwoViewGeometry geometry = output.ReadTwoViewGeometry(1, 2).value();
  EXPECT_EQ(geometry.inlier_matches, (FeatureMatches{{1, 1}}));
  EXPECT_EQ(geometry.config, 2);
  EXPECT_EQ((*geometry.F)(2, 2), 10.0);
  const TwoViewGeometry emptied = output.ReadTwoViewGeometry(2, 3).value();
  EXPECT_TRUE(emptied.inlier_matches.empty());
  EXPECT_EQ(emptied.config, 0);
  EXPECT_EQ((*emptied.F)(2, 2), 10.0);
  // Indices stay valid: keypoints and descriptors are those of before.
  EXPECT_EQ(output.ReadKeypoints(1)->rows, 4u);
  EXPECT_EQ(output.ReadDescriptors(1)->rows, 4u);

  auto after = Snapshot(folder_.path());
  EXPECT_EQ(after.erase("b.db"), 1u);
  EXPECT_EQ(after, before);
}

TEST_F(MaskApplyTest, TheSummaryCountsKeypointsAndMatches) {
  const ApplyMasksSummary summary = ApplyMasks(database_path_, mask_folder_, output_path_, {});
  ASSERT_EQ(summary.images.size(), 3u);
  EXPECT_EQ(summary.images[0].image_name, "a.jpg");
  EXPECT_EQ(summary.images[1].image_name, "c d.jpg");
  EXPECT_EQ(summary.images[2].image_name, "sub/b.png");
  EXPECT_EQ(summary.images[0].num_excluded_keypoints, 2u);  // 0 and 3; x = 50 is kept
  EXPECT_EQ(summary.images[1].num_excluded_keypoints, 3u);  // 1, 2 (y = 40) and 3
  EXPECT_EQ(summary.images[2].num_excluded_keypoints, 1u);  // outside of the frame
  EXPECT_EQ(summary.images[2].num_keypoints, 5u);
  EXPECT_TRUE(summary.images[2].has_mask);
  EXPECT_EQ(summary.num_matches_before, 12u);
  EXPECT_EQ(summary.num_matches_after, 4u);
  EXPECT_EQ(summary.num_inlier_matches_before, 4u);
  EXPECT_EQ(summary.num_inlier_matches_after, 1u);
}

TEST_F(MaskApplyTest, InPlaceHoldsTheSameRowsAsTheCopy) {
  ApplyMasks(database_path_, mask_folder_, output_path_, {});
  ApplyMasks(database_path_, mask_folder_, "", {.in_place = true});
  EXPECT_EQ(DumpRows(database_path_), DumpRows(output_path_));
  EXPECT_NE(DumpRows(database_path_).find("two_view_geometries: "), std::string::npos);
}

TEST_F(MaskApplyTest, ApplyingAgainChangesNoByte) {
  ApplyMasks(database_path_, mask_folder_, database_path_, {.in_place = true});
  const auto before = Snapshot(folder_.path());
  const auto summary = ApplyMasks(database_path_, mask_folder_, "", {.in_place = true});
  EXPECT_EQ(summary.num_matches_before, 4u);
  EXPECT_EQ(summary.num_matches_after, 4u);
  EXPECT_EQ(Snapshot(folder_.path()), before);
}

TEST_F(MaskApplyTest, EveryVersionOfTheDatabaseIsTaken) {
  for (const VersionTables& tables : kVersions) {
    const auto path = folder_ / (std::string(tables.version) + ".db");
    const std::string values =
        std::string(*tables.descriptor_type != '\0' ? "7, " : "") + "1, 2, x'0102'";
    RunSql(path,
           SchemaSql(tables) +
               "INSERT INTO cameras VALUES (1, 16, 100, 80, zeroblob(48), 0);"  // EUCM of COLMAP 4
               "INSERT INTO images (image_id, name, camera_id) VALUES (1, 'a.jpg', 1), (3, 'c "
               "d.jpg', 1);"
               "INSERT INTO keypoints VALUES (1, 1, 2, zeroblob(8)), (3, 1, 2, zeroblob(8));"
               "INSERT INTO descriptors VALUES (1, " +
               values +
               ");"
               "INSERT INTO matches VALUES (2147483650, 1, 2, zeroblob(8));"
               "INSERT INTO two_view_geometries (pair_id, rows, cols, data, config) "
               "VALUES (2147483650, 1, 2, zeroblob(8), 2);");
    const auto summary = ApplyMasks(path, mask_folder_, output_path_, {.overwrite = true});
    EXPECT_EQ(summary.num_matches_before, 1u) << tables.version;
    EXPECT_EQ(summary.num_matches_after, 0u) << tables.version;
    EXPECT_EQ(summary.num_inlier_matches_after, 0u) << tables.version;
    const ColmapDatabase output(output_path_, ColmapDatabase::Mode::kReadOnly);
    EXPECT_EQ(output.schema().Describe(),
              ColmapDatabase(path, ColmapDatabase::Mode::kReadOnly).schema().Describe());
  }
}

TEST_F(MaskApplyTest, AMissingMaskIsAnErrorUnlessAllowed) {
  std::filesystem::remove(mask_folder_ / "a.jpg.png");
  const auto before = Snapshot(folder_.path());
  const std::string error =
      ErrorOf([&] { ApplyMasks(database_path_, mask_folder_, output_path_, {}); });
  EXPECT_THAT(error, HasSubstr("a.jpg.png: is missing (1 of 3 images have no mask)"));
  EXPECT_EQ(Snapshot(folder_.path()), before);
  const auto summary =
      ApplyMasks(database_path_, mask_folder_, output_path_, {.allow_missing_masks = true});
  EXPECT_FALSE(summary.images[0].has_mask);
  EXPECT_EQ(summary.images[0].num_excluded_keypoints, 0u);
  EXPECT_EQ(summary.num_matches_after, 7u);  // all of (1, 2); (0, 0) and (1, 0) of (1, 3)
}

TEST_F(MaskApplyTest, TheThreadsDoNotMatterAndProgressEndsAtTheTotal) {
  int64_t last_done = 0;
  int64_t last_total = 0;
  const auto progress = [&](int64_t done, int64_t total) {
    EXPECT_GT(done, last_done);
    last_done = done;
    last_total = total;
  };
  ApplyMasks(database_path_, mask_folder_, folder_ / "one.db", {.num_threads = 1}, progress);
  EXPECT_EQ(last_done, 8);  // 3 images, 3 + 2 pairs
  EXPECT_EQ(last_total, 8);
  ApplyMasks(database_path_, mask_folder_, folder_ / "four.db", {.num_threads = 4});
  const auto files = Snapshot(folder_.path());
  EXPECT_TRUE(files.at("one.db") == files.at("four.db"));
}

TEST_F(MaskApplyTest, ReplacesTheOutputOnlyWhenAsked) {
  ApplyMasks(database_path_, mask_folder_, output_path_, {});
  const auto before = Snapshot(folder_.path());
  const auto apply = [&](const std::filesystem::path& output, bool overwrite) {
    return ErrorOf(
        [&] { ApplyMasks(database_path_, mask_folder_, output, {.overwrite = overwrite}); });
  };
  EXPECT_THAT(apply(output_path_, false), HasSubstr("b.db: exists"));
  EXPECT_THAT(apply(database_path_, true), HasSubstr("is the database to be read"));
  EXPECT_THAT(apply(folder_ / "masks/../a.db", true), HasSubstr("is the database to be read"));
  EXPECT_EQ(Snapshot(folder_.path()), before);
  EXPECT_EQ(apply(output_path_, true), "");
}

TEST_F(MaskApplyTest, WhatLiesInTheWalIsPartOfTheDatabase) {
  SqliteConnection writer(database_path_, SqliteConnection::Mode::kReadWrite);
  writer.ExecuteScript(
      "PRAGMA journal_mode = WAL; DELETE FROM matches WHERE pair_id = 2147483649;");
  ASSERT_TRUE(std::filesystem::exists(database_path_.string() + "-wal"));
  const auto summary = ApplyMasks(database_path_, mask_folder_, output_path_, {});
  EXPECT_EQ(summary.num_matches_before, 7u);
  EXPECT_EQ(ColmapDatabase(output_path_, ColmapDatabase::Mode::kReadOnly).ReadMatchPairs().size(),
            2u);
}

TEST_F(MaskApplyTest, CountExcludedKeypointsOnlyCounts) {
  std::filesystem::remove(mask_folder_ / "a.jpg.png");
  const auto before = Snapshot(folder_.path());
  const auto images = CountExcludedKeypoints(database_path_, mask_folder_);
  ASSERT_EQ(images.size(), 3u);
  EXPECT_FALSE(images[0].has_mask);
  EXPECT_EQ(images[0].num_excluded_keypoints, 0u);
  EXPECT_EQ(images[1].num_excluded_keypoints, 3u);
  const auto unmasked = CountExcludedKeypoints(database_path_, "");
  EXPECT_EQ(unmasked[2].num_keypoints, 5u);
  EXPECT_EQ(unmasked[2].num_excluded_keypoints, 0u);
  EXPECT_EQ(Snapshot(folder_.path()), before);
}

}  // namespace
}  // namespace vgtw
