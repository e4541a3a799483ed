// SPDX-License-Identifier: BSD-3-Clause
// Numbers equal to those of `evaluate` are the subject of end_to_end/protocol_test.
#include "plugin/scene_scores.h"

#include "bridge/export_poses.h"
#include "bridge/predictions.h"
#include "scene/files.h"
#include "scene/perturb.h"
#include "scene/synthetic.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

// Errors of nothing: only the world is another one.
constexpr PerturbOptions kOtherWorld = {.rotation_deg = 0.0,
                                        .centre_percent = 0.0,
                                        .focal_percent = 0.0,
                                        .depth_scale_percent = 0.0,
                                        .depth_noise_percent = 0.0};

class ScoreSceneTest : public testing::Test {
 protected:
  void SetUp() override {
    SyntheticOptions options;
    options.num_views = 10;
    options.width = 96;
    options.height = 72;
    const SyntheticScene synthetic(options);
    truth_ = MakeTruePrediction(synthetic, 56);
    WriteFileAtomically(folder_ / "transforms.json", TransformsJson(synthetic.views(), "images"));
    // Every second view each: no view in common.
    Prediction odd = truth_;
    Prediction even = truth_;
    odd.views.clear();
    even.views.clear();
    for (size_t i = 0; i < truth_.views.size(); ++i) {
      (i % 2 == 0 ? even : odd).views.push_back(truth_.views[i]);
    }
    PerturbOptions other_world = kOtherWorld;
    other_world.seed = 3;
    WritePrediction(Perturb(odd, other_world), folder_ / "odd", false);
    WritePrediction(even, folder_ / "even", false);
    scene_.name = "room";
    for (const ViewPrediction& view : odd.views) scene_.test_images.push_back(view.view.name);
    scene_.pose_reference_path = folder_ / "transforms.json";
  }
  SceneScores Score() const {
    return ScoreScene(scene_, conditions_, {folder_ / "odd", folder_ / "even"}, 0);
  }

  const TemporaryFolder folder_;
  Prediction truth_;
  ProtocolScene scene_;
  ProtocolConditions conditions_;
};

TEST_F(ScoreSceneTest, DatasetCamerasAlignPhotosThatHaveNothingInCommon) {
  conditions_.alignment = "dataset_cameras";
  conditions_.keep_percent = conditions_.reference_keep_percent = 100.0;
  const SceneScores scores = Score();
  // Both clouds sample the same surfaces about 8 scene units away, 56 pixels wide: points of other
  // views lie within the distance of neighbouring pixels. Unaligned worlds are units apart.
  EXPECT_LT(scores.acc, 0.1);
  EXPECT_LT(scores.ate, 1e-6);
  EXPECT_EQ(scores.conditions["alignment"]["method"], "dataset_cameras");
  conditions_.alignment = "none";
  EXPECT_GT(Score().acc, 5.0 * scores.acc);
}

TEST_F(ScoreSceneTest, APartThatCannotBeMeasuredIsAWarning) {
  conditions_.alignment = "pixels";
  const SceneScores scores = Score();
  EXPECT_TRUE(std::isnan(scores.acc));
  EXPECT_TRUE(std::isnan(scores.abs_rel));
  EXPECT_LT(scores.ate, 1e-6);
  ASSERT_EQ(scores.warnings.size(), 1u);
  EXPECT_THAT(scores.warnings[0], HasSubstr("clouds: "));
  EXPECT_THAT(scores.warnings[0], HasSubstr("no view in common"));
}

TEST_F(ScoreSceneTest, OtherPhotosThanTheProtocolsAreTold) {
  scene_.test_images.pop_back();
  scene_.test_images.push_back("zzz.png");
  conditions_.alignment = "dataset_cameras";
  EXPECT_THAT(Score().warnings,
              testing::Contains("views: 1 of 5 test images are missing, 1 others are there"));
}

TEST(Metrics, AreFoundByTheirKeys) {
  for (const Metric& metric : Metrics()) EXPECT_EQ(FindMetric(metric.key), &metric);
  EXPECT_EQ(FindMetric("psnr"), nullptr);
  EXPECT_EQ(ColumnOf(*FindMetric("nc")).latex, "NC$\\uparrow$");
}

}  // namespace
}  // namespace vgtw
