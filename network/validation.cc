// SPDX-License-Identifier: BSD-3-Clause
#include "network/validation.h"

#include "network/config.h"
#include "network/correspondence_loss.h"
#include "network/distractor_losses.h"
#include "network/training_loss.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kPairLimitDeg = 5.0;

int64_t Count(const at::Tensor& mask) { return mask.sum().item<int64_t>(); }

void AddMasks(const at::Tensor& logits, const at::Tensor& truth, SampleScore& score) {
  const at::Tensor said = (logits > 0.0) & truth.isfinite();
  const at::Tensor is = truth > 0.5;
  score.true_positives = Count(said & is);
  score.false_positives = Count(said & ~is);
  score.false_negatives = Count(~said & is);
}

void AddDepths(const at::Tensor& depth,
               const at::Tensor& truth,
               const at::Tensor& distractor,
               SampleScore& score) {
  const at::Tensor known = IsKnownDepth(truth) & (distractor < 0.5);
  score.num_depths = Count(known);
  if (score.num_depths == 0) return;
  const at::Tensor is = truth.masked_select(known);
  const at::Tensor raw = depth.masked_select(known);
  const at::Tensor said = raw * (is.median() / raw.median());
  score.sum_relative_errors = ((said - is).abs() / is).sum().item<double>();
  score.num_within_1_25 = Count(at::maximum(said / is, is / said) < 1.25);
}

void AddConfidences(const at::Tensor& confidence,
                    const at::Tensor& distractor,
                    SampleScore& score) {
  const at::Tensor on_distractors = confidence.masked_select(distractor > 0.5);
  const at::Tensor on_static = confidence.masked_select(distractor < 0.5);
  if (on_distractors.numel() == 0 || on_static.numel() == 0) return;
  score.confidence_on_distractors = on_distractors.mean().item<double>();
  score.confidence_on_static = on_static.mean().item<double>();
}

// The mean of a b over all pairs of unit vectors is the square of their mean.
void AddSimilarity(const at::Tensor& patches, const at::Tensor& is_static, SampleScore& score) {
  const at::Tensor chosen = patches.flatten(0, 1).index({is_static.flatten()}).to(at::kDouble);
  if (chosen.size(0) == 0) return;
  const at::Tensor lengths = chosen.norm(2, 1, /*keepdim=*/true).clamp_min(1e-12);
  score.patch_similarity = (chosen / lengths).mean(0).square().sum().item<double>();
}

void AddNearestPatches(const at::Tensor& patches,
                       const TrainingSample& sample,
                       SampleScore& score) {
  const PatchMatches matches = MatchPatches(sample.truth, sample.distractor);
  const at::Tensor directions = patches / patches.norm(2, 2, /*keepdim=*/true).clamp_min(1e-12);
  for (int64_t i = 0; i < patches.size(0); ++i) {
    // [S, P]: of each patch of view i, the most similar one of every view.
    const at::Tensor nearest =
        at::matmul(directions[i].unsqueeze(0), directions.transpose(1, 2)).argmax(2);
    const at::Tensor is_around = matches.weight[i] > 0.0;
    const at::Tensor is_right = (matches.patch[i] == nearest.unsqueeze(2)) & is_around;
    score.num_matched_patches += Count(is_around.any(2));
    score.num_nearest_right += Count(is_right.any(2));
  }
}

// [S, 3, 4] -> rotation and translation of j_from_i for all i < j, stacked: [N, 3, 3] and [N, 3].
struct RelativePoses {
  at::Tensor rotations;
  at::Tensor translations;
};
RelativePoses PairsOf(const at::Tensor& poses) {
  std::vector<at::Tensor> rotations, translations;
  const at::Tensor doubles = poses.to(at::kDouble).cpu();
  for (int64_t i = 0; i < poses.size(0); ++i) {
    for (int64_t j = i + 1; j < poses.size(0); ++j) {
      const at::Tensor rotation = doubles[j].slice(1, 0, 3).mm(doubles[i].slice(1, 0, 3).t());
      rotations.push_back(rotation);
      translations.push_back(doubles[j].select(1, 3) - rotation.mv(doubles[i].select(1, 3)));
    }
  }
  return {at::stack(rotations), at::stack(translations)};
}

std::vector<double> ToDegrees(const at::Tensor& cosines) {
  const at::Tensor angles = (cosines.clamp(-1.0, 1.0).acos() * kDegrees).contiguous();
  const double* data = angles.data_ptr<double>();
  return {data, data + angles.numel()};
}

