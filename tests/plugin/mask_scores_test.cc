// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/mask_scores.h"

#include "bridge/colmap_database.h"
#include "bridge/mask_files.h"
#include "bridge/predictions.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

// Excludes the columns left of `end`.
StaticMask LeftOf(int end) {
  StaticMask mask(40, 20, 255);
  for (int y = 0; y < 20; ++y) std::fill_n(&mask(0, y), end, uint8_t{0});
  return mask;
}

// Truth: 10 columns of a.jpg and nothing of sub/b.png. Masks: 20 columns and nothing.
class ScoreMasksTest : public testing::Test {
 protected:
  void SetUp() override {
    WriteImage(MaskPath(folder_ / "truth", "a.jpg"), LeftOf(10));
    WriteImage(MaskPath(folder_ / "truth", "sub/b.png"), LeftOf(0));
    WriteImage(MaskPath(folder_ / "masks", "a.jpg"), LeftOf(20));
    WriteImage(MaskPath(folder_ / "masks", "sub/b.png"), LeftOf(0));
    options_.mask_path = folder_ / "masks";
    options_.reference_mask_path = folder_ / "truth";
  }
  void WriteDatabase(const std::string& second_name) const {
    ColmapDatabase database = ColmapDatabase::Create(folder_ / "a.db");
    ColmapDatabase::Transaction transaction(database);
    Camera camera = MakePinhole(40, 20, 30.0, 30.0);
    camera.camera_id = 1;
    database.WriteCamera(camera);
    database.WriteImage({1, "a.jpg", 1});
    database.WriteImage({2, second_name, 1});
    database.WriteKeypoints(1, {3, 2, {5.0f, 5.0f, 15.0f, 5.0f, 25.0f, 5.0f}});
    transaction.Commit();
  }
  std::string ErrorOfScoring() const {
    return ErrorOf([&] { ScoreMasks(options_); });
  }

  const TemporaryFolder folder_;
  MaskScoresOptions options_;
};

TEST_F(ScoreMasksTest, ScoresEveryImageThatHasATrueMask) {
  const auto scores = ScoreMasks(options_);
  ASSERT_EQ(scores.size(), 2u);
  EXPECT_EQ(scores[0].name, "a.jpg");
  EXPECT_EQ(scores[0].score.pixels.true_positive, 200u);
  EXPECT_EQ(scores[0].score.pixels.false_positive, 200u);
  EXPECT_EQ(scores[1].name, "sub/b.png");
  EXPECT_EQ(scores[1].score.pixels.Dice(), 1.0);
}

// The outlines are 10 px apart; the default is ceil(0.008 * 44.7) = 1 px.
TEST_F(ScoreMasksTest, TheToleranceIsThatOfTheDiagonalUnlessGiven) {
  EXPECT_EQ(ScoreMasks(options_)[0].score.boundary.F(), 0.0);
  options_.tolerance_px = 10.0;
  EXPECT_EQ(ScoreMasks(options_)[0].score.boundary.F(), 1.0);
}

// Of the features at x = 5, 15, 25 the mask keeps the last; the second is static and lost.
TEST_F(ScoreMasksTest, CountsTheFeaturesOfADatabase) {
  WriteDatabase("sub/b.png");
  options_.database_path = folder_ / "a.db";
  const FeatureCounts features = ScoreMasks(options_)[0].score.features;
  EXPECT_EQ(features.num_kept, 1u);
  EXPECT_EQ(features.num_kept_on_distractors, 0u);
  EXPECT_EQ(features.num_static, 2u);
  EXPECT_EQ(features.num_static_lost, 1u);
}

