// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_lint_database.h"

#include "bridge/colmap_database.h"
#include "tests/bridge/mask_lint_fixture.h"

#include <cmath>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;

// Three photos whose keypoints lie on a grid; matched one to one, and of those on either side of
// column `num_columns` a share is verified.
class MaskLintDatabase : public MaskLint {
 protected:
  struct Scene {
    std::vector<std::string> names = {"a.jpg", "b.jpg", "sub/c.png"};
    int num_columns = 0;     // x < num_columns is one side
    int one_of_left = 0;     // every n-th keypoint of that side is an inlier; 0 = none
    int one_of_right = 0;    // and of the other
    float motion_px = 3.0f;  // of inliers, between photos
    bool match_all = true;   // also rows of `matches`
  };

  void WriteDatabase(const Scene& scene) {
    database_path_ = folder_ / "database.db";
    fs::remove(database_path_);
    ColmapDatabase database = ColmapDatabase::Create(database_path_);
    ColmapDatabase::Transaction transaction(database);
    Camera camera = MakePinhole(kWidth, kHeight, 40.0, 40.0);
    camera.camera_id = 1;
    database.WriteCamera(camera);
    for (ImageId id = 1; id <= 3; ++id) {
      database.WriteImage({id, scene.names[id - 1], 1});
      Keypoints keypoints{kWidth * kHeight, 2, {}};
      const float shift = id == 2 ? scene.motion_px : 0.0f;
      for (int i = 0; i < kWidth * kHeight; ++i) {
        const float x = static_cast<float>(i % kWidth) + 0.5f;
        const float y = static_cast<float>(i / kWidth) + 0.5f;
        // Moves inside of its side.
        keypoints.data.push_back(x);
        keypoints.data.push_back(std::fmod(y + shift, static_cast<float>(kHeight)));
      }
      database.WriteKeypoints(id, keypoints);
    }
    FeatureMatches all;
    FeatureMatches inliers;
    for (uint32_t i = 0; i < kWidth * kHeight; ++i) {
      all.push_back({i, i});
      const bool is_left = static_cast<int>(i) % kWidth < scene.num_columns;
      const int one_of = is_left ? scene.one_of_left : scene.one_of_right;
      if (one_of > 0 && i / kWidth % static_cast<uint32_t>(one_of) == 0) inliers.push_back({i, i});
    }
    for (const auto& [id1, id2] : {std::pair{1, 2}, std::pair{2, 3}}) {
      const auto first = static_cast<ImageId>(id1);
      const auto second = static_cast<ImageId>(id2);
      if (scene.match_all) database.WriteMatches(first, second, all);
      database.WriteTwoViewGeometry(first, second, {.config = 2, .inlier_matches = inliers});
    }
    transaction.Commit();
  }

  void WriteMasks(int num_columns) const {
    for (const std::string name : {"a.jpg", "b.jpg", "sub/c.png"}) {
      StaticMask static_mask = ColumnMask(num_columns);
      static_mask(kWidth - 1, name.front() % kHeight) = 0;  // no two the same
      WriteImage(Mask(name), static_mask);
    }
  }
};

TEST_F(MaskLintDatabase, FeaturesThatAreAlreadyThereAreCounted) {
  WriteDatabase({});
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report), ElementsAre("masks-too-late "));
  // Masks exclude 4, 5 and 6 columns of 20 keypoints; every row of two pairs with an excluded end.
  EXPECT_EQ(report.findings[0].detail, "300 of 2400 features, 220 rows of matches");
  EXPECT_EQ(Image(report, "a.jpg").num_keypoints, 800U);
  EXPECT_EQ(Image(report, "a.jpg").num_excluded_keypoints, 80U);
}

TEST_F(MaskLintDatabase, FeaturesWithoutMatchesDoNoHarm) {
  WriteDatabase({.num_columns = 6, .one_of_right = 1, .match_all = false});
  EXPECT_THAT(Codes(Lint()), ElementsAre("excluded-unmatched "));
}

TEST_F(MaskLintDatabase, OtherNamesAreTold) {
  WriteDatabase({.names = {"a.jpg", "photos/b.jpg", "c.png"}});
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report),
              ElementsAre("unknown-database-image ", "photo-not-in-database ", "masks-too-late "));
  EXPECT_EQ(report.findings[0].detail,
            "2 of 3 images, the first c.png, while there is a photo sub/c.png");
}

// The masks exclude the left 32 of 40 columns, where all inliers are: proven, and mended.
TEST_F(MaskLintDatabase, InversionIsProvenByVerifiedMatches) {
  WriteMasks(32);
  EXPECT_THAT(Codes(Lint()), ElementsAre("maybe-inverted "));
  WriteDatabase({.num_columns = 32, .one_of_left = 2, .one_of_right = 5});
  const LintReport report = Lint();
  EXPECT_TRUE(report.is_inverted);
  EXPECT_THAT(Codes(report), Contains("inverted-masks "));
  const std::vector<MaskFix> fixes =
      FixMasks(folder_ / "photos", folder_ / "masks", report, folder_ / "fixed", {});
  for (const MaskFix& fix : fixes) {
    EXPECT_EQ(fix.what, "kept and excluded exchanged");
    EXPECT_NEAR(fix.excluded_share, 0.2, 0.01);
    StaticMask before = ReadStaticMask(Mask(fix.image_name));
    for (uint8_t& value : before.data()) value = static_cast<uint8_t>(255 - value);
    EXPECT_EQ(Fixed(fix.image_name), before);
  }
  EXPECT_FALSE(Lint("3.8", "fixed").is_inverted);
}

// A cut-out object in front of a background: what is excluded matches worse, or stands still in
// the frame, or matches not clearly better.
TEST_F(MaskLintDatabase, InversionIsNotGuessed) {
  WriteMasks(32);
  const Scene scenes[] = {
      {.num_columns = 32, .one_of_left = 5, .one_of_right = 2},
      {.num_columns = 32, .one_of_left = 1, .one_of_right = 5, .motion_px = 0.1f},
      {.num_columns = 32, .one_of_left = 4, .one_of_right = 5}};
  for (const Scene& scene : scenes) {
    WriteDatabase(scene);
    const LintReport report = Lint();
    EXPECT_FALSE(report.is_inverted);
    EXPECT_THAT(Codes(report), Contains("maybe-inverted "));
    Fix(report, "a.jpg");
  }
}

TEST_F(MaskLintDatabase, InversionOnDemandLeavesEmptyMasksAlone) {
  WriteMasks(32);
  WriteImage(Mask("b.jpg"), StaticMask(kWidth, kHeight, 255));
  const LintReport report = Lint();
  EXPECT_EQ(Fix(report, "b.jpg", {.invert = true}).what, "excludes nothing: not exchanged");
  EXPECT_EQ(Fixed("b.jpg"), StaticMask(kWidth, kHeight, 255));
  EXPECT_NEAR(ExcludedShare(Fixed("a.jpg")), 0.2, 0.01);
}

}  // namespace
}  // namespace vgtw
