// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/depth_evaluation.h"

#include "evaluation/depth_grid.h"
#include "scene/error.h"
#include "scene/parallel.h"

#include <cmath>
#include <functional>
#include <memory>
#include <utility>

namespace vgtw {
namespace {

// The prediction's depth at the pixels of a view of the reference.
using DepthSource = std::function<DepthMap(const std::string& name, const View& reference)>;

DepthSource FromMaps(const CloudSource& prediction) {
  return [&prediction](const std::string& name, const View& reference) {
    const ViewPrediction view = prediction.Filtered(name);
    return RegridDepth(view.view, view.depth, reference, /*max_relative_step=*/HUGE_VAL);
  };
}

DepthSource FromCloud(CloudSource& prediction, const Sim3d& motion, bool of_all_views) {
  if (!of_all_views) {
    return [&prediction, motion](const std::string& name, const View& reference) {
      return ProjectPoints(reference, Moved(motion, WorldPoints(prediction.Filtered(name))));
    };
  }
  const auto points =
      std::make_shared<std::vector<Eigen::Vector3d>>(Moved(motion, prediction.Points()));
  return [points](const std::string&, const View& reference) {
    return ProjectPoints(reference, *points);
  };
}

void FitAndCompare(const std::vector<DepthPairs>& pairs,
                   const DepthEvaluationOptions& options,
                   std::vector<ViewDepthError>& views) {
  const auto alignment = options.reproject ? DepthAlignment::kNone : options.depth_alignment;
  std::optional<DepthFit> common;
  if (options.one_fit) {
    DepthPairs all;
    for (const DepthPairs& of_view : pairs) {
      all.predicted.insert(all.predicted.end(), of_view.predicted.begin(), of_view.predicted.end());
      all.expected.insert(all.expected.end(), of_view.expected.begin(), of_view.expected.end());
    }
    common = FitDepth(all, alignment);
  }
  for (size_t i = 0; i < views.size(); ++i) {
    const auto fit = options.one_fit ? common : FitDepth(pairs[i], alignment);
    if (!fit) continue;
    views[i].fit = *fit;
    views[i].error = CompareDepths(pairs[i], *fit);
  }
}

}  // namespace

DepthEvaluation EvaluateDepths(CloudSource& prediction,
                               const CloudSource& reference,
                               const DepthEvaluationOptions& options,
                               const ProgressCallback& progress) {
  const std::vector<std::string> names = CommonViews(prediction, reference);
  DepthEvaluation evaluation;
  DepthSource predicted_depth;
  if (options.reproject) {
    evaluation.alignment = options.alignment
                               ? *options.alignment
                               : AlignClouds(prediction, reference, options.cloud_alignment);
    predicted_depth = FromCloud(
        prediction, evaluation.alignment->reference_from_prediction, options.cloud_of_all_views);
  } else {
    predicted_depth = FromMaps(prediction);
  }
  std::vector<DepthPairs> pairs(names.size());
  for (const std::string& name : names) evaluation.views.push_back({name, {}, {}});
  ParallelFor(
      static_cast<int64_t>(names.size()),
      options.num_threads,
      [&](int64_t i) {
        const auto idx = static_cast<size_t>(i);
        const ViewPrediction expected = reference.Filtered(names[idx]);
        AddCommonDepths(predicted_depth(names[idx], expected.view),
                        expected.depth,
                        options.max_depth,
                        pairs[idx]);
      },
      progress);
  FitAndCompare(pairs, options, evaluation.views);
  size_t num_with_pixels = 0;
  for (const ViewDepthError& view : evaluation.views) {
    if (view.error.num_pixels == 0) continue;
    evaluation.pooled += view.error;
    evaluation.mean_abs_rel += view.error.AbsRel();
    evaluation.mean_within_percent += view.error.WithinPercent();
    ++num_with_pixels;
  }
  if (num_with_pixels == 0) {
    Fail(prediction.path(),
         "has no depth where " + reference.path().string() + " has",
         "depth maps of the same views",
         "raise --keep_percent, or check --alignment and --max_depth");
  }
  evaluation.mean_abs_rel /= static_cast<double>(num_with_pixels);
  evaluation.mean_within_percent /= static_cast<double>(num_with_pixels);
  return evaluation;
}

}  // namespace vgtw
