// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/prediction.h"

#include <cstddef>
#include <functional>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

struct PredictionFilterOptions {
  // Share of the depths that is kept, the most confident ones, in percent, (0, 100].
  double keep_percent = 50.0;
  // Of all views' depths together, as VGTW's authors do, or of each view's.
  bool pool_views = true;
  // Of all depths, as VGTW's authors do (so that less than the share remains where distractors are
  // confident), or of those that are not on distractors.
  bool percent_of_all = true;
  // A pixel with at least this distractor probability, or an unknown one, is left out; in (0, 1].
  // Views without a mask are static.
  double distractor_threshold = 0.5;
  int num_threads = 0;  // 0 = all cores

  void Check() const;
};

// What of predictions counts. Without confidences every depth is kept.
class PredictionFilter {
 public:
  // Gives a view; called by several threads at once.
  using Load = std::function<ViewPrediction(size_t view_idx)>;

  // Loads every view once if confidences are pooled, one per thread at a time.
  PredictionFilter(size_t num_views, Load load, const PredictionFilterOptions& options);

  size_t num_views() const { return num_views_; }

  // Confidence from which depths are kept, if that is one number for all views; else 0.
  double pooled_threshold() const { return pooled_threshold_; }

  // The view with unknown depth where it is left out, its samples likewise; confidences, mask and
  // points have done their work and are empty. Depth comes from points where there is no map of it.
  ViewPrediction Filtered(size_t view_idx) const;

 private:
  double ThresholdOf(const ViewPrediction& prediction) const;

  size_t num_views_;
  Load load_;
  PredictionFilterOptions options_;
  double pooled_threshold_ = 0.0;
};

// World points of a filtered view: its depths, unprojected with its camera.
std::vector<Eigen::Vector3d> WorldPoints(ViewPrediction filtered);

// Those of all views, in their order.
std::vector<Eigen::Vector3d> WorldPoints(const PredictionFilter& filter, int num_threads = 0);

// The same static places seen by two predictions.
struct PointPairs {
  std::vector<Eigen::Vector3d> in_prediction;
  std::vector<Eigen::Vector3d> in_reference;
};

// Adds the pairs of world points of two filtered views of the same photo: at every pixel of the
// prediction where both have depth, as Umeyama "on pixel correspondences" takes them. Where the
// grids differ the reference is read bilinearly, except across its depth edges.
void AddPixelPairs(const ViewPrediction& prediction,
                   const ViewPrediction& reference,
                   PointPairs& pairs);

}  // namespace vgtw