void AddPoses(const at::Tensor& poses, const at::Tensor& truth, SampleScore& score) {
  if (poses.size(0) < 2) return;
  const RelativePoses said = PairsOf(poses);
  const RelativePoses is = PairsOf(truth);
  const at::Tensor trace = (said.rotations * is.rotations).sum({1, 2});
  score.rotations_deg = ToDegrees((trace - 1.0) / 2.0);
  score.directions_deg = ToDegrees(at::cosine_similarity(said.translations, is.translations));
}

double Ratio(double a, double b) { return b > 0.0 ? a / b : 0.0; }

}  // namespace

SampleScore ScoreSample(const Model& model, const TrainingSample& sample, int feature_layer) {
  const at::NoGradGuard no_gradients;
  const Features features = model.Encode(sample.images, {});
  const DenseOutputs outputs =
      model.PredictMaps(features, 0, sample.images.size(0), {.points = false});
  SampleScore score;
  if (outputs.distractor_logits.defined()) {
    AddMasks(outputs.distractor_logits, sample.distractor, score);
  }
  AddConfidences(outputs.depth_conf, sample.distractor, score);
  const at::Tensor patches = PatchFeatures(features, feature_layer);
  AddSimilarity(patches, LabelTokens(sample.distractor).is_static, score);
  if (!sample.truth.depth.defined()) return score;
  AddDepths(outputs.depth, sample.truth.depth, sample.distractor, score);
  AddNearestPatches(patches, sample, score);
  AddPoses(model.PredictCameras(features).cam_from_world, sample.truth.cam_from_world, score);
  return score;
}

ValidationScore Summarise(const std::vector<SampleScore>& samples, int64_t step) {
  SampleScore sum;
  double num_pairs_within = 0.0;
  std::vector<double> confidence_ratios, similarities;
  for (const SampleScore& sample : samples) {
    sum.true_positives += sample.true_positives;
    sum.false_positives += sample.false_positives;
    sum.false_negatives += sample.false_negatives;
    sum.sum_relative_errors += sample.sum_relative_errors;
    sum.num_within_1_25 += sample.num_within_1_25;
    sum.num_depths += sample.num_depths;
    for (size_t i = 0; i < sample.rotations_deg.size(); ++i) {
      const double worse = std::max(sample.rotations_deg[i], sample.directions_deg[i]);
      num_pairs_within += worse < kPairLimitDeg;
    }
    const auto append = [](std::vector<double>& all, const std::vector<double>& more) {
      all.insert(all.end(), more.begin(), more.end());
    };
    append(sum.rotations_deg, sample.rotations_deg);
    append(sum.directions_deg, sample.directions_deg);
    if (sample.confidence_on_static > 0.0) {
      confidence_ratios.push_back(sample.confidence_on_distractors / sample.confidence_on_static);
    }
    sum.num_matched_patches += sample.num_matched_patches;
    sum.num_nearest_right += sample.num_nearest_right;
    if (sample.patch_similarity > 0.0) similarities.push_back(sample.patch_similarity);
  }
  ValidationScore score;
  score.step = step;
  const auto positives = static_cast<double>(sum.true_positives);
  const auto wrong = static_cast<double>(sum.false_positives + sum.false_negatives);
  score.mask_f1 = Ratio(2.0 * positives, 2.0 * positives + wrong);
  score.mask_iou = Ratio(positives, positives + wrong);
  score.mask_precision = Ratio(positives, positives + static_cast<double>(sum.false_positives));
  score.mask_recall = Ratio(positives, positives + static_cast<double>(sum.false_negatives));
  const auto num_depths = static_cast<double>(sum.num_depths);
  score.abs_rel = Ratio(sum.sum_relative_errors, num_depths);
  score.within_1_25 = Ratio(static_cast<double>(sum.num_within_1_25), num_depths);
  score.pairs_within_5_deg = Ratio(num_pairs_within, static_cast<double>(sum.rotations_deg.size()));
  if (!sum.rotations_deg.empty()) {
    score.rotation_deg = Median(sum.rotations_deg);
    score.direction_deg = Median(sum.directions_deg);
  }
  if (!confidence_ratios.empty()) score.confidence_ratio = Median(confidence_ratios);
  if (!similarities.empty()) score.patch_similarity = Median(similarities);
  score.nearest_right = Ratio(static_cast<double>(sum.num_nearest_right),
                              static_cast<double>(sum.num_matched_patches));
  return score;
}

}  // namespace vgtw
