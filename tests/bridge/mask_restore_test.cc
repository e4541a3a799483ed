// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_restore.h"

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

constexpr MaskRule kRules[] = {MaskRule::kMatches, MaskRule::kKeypoints, MaskRule::kTracks};

class MaskRestoreTest : public testing::TestWithParam<MaskRule> {
 protected:
  MaskRestoreTest() {
    MakeSampleDatabase(path_);
    original_ = DumpRows(path_);
    WriteSampleMasks(mask_folder_);
  }

  void ApplyTo(const std::filesystem::path& path, int dilate_px = 0) const {
    ApplyMasks(
        path, mask_folder_, "", {.rule = GetParam(), .dilate_px = dilate_px, .in_place = true});
  }
  std::string ErrorOfRestore() const {
    return ErrorOf([&] { RestoreMasks(path_, "", {.in_place = true}); });
  }

  const TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "a.db";
  const std::filesystem::path mask_folder_ = folder_ / "masks";
  std::string original_;
};

TEST_P(MaskRestoreTest, GivesEveryRowItsBytesBack) {
  ApplyTo(path_);
  const std::string applied = DumpRows(path_);
  EXPECT_NE(applied, original_);
  const auto summary = RestoreMasks(path_, folder_ / "b.db", {});
  EXPECT_EQ(DumpRows(folder_ / "b.db"), original_);
  EXPECT_EQ(DumpRows(path_), applied);
  EXPECT_EQ(summary.num_images, GetParam() == MaskRule::kKeypoints ? 3u : 0u);
  EXPECT_EQ(summary.num_matches, 3u);
  EXPECT_EQ(summary.num_geometries, 2u);
  EXPECT_EQ(summary.num_given_up, 0u);
  RestoreMasks(path_, "", {.in_place = true});
  EXPECT_EQ(DumpRows(path_), original_);
}

TEST_P(MaskRestoreTest, UndoesSeveralAppliesAtOnce) {
  for (const int dilate_px : {0, 1, 30}) ApplyTo(path_, dilate_px);
  RestoreMasks(path_, "", {.in_place = true});
  EXPECT_EQ(DumpRows(path_), original_);
  ApplyTo(path_);
  RestoreMasks(path_, "", {.in_place = true});
  EXPECT_EQ(DumpRows(path_), original_);
}

