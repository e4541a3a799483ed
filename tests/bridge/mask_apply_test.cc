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
  ApplyMasks(database_path_, mask_folder_, output_path_, {.min_num_inliers = 0});
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
  const ApplyMasksSummary summary =
      ApplyMasks(database_path_, mask_folder_, output_path_, {.min_num_inliers = 0});
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
  EXPECT_EQ(summary.disconnected_images, (std::vector<std::string>{"c d.jpg"}));
}

TEST_F(MaskApplyTest, InPlaceHoldsTheSameRowsAsTheCopy) {
  ApplyMasks(database_path_, mask_folder_, output_path_, {.min_num_inliers = 0});
  ApplyMasks(database_path_, mask_folder_, "", {.min_num_inliers = 0, .in_place = true});
  EXPECT_EQ(DumpRows(database_path_), DumpRows(output_path_));
  EXPECT_NE(DumpRows(database_path_).find("two_view_geometries: "), std::string::npos);
}

// The keypoints rule leaves what masked extraction would have: rows in their order, indices counted
// anew. a.jpg keeps 1 and 2, sub/b.png 0 to 3, "c d.jpg" 0.
TEST_F(MaskApplyTest, TheKeypointsRuleRemovesAndRenumbersEverywhere) {
  const auto summary = ApplyMasks(database_path_,
                                  mask_folder_,
                                  output_path_,
                                  {.rule = MaskRule::kKeypoints, .min_num_inliers = 0});
  const ColmapDatabase output(output_path_, ColmapDatabase::Mode::kReadOnly);
  EXPECT_EQ(output.ReadKeypoints(1)->data, (std::vector<float>{99.9f, 79.9f, 50.0f, 40.0f}));
  EXPECT_EQ(output.ReadDescriptors(1)->data, (std::vector<uint8_t>{3, 4, 5, 6}));
  EXPECT_EQ(output.ReadDescriptors(1)->rows, 2u);
  EXPECT_EQ(output.ReadKeypoints(2)->rows, 4u);
  EXPECT_EQ(output.ReadKeypoints(3)->data, (std::vector<float>{10.5f, 10.5f, 1, 0}));
  EXPECT_EQ(output.ReadMatches(1, 2), (FeatureMatches{{0, 1}, {1, 2}, {0, 1}}));
  EXPECT_EQ(output.ReadMatches(1, 3), (FeatureMatches{{0, 0}}));
  EXPECT_EQ(output.ReadTwoViewGeometry(1, 2)->inlier_matches, (FeatureMatches{{0, 1}}));
  EXPECT_EQ(summary.num_matches_after, 4u);
  EXPECT_EQ(summary.images[0].num_keypoints, 4u);
  for (const auto& image : CountExcludedKeypoints(output_path_, mask_folder_)) {
    EXPECT_EQ(image.num_excluded_keypoints, 0u) << image.image_name;
  }
}

TEST_F(MaskApplyTest, AGeometryBelowTheMinimumIsEmptiedIfItLostRows) {
  {
    ColmapDatabase database(database_path_, ColmapDatabase::Mode::kReadWrite);
    ColmapDatabase::Transaction transaction(database);
    database.WriteTwoViewGeometry(1, 2, {.config = 2, .inlier_matches = {{1, 1}, {2, 2}, {3, 3}}});
    database.WriteTwoViewGeometry(1, 3, {.config = 3, .inlier_matches = {{1, 0}}});
    transaction.Commit();
  }
  const auto inliers_with = [&](int min_num_inliers) {
    const auto summary = ApplyMasks(database_path_,
                                    mask_folder_,
                                    output_path_,
                                    {.min_num_inliers = min_num_inliers, .overwrite = true});
    EXPECT_EQ(summary.num_geometries_before, 3u);
    EXPECT_EQ(summary.num_matches_after, 4u);  // matches have no minimum
    const ColmapDatabase output(output_path_, ColmapDatabase::Mode::kReadOnly);
    EXPECT_EQ(output.ReadTwoViewGeometry(1, 3)->inlier_matches.size(), 1u);  // lost none
    const TwoViewGeometry geometry = output.ReadTwoViewGeometry(1, 2).value();
    EXPECT_EQ(geometry.config, geometry.inlier_matches.empty() ? 0 : 2);
    EXPECT_EQ(summary.num_geometries_after, geometry.inlier_matches.empty() ? 1u : 2u);
    return geometry.inlier_matches.size();
  };
  EXPECT_EQ(inliers_with(2), 2u);
  EXPECT_EQ(inliers_with(3), 0u);
}

