// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/scene_scores.h"

#include "bridge/pose_matching.h"
#include "evaluation/pose_alignment.h"
#include "plugin/cloud_evaluation.h"
#include "plugin/depth_evaluation.h"
#include "plugin/mask_scores.h"
#include "plugin/pose_evaluation.h"
#include "scene/error.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr Metric kMetrics[] = {
    {"acc", "Acc", "Acc", true, 3, &SceneScores::acc},
    {"comp", "Comp", "Comp", true, 3, &SceneScores::comp},
    {"overall", "Overall", "Overall", true, 3, &SceneScores::overall},
    {"nc", "NC", "NC", false, 3, &SceneScores::nc},
    {"acc_median", "Acc median", "Acc (med.)", true, 3, &SceneScores::acc_median},
    {"comp_median", "Comp median", "Comp (med.)", true, 3, &SceneScores::comp_median},
    {"nc_median", "NC median", "NC (med.)", false, 3, &SceneScores::nc_median},
    {"abs_rel", "AbsRel", "Abs Rel", true, 3, &SceneScores::abs_rel},
    {"delta", "delta < 1.25, %", "$\\delta < 1.25$", false, 1, &SceneScores::delta_percent},
    {"rpe_trans", "RPE", "$\\mathrm{RPE}_{\\mathrm{trans}}$", true, 4, &SceneScores::rpe_trans},
    {"rpe_rot", "RPE, deg", "$\\mathrm{RPE}_{\\mathrm{rot}}$", true, 4, &SceneScores::rpe_rot_deg},
    {"ate", "ATE", "ATE", true, 4, &SceneScores::ate},
    {"mask_accuracy", "mask Acc", "Acc", false, 4, &SceneScores::mask_accuracy},
    {"mask_precision", "precision", "Precision", false, 4, &SceneScores::mask_precision},
    {"mask_recall", "recall", "Recall", false, 4, &SceneScores::mask_recall},
    {"mask_f1", "F1", "F1", false, 4, &SceneScores::mask_f1},
    {"mask_iou", "IoU", "IoU", false, 4, &SceneScores::mask_iou},
    {"mask_dice", "Dice", "Dice", false, 4, &SceneScores::mask_dice},
};

Sim3d DatasetFrom(const CloudSource& source, const PoseSet& dataset) {
  PoseSet poses;
  poses.path = source.path();
  for (const auto& [name, cam_from_world] : source.poses()) {
    poses.poses.push_back({name, cam_from_world});
  }
  std::map<std::string, Rigid3d> expected_by_name;
  for (const NamedPose& pose : dataset.poses) expected_by_name[pose.name] = pose.cam_from_world;
  std::vector<Rigid3d> found;
  std::vector<Rigid3d> expected;
  for (const NamedPose& pose :
       MatchPoses(poses, dataset, /*max_time_difference_sec=*/0.0).estimate) {
    found.push_back(pose.cam_from_world);
    expected.push_back(expected_by_name.at(pose.name));
  }
  const auto aligned = AlignPoses(found, expected);
  if (!aligned) {
    Fail(source.path(),
         "has " + std::to_string(found.size()) + " cameras in common with " + dataset.path.string(),
         "three or more that are not on a line");
  }
  return aligned->reference_from_estimate;
}

// Both through the world of the data set's own cameras.
CloudAlignment AlignByDataset(const CloudSource& prediction,
                              const CloudSource& reference,
                              const fs::path& pose_path) {
  if (pose_path.empty()) {
    throw Error(
        "alignment dataset_cameras without pose_reference_path, expected one in the protocol");
  }
  const PoseSet dataset = ReadPoseSet(pose_path);
  CloudAlignment alignment;
  alignment.reference_from_prediction =
      Inverse(DatasetFrom(reference, dataset)) * DatasetFrom(prediction, dataset);
  alignment.method = "dataset_cameras";
  alignment.num_pairs = alignment.num_views = prediction.poses().size();
  return alignment;
}

DepthAlignment DepthAlignmentOf(const std::string& word) {
  if (word == "median") return DepthAlignment::kMedian;
  if (word == "scale") return DepthAlignment::kScale;
  return word == "scale_shift" ? DepthAlignment::kScaleShift : DepthAlignment::kNone;
}

PoseAlignment PoseAlignmentOf(const std::string& word) {
  if (word == "sim3") return PoseAlignment::kSim3;
  if (word == "se3") return PoseAlignment::kSE3;
  return word == "first" ? PoseAlignment::kFirstCamera : PoseAlignment::kNone;
}

