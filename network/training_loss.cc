// SPDX-License-Identifier: BSD-3-Clause
#include "network/training_loss.h"

#include "network/camera_geometry.h"
#include "network/config.h"
#include "network/correspondence_loss.h"
#include "network/distractor_losses.h"

#include <cstddef>
#include <optional>
#include <vector>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

class Sum {
 public:
  Sum(const std::array<double, kNumTrainingLosses>& weights, const at::Tensor& images)
      : weights_(weights) {
    loss_.total = at::zeros({}, images.options().dtype(at::kFloat));
  }

  bool Wants(TrainingLoss loss) const { return weights_[static_cast<size_t>(loss)] > 0.0; }

  void Add(TrainingLoss loss, const at::Tensor& value) {
    if (!Wants(loss)) return;
    loss_.total = loss_.total + weights_[static_cast<size_t>(loss)] * value;
    loss_.values[static_cast<size_t>(loss)] = value.item<double>();
  }

  SampleLoss Result() const { return loss_; }

 private:
  const std::array<double, kNumTrainingLosses>& weights_;
  SampleLoss loss_;
};

}  // namespace

at::Tensor PatchFeatures(const Features& features, int layer) {
  const at::Tensor& tokens =
      layer == 3 ? features.last : features.layers[static_cast<size_t>(layer)];
  return tokens.slice(1, kNumSpecialTokens);
}

SampleLoss ComputeSampleLoss(const Model& model,
                             const TrainingSample& sample,
                             const std::array<double, kNumTrainingLosses>& weights,
                             int feature_layer) {
  Sum sum(weights, sample.images);
  const int64_t num_views = sample.images.size(0);
  const Features features = model.Encode(sample.images, {});
  if (sum.Wants(TrainingLoss::kSuppression) || sum.Wants(TrainingLoss::kConsistency)) {
    const FeatureLosses losses = ComputeFeatureLosses(PatchFeatures(features, feature_layer),
                                                      LabelTokens(sample.distractor));
    sum.Add(TrainingLoss::kSuppression, losses.suppression);
    sum.Add(TrainingLoss::kConsistency, losses.consistency);
  }
  std::optional<NormalisedTruth> normalised;
  if (sample.truth.depth.defined()) normalised = NormaliseTruth(sample.truth);
  if (sum.Wants(TrainingLoss::kCamera) && normalised) {
    const GeometryTruth& truth = normalised->truth;
    const at::Tensor true_encodings =
        EncodePoses({truth.cam_from_world, truth.intrinsics}, features.height, features.width);
    const at::Tensor steps = model.PredictCameras(features).pose_encodings;
    sum.Add(TrainingLoss::kCamera, CameraLoss(steps.unbind(0), true_encodings));
  }
  if (sum.Wants(TrainingLoss::kCorrespondence) && normalised) {
    const PatchMatches matches = MatchPatches(normalised->truth, sample.distractor);
    at::Tensor loss;
    for (const at::Tensor& layer : features.layers) {
      const at::Tensor of_layer = CorrespondenceLoss(layer.slice(1, kNumSpecialTokens), matches);
      loss = loss.defined() ? loss + of_layer : of_layer;
    }
    sum.Add(TrainingLoss::kCorrespondence, loss / static_cast<double>(features.layers.size()));
  }
  const MapChoice maps = {.points = sum.Wants(TrainingLoss::kPoints) && normalised.has_value(),
                          .depth = sum.Wants(TrainingLoss::kDepth) && normalised.has_value(),
                          .distractor = sum.Wants(TrainingLoss::kMask)};
  if (!maps.points && !maps.depth && !maps.distractor) return sum.Result();
  const DenseOutputs outputs = model.PredictMaps(features, 0, num_views, maps);
  if (maps.distractor) {
    sum.Add(TrainingLoss::kMask, MaskLoss(outputs.distractor_logits, sample.distractor));
  }
  if (maps.depth) {
    sum.Add(TrainingLoss::kDepth,
            DepthLoss(outputs.depth, outputs.depth_conf, normalised->truth.depth));
  }
  if (maps.points) {
    sum.Add(TrainingLoss::kPoints,
            PointLoss(outputs.points, outputs.points_conf, normalised->truth));
  }
  return sum.Result();
}

}  // namespace vgtw