// a.jpg excludes x < 50, so a keypoint at x = 99.9 is 50 pixels from the last excluded column (49),
// at x = 50 one; "c d.jpg" excludes y >= 40, its keypoint at y = 10.5 is 30 pixels away.
TEST_F(MaskApplyTest, DilationExcludesKeypointsNearDistractors) {
  const auto num_excluded = [&](const ApplyMasksOptions& options) {
    const auto summary = ApplyMasks(database_path_, mask_folder_, output_path_, options);
    std::vector<uint64_t> counts;
    for (const auto& image : summary.images) counts.push_back(image.num_excluded_keypoints);
    return counts;
  };
  using Counts = std::vector<uint64_t>;
  EXPECT_EQ(num_excluded({.dilate_px = 1, .overwrite = true}), (Counts{3, 3, 1}));
  EXPECT_EQ(num_excluded({.dilate_px = 29, .overwrite = true}), (Counts{3, 3, 1}));
  EXPECT_EQ(num_excluded({.dilate_px = 30, .overwrite = true}), (Counts{3, 4, 1}));
  EXPECT_EQ(num_excluded({.dilate_px = 49, .overwrite = true}), (Counts{3, 4, 1}));
  EXPECT_EQ(num_excluded({.dilate_px = 50, .overwrite = true}), (Counts{4, 4, 1}));
}

// Four columns hold the scale itself, 1 in "c d.jpg"; six hold the affine shape: the columns
// (3, 4) and (0, 5) have length 5.
TEST_F(MaskApplyTest, DilationByScaleIsThatOfTheFeature) {
  const auto excluded_of = [&](const char* name, double dilate_px, double dilate_scale) {
    const auto summary = ApplyMasks(database_path_,
                                    mask_folder_,
                                    output_path_,
                                    {.dilate_px = static_cast<int>(dilate_px),
                                     .dilate_scale = dilate_scale,
                                     .overwrite = true});
    for (const auto& image : summary.images) {
      if (image.image_name == name) return image.num_excluded_keypoints;
    }
    return uint64_t{0};
  };
  EXPECT_THAT(ErrorOf([&] { excluded_of("c d.jpg", 0, 1.0); }),
              HasSubstr("keypoints of image 1 have no scale (2 columns), expected 4 or 6"));
  {
    ColmapDatabase database(database_path_, ColmapDatabase::Mode::kReadWrite);
    ColmapDatabase::Transaction transaction(database);
    std::vector<float> data;
    for (const float x : {10.5f, 99.9f, 50.0f, 20.25f}) {
      data.insert(data.end(), {x, 10.5f, 3.0f, 0.0f, 4.0f, 5.0f});
    }
    database.WriteKeypoints(1, {4, 6, data});
    database.WriteKeypoints(2, {5, 6, std::vector<float>(30, 1.0f)});
    transaction.Commit();
  }
  EXPECT_EQ(excluded_of("c d.jpg", 0, 29.9), 3u);
  EXPECT_EQ(excluded_of("c d.jpg", 0, 30.0), 4u);
  EXPECT_EQ(excluded_of("c d.jpg", 10, 20.0), 4u);
  EXPECT_EQ(excluded_of("a.jpg", 0, 9.9), 3u);  // 49.5 < 50
  EXPECT_EQ(excluded_of("a.jpg", 0, 10.0), 4u);
}