// The parts of one scene, in turn.
class Scorer {
 public:
  Scorer(const ProtocolScene& scene,
         const ProtocolConditions& conditions,
         const ScenePaths& paths,
         int num_threads)
      : scene_(scene), conditions_(conditions), paths_(paths), num_threads_(num_threads) {}

  SceneScores Run() {
    if (!paths_.reference.empty()) Part("clouds", [&] { ScoreClouds(); });
    if (!PoseReference().empty()) Part("poses", [&] { ScorePoses(); });
    if (!scene_.mask_path.empty()) Part("masks", [&] { ScoreTheMasks(); });
    return std::move(scores_);
  }

 private:
  template <typename Work>
  void Part(const char* part, const Work& work) {
    try {
      work();
    } catch (const Error& error) {
      scores_.warnings.push_back(std::string(part) + ": " + error.what());
    }
  }

  PredictionFilterOptions Filter(double keep_percent, double mask_threshold) const {
    PredictionFilterOptions filter;
    filter.keep_percent = keep_percent;
    filter.pool_views = conditions_.keep_scope == "all";
    filter.percent_of_all = conditions_.keep_order == "before";
    filter.distractor_threshold = mask_threshold;
    filter.num_threads = num_threads_;
    return filter;
  }

  const fs::path& PoseReference() const {
    return scene_.pose_reference_path.empty() ? paths_.reference : scene_.pose_reference_path;
  }

  void ScoreClouds() {
    CloudSource prediction(paths_.prediction,
                           Filter(conditions_.keep_percent, conditions_.mask_threshold));
    CheckViews(prediction);
    CloudSource reference(
        paths_.reference,
        Filter(conditions_.reference_keep_percent, PredictionFilterOptions().distractor_threshold));
    scores_.conditions["filter"] = prediction.FilterAsJson();
    scores_.conditions["reference_filter"] = reference.FilterAsJson();
    const CloudAlignment alignment =
        conditions_.alignment == "dataset_cameras"
            ? AlignByDataset(prediction, reference, scene_.pose_reference_path)
            : AlignClouds(prediction, reference, conditions_.alignment);
    scores_.conditions["alignment"] = AsJson(alignment);
    Part("points", [&] { ScorePoints(prediction, reference, alignment); });
    Part("depth", [&] { ScoreDepths(prediction, reference, alignment); });
  }

  void CheckViews(const CloudSource& prediction) {
    if (prediction.poses().empty()) return;
    const std::vector<std::string>& wanted = scene_.test_images;
    std::vector<std::string> names;
    for (const auto& [name, pose] : prediction.poses()) names.push_back(name);
    std::vector<std::string> missing;
    std::vector<std::string> others;
    std::set_difference(
        wanted.begin(), wanted.end(), names.begin(), names.end(), std::back_inserter(missing));
    std::set_difference(
        names.begin(), names.end(), wanted.begin(), wanted.end(), std::back_inserter(others));
    scores_.conditions["num_views"] = names.size();
    if (missing.empty() && others.empty()) return;
    scores_.warnings.push_back("views: " + std::to_string(missing.size()) + " of " +
                               std::to_string(wanted.size()) + " test images are missing, " +
                               std::to_string(others.size()) + " others are there");
  }

  void ScorePoints(CloudSource& prediction,
                   CloudSource& reference,
                   const CloudAlignment& alignment) {
    CloudEvaluationOptions options;
    options.use_icp = conditions_.icp != "none";
    options.icp.with_scale = conditions_.icp == "similarity";
    options.icp.max_distance = conditions_.icp_distance;
    options.error.num_normal_neighbours = static_cast<int>(conditions_.num_normal_neighbours);
    options.icp.num_threads = options.error.num_threads = num_threads_;
    const CloudEvaluation evaluation = EvaluateClouds(prediction, reference, alignment, options);
    const CloudError& error = evaluation.error;
    scores_.acc = error.accuracy.mean;
    scores_.comp = error.completeness.mean;
    scores_.overall = error.Overall();
    scores_.nc = error.NormalConsistencyMean();
    scores_.acc_median = error.accuracy.median;
    scores_.comp_median = error.completeness.median;
    scores_.nc_median = error.NormalConsistencyMedian();
    json points = {{"num_points", error.accuracy.num_points},
                   {"num_reference_points", error.completeness.num_points}};
    if (evaluation.icp) {
      points["icp"] = {{"kind", conditions_.icp},
                       {"converged", evaluation.icp->converged},
                       {"num_iterations", evaluation.icp->num_iterations},
                       {"rmse", evaluation.icp->rmse}};
    }
    scores_.conditions["points"] = points;
  }

