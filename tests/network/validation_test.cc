// SPDX-License-Identifier: BSD-3-Clause
#include "network/validation.h"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Says what it is told to.
class FakeModel : public Model {
 public:
  Features Encode(const at::Tensor& images, const EncodeOptions&) const override {
    Features features;
    features.height = images.size(2);
    features.width = images.size(3);
    features.last = tokens;
    return features;
  }
  CameraOutputs PredictCameras(const Features&) const override { return cameras; }
  DenseOutputs PredictMaps(const Features&, int64_t, int64_t, const MapChoice&) const override {
    return maps;
  }
  const TransformerBlock& GlobalBlock(int64_t) const override {
    throw std::logic_error("not asked for");
  }

  at::Tensor tokens;
  CameraOutputs cameras;
  DenseOutputs maps;
};

// [S, 3, 4], turned by `degrees` more from view to view around y, one unit along x each.
at::Tensor Poses(int64_t num_views, double degrees) {
  std::vector<at::Tensor> poses;
  for (int64_t i = 0; i < num_views; ++i) {
    const double angle = static_cast<double>(i) * degrees * 3.14159265358979 / 180.0;
    const double c = std::cos(angle), s = std::sin(angle);
    poses.push_back(
        at::tensor({c, 0.0, s, 1.0 * static_cast<double>(i), 0.0, 1.0, 0.0, 0.0, -s, 0.0, c, 0.0})
            .view({3, 4}));
  }
  return at::stack(poses).to(at::kDouble);
}

// Three views of 1 x 5 patches; the first two patches of each are a distractor.
class ValidationTest : public testing::Test {
 protected:
  ValidationTest() {
    sample_.images = at::zeros({3, 3, 14, 70});
    sample_.distractor = at::zeros({3, 14, 70});
    sample_.distractor.slice(2, 0, 28).fill_(1.0);
    sample_.truth.depth = 1.0 + at::arange(3 * 14 * 70, at::kFloat).view({3, 14, 70});
    sample_.truth.cam_from_world = Poses(3, 10.0);
    sample_.truth.intrinsics = at::eye(3, at::kDouble).repeat({3, 1, 1});
    model_.cameras.cam_from_world = Poses(3, 10.0);
    model_.maps.depth = 3.0 * sample_.truth.depth;  // another scale is no error
    model_.maps.depth_conf = 1.0 + 2.0 * (sample_.distractor < 0.5).to(at::kFloat);
    model_.maps.distractor_logits = 8.0 * sample_.distractor - 4.0;
    model_.tokens = at::ones({3, 10, 2});
  }

  ValidationScore Score() const {
    return Summarise({ScoreSample(model_, sample_, /*feature_layer=*/3)}, 7);
  }

  TrainingSample sample_;
  FakeModel model_;
};

TEST_F(ValidationTest, TruthIsWithoutError) {
  const ValidationScore score = Score();
  EXPECT_EQ(score.step, 7);
  EXPECT_EQ(score.mask_f1, 1.0);
  EXPECT_EQ(score.mask_iou, 1.0);
  EXPECT_NEAR(score.abs_rel, 0.0, 1e-6);
  EXPECT_EQ(score.within_1_25, 1.0);
  EXPECT_NEAR(score.rotation_deg, 0.0, 1e-5);
  EXPECT_NEAR(score.direction_deg, 0.0, 1e-5);
  EXPECT_EQ(score.pairs_within_5_deg, 1.0);
  EXPECT_NEAR(score.confidence_ratio, 1.0 / 3.0, 1e-6);
  EXPECT_NEAR(score.patch_similarity, 1.0, 1e-6);
}