// Three views. Inlier matches make the tracks a0-b0-c0, a1-b1-c1, a2-b2 and, without a match
// between them, c2. The mask covers keypoint 0 of c.jpg alone.
TEST(MaskApplyTracks, AMaskedObservationRemovesItsWholeTrack) {
  const TemporaryFolder folder;
  const auto path = folder / "a.db";
  {
    Camera camera = MakePinhole(100, 80, 90.0, 90.0);
    camera.camera_id = 1;
    ColmapDatabase database = ColmapDatabase::Create(path);
    ColmapDatabase::Transaction transaction(database);
    database.WriteCamera(camera);
    for (const ImageId image_id : {1, 2, 3}) {
      database.WriteImage({image_id, std::string(1, "?abc"[image_id]) + ".jpg", 1});
      database.WriteKeypoints(image_id, {3, 2, {10.0f, 10.0f, 50.0f, 50.0f, 90.0f, 70.0f}});
      const std::string name = std::string(1, "?abc"[image_id]) + ".jpg";
      StaticMask static_mask(100, 80, 255);
      if (image_id == 3) static_mask(10, 10) = 0;
      WriteImage(MaskPath(folder / "masks", name), static_mask);
    }
    const FeatureMatches ab = {{0, 0}, {1, 1}, {2, 2}};
    const FeatureMatches bc = {{0, 0}, {1, 1}};
    database.WriteMatches(1, 2, {{0, 0}, {1, 1}, {2, 2}, {1, 0}});  // 1-0 was no inlier
    database.WriteMatches(2, 3, bc);
    database.WriteMatches(1, 3, {{2, 2}});  // nor was this
    database.WriteTwoViewGeometry(1, 2, {.config = 2, .inlier_matches = ab});
    database.WriteTwoViewGeometry(2, 3, {.config = 2, .inlier_matches = bc});
    transaction.Commit();
  }
  const auto summary = ApplyMasks(
      path, folder / "masks", folder / "b.db", {.rule = MaskRule::kTracks, .min_num_inliers = 0});
  EXPECT_EQ(summary.images[2].num_excluded_keypoints, 1u);
  EXPECT_EQ(summary.num_linked_keypoints, 2u);  // a0 and b0
  const ColmapDatabase output(folder / "b.db", ColmapDatabase::Mode::kReadOnly);
  EXPECT_EQ(output.ReadTwoViewGeometry(1, 2)->inlier_matches, (FeatureMatches{{1, 1}, {2, 2}}));
  EXPECT_EQ(output.ReadTwoViewGeometry(2, 3)->inlier_matches, (FeatureMatches{{1, 1}}));
  EXPECT_EQ(output.ReadMatches(1, 2), (FeatureMatches{{1, 1}, {2, 2}}));
  EXPECT_EQ(output.ReadMatches(2, 3), (FeatureMatches{{1, 1}}));
  EXPECT_EQ(output.ReadMatches(1, 3), (FeatureMatches{{2, 2}}));
  EXPECT_EQ(output.ReadKeypoints(1)->rows, 3u);
}

TEST_F(MaskApplyTest, ApplyingAgainChangesNoByte) {
  ApplyMasks(
      database_path_, mask_folder_, database_path_, {.min_num_inliers = 0, .in_place = true});
  const auto before = Snapshot(folder_.path());
  const auto summary =
      ApplyMasks(database_path_, mask_folder_, "", {.min_num_inliers = 0, .in_place = true});
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
    const auto summary =
        ApplyMasks(path, mask_folder_, output_path_, {.min_num_inliers = 0, .overwrite = true});
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
  const std::string error = ErrorOf(
      [&] { ApplyMasks(database_path_, mask_folder_, output_path_, {.min_num_inliers = 0}); });
  EXPECT_THAT(error, HasSubstr("a.jpg.png: is missing (1 of 3 images have no mask)"));
  EXPECT_EQ(Snapshot(folder_.path()), before);
  const auto summary = ApplyMasks(database_path_,
                                  mask_folder_,
                                  output_path_,
                                  {.min_num_inliers = 0, .allow_missing_masks = true});
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
  ApplyMasks(database_path_,
             mask_folder_,
             folder_ / "one.db",
             {.min_num_inliers = 0, .num_threads = 1},
             progress);
  EXPECT_EQ(last_done, 8);  // 3 images, 3 + 2 pairs
  EXPECT_EQ(last_total, 8);
  ApplyMasks(
      database_path_, mask_folder_, folder_ / "four.db", {.min_num_inliers = 0, .num_threads = 4});
  const auto files = Snapshot(folder_.path());
  EXPECT_TRUE(files.at("one.db") == files.at("four.db"));
}

TEST_F(MaskApplyTest, ReplacesTheOutputOnlyWhenAsked) {
  ApplyMasks(database_path_, mask_folder_, output_path_, {.min_num_inliers = 0});
  const auto before = Snapshot(folder_.path());
  const auto apply = [&](const std::filesystem::path& output, bool overwrite) {
    return ErrorOf([&] {
      ApplyMasks(
          database_path_, mask_folder_, output, {.min_num_inliers = 0, .overwrite = overwrite});
    });
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
  const auto summary =
      ApplyMasks(database_path_, mask_folder_, output_path_, {.min_num_inliers = 0});
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