  void ScoreDepths(CloudSource& prediction,
                   const CloudSource& reference,
                   const CloudAlignment& alignment) {
    DepthEvaluationOptions options;
    options.reproject = conditions_.depth_method == "reprojection";
    options.cloud_of_all_views = conditions_.depth_cloud == "all";
    options.alignment = alignment;
    options.depth_alignment = DepthAlignmentOf(conditions_.depth_alignment);
    options.num_threads = num_threads_;
    const DepthEvaluation evaluation = EvaluateDepths(prediction, reference, options);
    const bool over_pixels = conditions_.depth_mean == "pixels";
    scores_.abs_rel = over_pixels ? evaluation.pooled.AbsRel() : evaluation.mean_abs_rel;
    scores_.delta_percent =
        over_pixels ? evaluation.pooled.WithinPercent() : evaluation.mean_within_percent;
    scores_.conditions["depth"] = {{"num_views", evaluation.views.size()},
                                   {"num_pixels", evaluation.pooled.num_pixels}};
  }

  void ScorePoses() {
    PoseEvaluationOptions options;
    options.input_path = paths_.prediction;
    options.reference_path = PoseReference();
    options.alignment.type = PoseAlignmentOf(conditions_.pose_alignment);
    options.rpe.delta = static_cast<int>(conditions_.rpe_delta);
    const PoseEvaluation evaluation = EvaluatePoses(options);
    scores_.ate = evaluation.ate.rmse;
    json poses = {{"reference", options.reference_path.string()},
                  {"num_views", evaluation.comparison.views.size()},
                  {"order", evaluation.order}};
    if (evaluation.rpe) {
      scores_.rpe_trans = evaluation.rpe->translation.rmse;
      scores_.rpe_rot_deg = evaluation.rpe->rotation_deg.rmse;
      poses["num_pairs"] = evaluation.rpe->num_pairs;
    }
    scores_.conditions["poses"] = poses;
    for (const std::string& warning : evaluation.warnings) {
      scores_.warnings.push_back("poses: " + warning);
    }
  }

  void ScoreTheMasks() {
    MaskScoresOptions options;
    options.predictions_path = paths_.prediction;
    options.threshold = conditions_.mask_threshold;
    options.reference_mask_path = scene_.mask_path;
    options.reference_convention = scene_.mask_convention;
    options.image_path = scene_.image_path;
    options.image_names = scene_.test_images;
    options.num_threads = num_threads_;
    std::vector<MaskScore> all;
    for (const ImageMaskScore& image : ScoreMasks(options)) all.push_back(image.score);
    const MaskRatios mean = MeanRatios(all);
    scores_.mask_accuracy = mean.accuracy;
    scores_.mask_precision = mean.precision;
    scores_.mask_recall = mean.recall;
    scores_.mask_f1 = mean.f1;
    scores_.mask_iou = mean.iou;
    scores_.mask_dice = mean.dice;
    scores_.conditions["masks"] = {{"num_images", all.size()}, {"mean", "images"}};
  }

  const ProtocolScene& scene_;
  const ProtocolConditions& conditions_;
  const ScenePaths& paths_;
  int num_threads_;
  SceneScores scores_;
};

}  // namespace

std::span<const Metric> Metrics() { return kMetrics; }

const Metric* FindMetric(std::string_view key) {
  const auto found = std::find_if(
      std::begin(kMetrics), std::end(kMetrics), [&](const Metric& m) { return m.key == key; });
  return found == std::end(kMetrics) ? nullptr : found;
}

TableMetric ColumnOf(const Metric& metric) {
  const char* arrow = metric.is_lower_better ? "$\\downarrow$" : "$\\uparrow$";
  return {std::string(metric.key),
          std::string(metric.latex) + arrow,
          metric.is_lower_better,
          metric.digits};
}

SceneScores ScoreScene(const ProtocolScene& scene,
                       const ProtocolConditions& conditions,
                       const ScenePaths& paths,
                       int num_threads) {
  return Scorer(scene, conditions, paths, num_threads).Run();
}

}  // namespace vgtw
