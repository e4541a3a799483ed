// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/depth_evaluation.h"

#include "scene/perturb.h"
#include "scene/synthetic.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wall_prediction.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

class EvaluateDepthsTest : public testing::Test {
 protected:
  CloudSource Write(const std::string& name, const Prediction& prediction) const {
    WritePrediction(prediction, folder_ / name, /*overwrite=*/true);
    return {folder_ / name, PredictionFilterOptions{.keep_percent = 100.0}};
  }

  const TemporaryFolder folder_;
};

// What a perfect network says, and the same in another world and scale.
Prediction Truth() {
  SyntheticOptions options;
  options.num_views = 4;
  options.width = 160;
  options.height = 120;
  return MakeTruePrediction(SyntheticScene(options), 112);
}

Prediction TruthElsewhere() {
  return Perturb(Truth(),
                 {.rotation_deg = 0.0,
                  .centre_percent = 0.0,
                  .focal_percent = 0.0,
                  .depth_scale_percent = 0.0,
                  .depth_noise_percent = 0.0});
}

TEST_F(EvaluateDepthsTest, ExactDepthHasNoErrorByItsOwnReprojection) {
  CloudSource prediction = Write("prediction", TruthElsewhere());
  const CloudSource reference = Write("reference", Truth());
  DepthEvaluationOptions options;
  options.cloud_of_all_views = false;
  const DepthEvaluation evaluation = EvaluateDepths(prediction, reference, options);
  ASSERT_EQ(evaluation.views.size(), 4u);
  // Depths are floats; at a depth of 10 the similarity is known to 1e-7.
  EXPECT_LT(evaluation.pooled.AbsRel(), 1e-6);
  EXPECT_EQ(evaluation.pooled.WithinPercent(), 100.0);
  EXPECT_GT(evaluation.pooled.num_pixels, 10000u);
}

TEST_F(EvaluateDepthsTest, AllViewsAgreeOnAPlane) {
  CloudSource prediction = Write("prediction", MakeWallPrediction());
  DepthEvaluationOptions options;
  options.cloud_alignment = "none";
  const DepthEvaluation evaluation = EvaluateDepths(prediction, prediction, options);
  EXPECT_LT(evaluation.pooled.AbsRel(), 1e-6);
  EXPECT_EQ(evaluation.pooled.num_pixels, 3u * 32u * 24u);
}

TEST_F(EvaluateDepthsTest, NearerPointsOfOtherViewsHideAView) {
  // The middle view is 2 % nearer than the other two, and a step of 6 of the 64 pixels is 3 of 32.
  Prediction prediction = MakeWallPrediction();
  for (float& depth : prediction.views[1].depth.data()) depth *= 0.98f;
  CloudSource nearer = Write("nearer", prediction);
  const CloudSource reference = Write("reference", MakeWallPrediction());
  DepthEvaluationOptions options;
  options.cloud_alignment = "none";
  const DepthEvaluation evaluation = EvaluateDepths(nearer, reference, options);
  EXPECT_NEAR(evaluation.views[1].error.AbsRel(), 0.02, 1e-6);
  EXPECT_GT(evaluation.views[0].error.AbsRel(), 0.016);
  EXPECT_LT(evaluation.views[0].error.AbsRel(), 0.02);
}

TEST_F(EvaluateDepthsTest, MapsAreFittedEachOrTogether) {
  // The three views are 1, 2 and 4 times too deep.
  Prediction prediction = MakeWallPrediction();
  for (size_t i = 0; i < 3; ++i) {
    for (float& depth : prediction.views[i].depth.data()) depth *= static_cast<float>(1u << i);
  }
  CloudSource scaled = Write("scaled", prediction);
  const CloudSource reference = Write("reference", MakeWallPrediction());
  DepthEvaluationOptions options;
  options.reproject = false;
  const DepthEvaluation each = EvaluateDepths(scaled, reference, options);
  EXPECT_LT(each.mean_abs_rel, 1e-6);
  EXPECT_NEAR(each.views[2].fit.scale, 0.25, 1e-6);
  options.one_fit = true;
  const DepthEvaluation together = EvaluateDepths(scaled, reference, options);
  // The median is twice too deep: errors 1/2, 0 and 1.
  EXPECT_NEAR(together.mean_abs_rel, 0.5, 1e-6);
  EXPECT_NEAR(together.mean_within_percent, 100.0 / 3.0, 1e-9);
  EXPECT_FALSE(together.alignment);
}

TEST_F(EvaluateDepthsTest, NothingInCommonIsAnError) {
  CloudSource prediction = Write("prediction", MakeWallPrediction());
  DepthEvaluationOptions options;
  options.reproject = false;
  options.max_depth = 1.0;
  EXPECT_THAT(ErrorOf([&] { EvaluateDepths(prediction, prediction, options); }),
              HasSubstr("has no depth where"));
}

}  // namespace
}  // namespace vgtw
