// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"
#include "scene/prediction.h"
#include "scene/view.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace vgtw {

enum class CameraPath {
  kOrbit,    // on an arc around the scene, looking at its centre
  kForward,  // driving into the scene with slight turns
  kGrid      // rows and columns in a plane, looking along its normal (drone, light field)
};

// A scene with exact truth: a textured static room (ground, walls, boxes, balls; enough corners for
// SIFT) and textured distractors that stand somewhere else, or nowhere, in every view.
struct SyntheticOptions {
  CameraPath path = CameraPath::kOrbit;
  int num_views = 12;                // >= 1
  int width = 640;                   // pixels, >= 32
  int height = 480;                  // pixels, >= 32
  double focal_length_factor = 0.9;  // focal length / max(width, height), in [0.3, 10]
  double radial_distortion = 0.0;    // k of SIMPLE_RADIAL; 0 gives PINHOLE. In [-0.3, 0.3]
  double path_extent_deg = 90.0;     // kOrbit: length of the arc
  int num_distractors = 4;           // movers; >= 0
  double distractor_size = 1.0;      // scales their extent; 1 covers about a fifth of the image
  double distractor_absence = 0.15;  // probability that one is absent from a view, in [0,1]
  double image_noise = 2.0;          // sigma of Gaussian noise in grey levels of 255
  double exposure_change = 0.1;      // sigma of the per-view log gain
  int num_threads = 0;               // 0 = all cores
  uint64_t seed = 0;

  void Check() const;
};

// Everything about one rendered photo. Maps are in original pixels (network size = image size).
struct SyntheticView {
  RgbImage image;
  DepthMap depth;             // z-depth of what is seen, distractors included, exact
  DepthMap static_depth;      // z-depth of the static scene behind them, exact
  DistractorMask distractor;  // exactly 0 or 1, by pixel centre
};

// Geometry and textures are a function of the options alone: the same options give the same bytes,
// whatever the number of threads.
class SyntheticScene {
 public:
  explicit SyntheticScene(const SyntheticOptions& options);
  ~SyntheticScene();
  SyntheticScene(SyntheticScene&&) noexcept;

  const SyntheticOptions& options() const;
  // Names "view_000.png", ...; exact cameras and poses; network size = image size.
  const std::vector<View>& views() const;
  // Diameter of the set of camera centres (scene units): the unit of "% of extent".
  double CameraExtent() const;

  SyntheticView Render(size_t view_idx) const;

  // Where the ray of a pixel of a view meets the static scene; for checking triangulated points.
  // nullopt if it meets nothing.
  std::optional<Eigen::Vector3d> StaticPoint(size_t view_idx, const Eigen::Vector2d& pixel) const;

 private:
  friend Prediction MakeTruePrediction(const SyntheticScene& scene, int network_width);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// What a perfect network of input width `network_width` (VGGT's crop loader) would say: true poses
// and intrinsics, static depth resampled at network pixel centres (NaN where a depth edge makes it
// ambiguous), depth_conf 1..10 falling with depth and 1 on distractors, distractor probabilities
// 0 or 1 by nearest pixel. No picture is rendered.
Prediction MakeTruePrediction(const SyntheticScene& scene, int network_width = 518);

}  // namespace vgtw