TEST_F(ValidationTest, MasksAreCounted) {
  // Of two patches the first is found, and another is wrong.
  model_.maps.distractor_logits = at::full({3, 14, 70}, -1.0);
  model_.maps.distractor_logits.slice(2, 0, 14).fill_(1.0);
  model_.maps.distractor_logits.slice(2, 56, 70).fill_(1.0);
  const ValidationScore score = Score();
  EXPECT_NEAR(score.mask_precision, 0.5, 1e-12);
  EXPECT_NEAR(score.mask_recall, 0.5, 1e-12);
  EXPECT_NEAR(score.mask_f1, 0.5, 1e-12);
  EXPECT_NEAR(score.mask_iou, 1.0 / 3.0, 1e-12);
}

TEST_F(ValidationTest, UnknownMaskPixelsDoNotCount) {
  sample_.distractor.select(2, 0).fill_(std::numeric_limits<float>::quiet_NaN());
  model_.maps.distractor_logits.select(2, 0).fill_(-9.0);
  EXPECT_EQ(Score().mask_f1, 1.0);
}

TEST_F(ValidationTest, RotationsAreOfPairs) {
  // Views are turned by 12 degrees from one to the next, not 10: pairs are off by 2, 2 and 4.
  model_.cameras.cam_from_world = Poses(3, 12.0);
  EXPECT_NEAR(Score().rotation_deg, 2.0, 1e-6);
}

TEST_F(ValidationTest, SignOfADirectionCounts) {
  model_.cameras.cam_from_world.select(2, 3).neg_();
  const ValidationScore score = Score();
  EXPECT_NEAR(score.direction_deg, 180.0, 1e-4);
  EXPECT_EQ(score.pairs_within_5_deg, 0.0);
}

TEST_F(ValidationTest, RelativeErrorsAreThoseAfterTheMedian) {
  // Ten of 42 rows, all nearer than the median.
  model_.maps.depth = sample_.truth.depth.clone();
  model_.maps.depth[0].slice(0, 0, 10).mul_(1.5);
  const ValidationScore score = Score();
  EXPECT_NEAR(score.abs_rel, 10.0 * 0.5 / 42.0, 1e-6);
  EXPECT_NEAR(score.within_1_25, 32.0 / 42.0, 1e-6);
}

TEST_F(ValidationTest, DepthsOfDistractorsDoNotCount) {
  model_.maps.depth = sample_.truth.depth.clone();
  model_.maps.depth.slice(2, 0, 28).mul_(5.0);
  EXPECT_EQ(Score().abs_rel, 0.0);
}

TEST_F(ValidationTest, SimilarityIsThatOfAnyTwoStaticPatches) {
  // Static patches lie along x in the first two views and along y in the third, so that of 9 pairs
  // of views 5 are alike, whatever lengths and distractors are.
  model_.tokens = at::zeros({3, 10, 2});
  model_.tokens.slice(0, 0, 2).select(2, 0).fill_(1.0);
  model_.tokens.slice(0, 2, 3).select(2, 1).fill_(7.0);
  model_.tokens.slice(1, 5, 7).fill_(-3.0);
  EXPECT_NEAR(Score().patch_similarity, 5.0 / 9.0, 1e-6);
}

TEST_F(ValidationTest, NearestPatchesAreRightWhereTheyShowThePlace) {
  // The same view of a wall three times: static patch p shows what p of the others shows. Features
  // turn by 20 degrees from patch to patch; the last one of the third view has those of the first.
  sample_.truth.depth = at::full({3, 14, 70}, 2.0f);
  sample_.truth.cam_from_world = at::eye(3, 4, at::kDouble).repeat({3, 1, 1});
  const at::Tensor angles = at::arange(5, at::kFloat) * (20.0 * 3.14159265358979 / 180.0);
  model_.tokens.slice(1, 5).copy_(at::stack({angles.cos(), angles.sin()}, 1));
  EXPECT_EQ(Score().nearest_right, 1.0);
  model_.tokens[2][9].copy_(model_.tokens[2][5]);
  // 3 static patches, 6 ordered pairs of views; wrong are the last one's, of the third view and to
  // it.
  EXPECT_NEAR(Score().nearest_right, 14.0 / 18.0, 1e-12);
}

}  // namespace
}  // namespace vgtw