// Label images as DAVIS has them: 0 is the background, any colour a distractor.
TEST_F(ScoreMasksTest, ScoresNamedImagesByTheMasksOfAnotherConvention) {
  RgbImage labels(40, 20, Rgb{0, 0, 0});
  for (int y = 0; y < 20; ++y) std::fill_n(&labels(0, y), 10, Rgb{0, 0, 128});
  WriteImage(folder_ / "labels/a.png", labels);
  WriteImage(folder_ / "labels/c.png", labels);
  WriteImage(folder_ / "photos/a.jpg", RgbImage(40, 20, Rgb{9, 9, 9}));
  options_.reference_mask_path = folder_ / "labels";
  options_.reference_convention = "sam2";
  options_.image_path = folder_ / "photos";
  options_.image_names = {"a.jpg", "without_labels.jpg"};
  const auto scores = ScoreMasks(options_);
  ASSERT_EQ(scores.size(), 1u);
  EXPECT_EQ(scores[0].name, "a.jpg");
  EXPECT_EQ(scores[0].score.pixels.true_positive, 200u);
  EXPECT_EQ(scores[0].score.pixels.false_positive, 200u);
  EXPECT_EQ(scores[0].score.pixels.false_negative, 0u);
  options_.image_names = {"without_labels.jpg"};
  EXPECT_THAT(ErrorOfScoring(), HasSubstr("has a true mask of none of 1 images"));
}

TEST_F(ScoreMasksTest, AnImageThatTheDatabaseLacksIsAnError) {
  WriteDatabase("c.png");
  options_.database_path = folder_ / "a.db";
  EXPECT_THAT(ErrorOfScoring(), HasSubstr("has no image sub/b.png"));
}

// Probability 0.4 left of column 10, 0.8 left of column 6, in network pixels of the same size.
TEST_F(ScoreMasksTest, ProbabilitiesBecomeMasksAtTheThreshold) {
  std::filesystem::remove(folder_ / "truth/sub/b.png.png");
  ViewPrediction view;
  view.view.name = "a.jpg";
  view.view.camera = MakePinhole(40, 20, 30.0, 30.0);
  view.view.network_width = 40;
  view.view.network_height = 20;
  view.distractor = DistractorMask(40, 20, 0.0f);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 10; ++x) view.distractor(x, y) = x < 6 ? 0.8f : 0.4f;
  }
  WritePrediction({"test", "", {view}}, folder_ / "predictions", /*overwrite=*/false);
  options_.mask_path.clear();
  options_.predictions_path = folder_ / "predictions";
  EXPECT_DOUBLE_EQ(ScoreMasks(options_)[0].score.pixels.Recall(), 0.6);
  options_.threshold = 0.3;
  EXPECT_DOUBLE_EQ(ScoreMasks(options_)[0].score.pixels.Recall(), 1.0);
  WriteImage(MaskPath(folder_ / "truth", "c.jpg"), LeftOf(0));
  EXPECT_THAT(ErrorOfScoring(), HasSubstr("has no view c.jpg"));
}

TEST_F(ScoreMasksTest, TellsWhatIsMissingOrOfAnotherSize) {
  std::filesystem::remove(folder_ / "masks/a.jpg.png");
  EXPECT_THAT(ErrorOfScoring(), HasSubstr("1 of 2 images have no mask"));
  options_.allow_missing_masks = true;
  EXPECT_EQ(ScoreMasks(options_)[0].score.pixels.Recall(), 0.0);
  WriteImage(folder_ / "masks/a.jpg.png", StaticMask(20, 10, 255));
  EXPECT_THAT(ErrorOfScoring(), HasSubstr("20 x 10 pixels, expected 40 x 20"));
  WriteImage(folder_ / "photos/a.jpg", RgbImage(60, 20));
  options_.image_path = folder_ / "photos";
  EXPECT_THAT(ErrorOfScoring(), HasSubstr("40 x 20 pixels, expected 60 x 20"));
  WriteImage(folder_ / "truth/d.jpg", RgbImage(40, 20));
  EXPECT_THAT(ErrorOfScoring(), HasSubstr("is not named as a mask"));
}

}  // namespace
}  // namespace vgtw
