// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/prediction_filter.h"

#include "evaluation/depth_grid.h"
#include "scene/confidence_histogram.h"
#include "scene/error.h"
#include "scene/parallel.h"
#include "scene/static_view.h"

#include <cmath>
#include <limits>
#include <mutex>
#include <string>
#include <utility>

namespace vgtw {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

// Whether something is static, and how confident its depth.
class Judge {
 public:
  Judge(const ViewPrediction& prediction, double distractor_threshold)
      : prediction_(prediction),
        network_from_original_(Inverse(prediction.view.original_from_network)),
        distractor_threshold_(distractor_threshold) {}

  bool IsStatic(size_t pixel_idx) const {
    const DistractorMask& distractor = prediction_.distractor;
    return distractor.empty() || distractor.data()[pixel_idx] < distractor_threshold_;
  }

  bool IsStatic(const DepthSample& sample) const {
    const DistractorMask& distractor = prediction_.distractor;
    if (distractor.empty()) return true;
    const Eigen::Vector2d pixel =
        Apply(network_from_original_, sample.pixel_in_original.cast<double>());
    if (!(pixel.x() >= 0.0 && pixel.x() < distractor.width() && pixel.y() >= 0.0 &&
          pixel.y() < distractor.height())) {
      return false;
    }
    return distractor(static_cast<int>(pixel.x()), static_cast<int>(pixel.y())) <
           distractor_threshold_;
  }

  float Confidence(size_t pixel_idx) const {
    return prediction_.depth_conf.empty() ? 1.0f : prediction_.depth_conf.data()[pixel_idx];
  }

 private:
  const ViewPrediction& prediction_;
  PixelMap network_from_original_;
  double distractor_threshold_;
};

void AddConfidences(const ViewPrediction& prediction,
                    const PredictionFilterOptions& options,
                    ConfidenceHistogram& histogram) {
  const Judge judge(prediction, options.distractor_threshold);
  for (size_t i = 0; i < prediction.depth.size(); ++i) {
    if (!std::isfinite(prediction.depth.data()[i])) continue;
    if (options.percent_of_all || judge.IsStatic(i)) histogram.Add(judge.Confidence(i));
  }
  if (!prediction.depth.empty()) return;
  for (const DepthSample& sample : prediction.depth_samples) {
    if (options.percent_of_all || judge.IsStatic(sample)) histogram.Add(sample.confidence);
  }
}

ViewPrediction WithDepth(ViewPrediction prediction) {
  if (prediction.depth.empty()) {
    prediction.depth = DepthFromPoints(prediction.view, prediction.points);
  }
  return prediction;
}

}  // namespace

void PredictionFilterOptions::Check() const {
  VGTW_CHECK(keep_percent > 0.0 && keep_percent <= 100.0,
             "PredictionFilterOptions::keep_percent = " + std::to_string(keep_percent) +
                 ", must be in (0, 100]");
  VGTW_CHECK(distractor_threshold > 0.0 && distractor_threshold <= 1.0,
             "PredictionFilterOptions::distractor_threshold = " +
                 std::to_string(distractor_threshold) + ", must be in (0, 1]");
}

PredictionFilter::PredictionFilter(size_t num_views,
                                   Load load,
                                   const PredictionFilterOptions& options)
    : num_views_(num_views), load_(std::move(load)), options_(options) {
  options_.Check();
  if (!options_.pool_views || options_.keep_percent == 100.0) return;
  ConfidenceHistogram histogram;
  std::mutex mutex;
  ParallelFor(static_cast<int64_t>(num_views_), options_.num_threads, [&](int64_t i) {
    ConfidenceHistogram of_view;
    AddConfidences(WithDepth(load_(static_cast<size_t>(i))), options_, of_view);
    const std::lock_guard lock(mutex);
    histogram.Add(of_view);
  });
  pooled_threshold_ = histogram.ThresholdKeeping(options_.keep_percent);
}

double PredictionFilter::ThresholdOf(const ViewPrediction& prediction) const {
  if (options_.keep_percent == 100.0) return -std::numeric_limits<double>::infinity();
  if (options_.pool_views) return pooled_threshold_;
  ConfidenceHistogram histogram;
  AddConfidences(prediction, options_, histogram);
  return histogram.ThresholdKeeping(options_.keep_percent);
}

ViewPrediction PredictionFilter::Filtered(size_t view_idx) const {
  ViewPrediction prediction = WithDepth(load_(view_idx));
  const double threshold = ThresholdOf(prediction);
  const Judge judge(prediction, options_.distractor_threshold);
  for (size_t i = 0; i < prediction.depth.size(); ++i) {
    if (!judge.IsStatic(i) || !(judge.Confidence(i) >= threshold)) {
      prediction.depth.data()[i] = kUnknown;
    }
  }
  std::erase_if(prediction.depth_samples, [&](const DepthSample& sample) {
    return !judge.IsStatic(sample) || !(sample.confidence >= threshold);
  });
  prediction.depth_conf = {};
  prediction.distractor = {};
  prediction.points = {};
  return prediction;
}

std::vector<Eigen::Vector3d> WorldPoints(ViewPrediction filtered) {
  constexpr double kAll = -std::numeric_limits<double>::infinity();
  std::vector<Eigen::Vector3d> points;
  const StaticView view(std::move(filtered), /*distractor_threshold=*/1.0);
  for (const StaticView::Point& point : view.StaticPoints(kAll)) points.push_back(point.xyz);
  return points;
}

std::vector<Eigen::Vector3d> WorldPoints(const PredictionFilter& filter, int num_threads) {
  std::vector<std::vector<Eigen::Vector3d>> by_view(filter.num_views());
  ParallelFor(static_cast<int64_t>(by_view.size()), num_threads, [&](int64_t i) {
    const auto view_idx = static_cast<size_t>(i);
    by_view[view_idx] = WorldPoints(filter.Filtered(view_idx));
  });
  std::vector<Eigen::Vector3d> points;
  for (std::vector<Eigen::Vector3d>& of_view : by_view) {
    points.insert(points.end(), of_view.begin(), of_view.end());
    of_view = {};
  }
  return points;
}

void AddPixelPairs(const ViewPrediction& prediction,
                   const ViewPrediction& reference,
                   PointPairs& pairs) {
  constexpr double kMaxRelativeStep = 0.05;
  const DepthMap reference_depth =
      RegridDepth(reference.view, reference.depth, prediction.view, kMaxRelativeStep);
  View reference_view = reference.view;
  reference_view.original_from_network = prediction.view.original_from_network;
  for (int y = 0; y < prediction.depth.height(); ++y) {
    for (int x = 0; x < prediction.depth.width(); ++x) {
      const auto in_prediction = UnprojectPixel(prediction.view, prediction.depth, x, y);
      if (!in_prediction) continue;
      const auto in_reference = UnprojectPixel(reference_view, reference_depth, x, y);
      if (!in_reference) continue;
      pairs.in_prediction.push_back(*in_prediction);
      pairs.in_reference.push_back(*in_reference);
    }
  }
}

}  // namespace vgtw
