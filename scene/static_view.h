// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/confidence_histogram.h"
#include "scene/grid.h"
#include "scene/prediction.h"

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// What one view says about the static scene. Depth comes from the depth map, else from the z of the
// map of points, else from single samples.
class StaticView {
 public:
  struct Point {
    Eigen::Vector3d xyz;                // world
    Eigen::Vector2d pixel_in_original;  // where its depth was measured
    float confidence = 1.0f;            // 1 where none is given
  };

  // A pixel is static if its distractor probability is known and below the threshold; without a
  // mask all are.
  StaticView(ViewPrediction prediction, double distractor_threshold);

  const View& view() const { return prediction_.view; }

  // Adds the confidence of every known depth, static or not.
  void AddConfidencesTo(ConfidenceHistogram& histogram) const;

  // The static depths whose confidence, where given, reaches the threshold.
  std::vector<Point> StaticPoints(double confidence_threshold) const;

  // What was measured at a static pixel of the photo: bilinear in the map (see SampleDepth) with
  // the confidence of the pixel, else the nearest sample within about 1 % of the image; nullopt if
  // nothing is known there. Confidence is 1 where none is given.
  std::optional<DepthSample> DepthAt(const Eigen::Vector2d& pixel_in_original) const;

  // Where the view sees a point of the world, in original pixels: in front, inside the image, on a
  // static pixel, and at the depth measured there up to the relative difference. Samples count
  // within about 1 % of the image around the point.
  std::optional<Eigen::Vector2d> See(const Eigen::Vector3d& point_in_world,
                                     double max_relative_depth_difference) const;

 private:
  void BinSamples();
  bool IsStatic(const Eigen::Vector2d& pixel_in_original) const;
  Eigen::Array2i BinOf(const Eigen::Vector2d& pixel_in_original) const;
  // Calls visit(sample) for the samples around a pixel until it returns true; whether one did.
  template <typename Visit>
  bool AnySampleAround(const Eigen::Vector2d& pixel_in_original, const Visit& visit) const;

  ViewPrediction prediction_;
  double distractor_threshold_ = 0.5;
  PixelMap network_from_original_;
  double bin_edge_px_ = 1.0;
  Grid<std::vector<DepthSample>> samples_by_bin_;  // those on static pixels
};

}  // namespace vgtw