// Indices above 65,535 take 32 bits, those of other pairs 16; both come back.
TEST_P(MaskRestoreTest, LargeIndicesAreKeptWhole) {
  constexpr uint32_t kNumKeypoints = 65'537;
  {
    ColmapDatabase database(path_, ColmapDatabase::Mode::kReadWrite);
    ColmapDatabase::Transaction transaction(database);
    Keypoints keypoints{kNumKeypoints, 2, std::vector<float>(2 * kNumKeypoints, 10.5f)};
    keypoints.data[0] = 60.5f;
    database.WriteKeypoints(1, keypoints);
    database.WriteDescriptors(1, {0, 0, 0, {}});
    database.WriteMatches(1, 2, {{0, 0}, {65'535, 1}, {65'535, 4}});
    database.WriteMatches(1, 3, {{0, 0}, {65'536, 1}});
    transaction.Commit();
  }
  original_ = DumpRows(path_);
  ApplyTo(path_);
  {
    SqliteConnection connection(path_, SqliteConnection::Mode::kReadOnly);
    SqliteQuery query(connection,
                      "SELECT rows, length(data) FROM vgtw_mask_undo "
                      "WHERE table_name = 'matches' ORDER BY row_id LIMIT 2");
    ASSERT_TRUE(query.Next());
    EXPECT_EQ(query.Int(1), 2 * sizeof(uint16_t) * query.Int(0));
    ASSERT_TRUE(query.Next());
    EXPECT_EQ(query.Int(1), 2 * sizeof(uint32_t) * query.Int(0));
  }
  RestoreMasks(path_, "", {.in_place = true});
  EXPECT_EQ(DumpRows(path_), original_);
}

TEST_P(MaskRestoreTest, OfADatabaseInWalModeIsExact) {
  RunSql(path_, "PRAGMA journal_mode = WAL;");
  ApplyTo(path_);
  // What a crashed process leaves: the file and its -wal, whose content is the newest.
  const SqliteConnection writer(path_, SqliteConnection::Mode::kReadWrite);
  const auto crashed = folder_ / "crashed.db";
  {
    SqliteConnection other(path_, SqliteConnection::Mode::kReadWrite);
    other.ExecuteScript("UPDATE cameras SET prior_focal_length = 1;");
    for (const char* suffix : {"", "-wal"}) {
      std::filesystem::copy_file(path_.string() + suffix, crashed.string() + suffix);
    }
  }
  RestoreMasks(crashed, folder_ / "b.db", {});
  RestoreMasks(crashed, "", {.in_place = true});
  for (const auto& path : {crashed, folder_ / "b.db"}) {
    EXPECT_NE(DumpRows(path), original_);  // the camera
    RunSql(path, "UPDATE cameras SET prior_focal_length = 0;");
    EXPECT_EQ(DumpRows(path), original_);
    EXPECT_FALSE(std::filesystem::exists(path.string() + "-wal"));
  }
}

TEST_P(MaskRestoreTest, RefusesToLoseAChangedRowUnlessForced) {
  ApplyTo(path_);
  RunSql(path_,
         "UPDATE matches SET rows = 1, data = x'0000000000000000' WHERE pair_id = 2147483649");
  const auto before = Snapshot(folder_.path());
  EXPECT_THAT(ErrorOfRestore(), HasSubstr("a.db: has 1 rows written since masks were applied"));
  EXPECT_EQ(Snapshot(folder_.path()), before);
  // Another apply does not make it forget.
  ApplyTo(path_, 1);
  EXPECT_THAT(ErrorOfRestore(), HasSubstr("a.db: has 1 rows written since"));
  const auto summary = RestoreMasks(path_, "", {.in_place = true, .force = true});
  EXPECT_EQ(summary.num_given_up, 1u);
  EXPECT_EQ(DumpRows(path_), original_);
}

TEST_P(MaskRestoreTest, DeletedRowsAreNamedAndStayDeleted) {
  ApplyTo(path_);
  RunSql(path_, "DELETE FROM two_view_geometries");
  EXPECT_THAT(ErrorOfRestore(), HasSubstr("has 2 rows written since"));
  const auto summary = RestoreMasks(path_, "", {.in_place = true, .force = true});
  EXPECT_EQ(summary.num_missing, 2u);
  EXPECT_EQ(summary.num_geometries, 0u);
  EXPECT_EQ(summary.num_matches, 3u);
}

// A pair matched after the masks names keypoints as they are then: right for good where no keypoint
// went, wrong once the removed ones are back.
TEST_P(MaskRestoreTest, PairsMatchedSinceStayIfTheyRemainValid) {
  RunSql(path_, "DELETE FROM matches WHERE pair_id = 2147483650");
  original_ = DumpRows(path_);
  ApplyTo(path_);
  // Keypoint 0 of images 1 and 3: after the keypoints rule the original 1 of image 1.
  RunSql(path_, "INSERT INTO matches VALUES (2147483650, 1, 2, x'0000000000000000')");
  const bool is_renumbered = GetParam() == MaskRule::kKeypoints;
  EXPECT_EQ(ErrorOfRestore().empty(), !is_renumbered);
  if (!is_renumbered) {
    const ColmapDatabase database(path_, ColmapDatabase::Mode::kReadOnly);
    EXPECT_EQ(database.ReadMatches(1, 3), (FeatureMatches{{0, 0}}));
    return;
  }
  const auto summary = RestoreMasks(path_, "", {.in_place = true, .force = true});
  EXPECT_EQ(summary.num_given_up, 1u);
  EXPECT_EQ(DumpRows(path_), original_);
}

TEST_P(MaskRestoreTest, FaultsFoundInTheCopyNameTheDatabase) {
  ApplyTo(path_);
  RunSql(path_, "UPDATE vgtw_mask_undo SET table_name = 'cameras' WHERE undo_id = 1");
  EXPECT_THAT(ErrorOf([&] { RestoreMasks(path_, folder_ / "b.db", {}); }),
              HasSubstr("/a.db: keeps a row of the table 'cameras'"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "b.db"));
}

TEST_P(MaskRestoreTest, NothingKeptIsAnError) {
  EXPECT_THAT(ErrorOfRestore(), HasSubstr("a.db: keeps no originals"));
  ApplyMasks(path_, mask_folder_, folder_ / "b.db", {.rule = GetParam(), .keep_undo = false});
  EXPECT_EQ(DumpRows(folder_ / "b.db").find("vgtw"), std::string::npos);
  // Originals kept before would no longer fit after an apply that keeps none.
  ApplyTo(path_);
  ApplyMasks(path_,
             mask_folder_,
             "",
             {.rule = GetParam(), .dilate_px = 30, .keep_undo = false, .in_place = true});
  EXPECT_THAT(ErrorOfRestore(), HasSubstr("a.db: keeps no originals"));
}

TEST_P(MaskRestoreTest, SpoiltOriginalsAreNamed) {
  ApplyTo(path_);
  const auto error_after = [&](const std::string& sql) {
    RunSql(path_, sql);
    const auto before = Snapshot(folder_.path());
    const std::string error =
        ErrorOf([&] { RestoreMasks(path_, "", {.in_place = true, .force = true}); });
    EXPECT_EQ(Snapshot(folder_.path()), before);
    return error;
  };
  EXPECT_THAT(error_after("UPDATE vgtw_mask_undo SET rows = 1000000007 WHERE row_id = 2147483649 "
                          "AND table_name = 'matches'"),
              HasSubstr("keeps 20 bytes for matches 2147483649, expected 1000000007 rows"));
  EXPECT_THAT(error_after("UPDATE vgtw_mask_undo SET table_name = 'sqlite_master' WHERE row_id = "
                          "2147483649 AND table_name = 'matches'"),
              HasSubstr("keeps a row of the table 'sqlite_master'"));
  EXPECT_THAT(error_after("ALTER TABLE vgtw_mask_undo RENAME COLUMN data TO d"),
              HasSubstr("no such column"));
}

INSTANTIATE_TEST_SUITE_P(Rules, MaskRestoreTest, testing::ValuesIn(kRules));

}  // namespace
}  // namespace vgtw
