// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"
#include "scene/depth_map.h"
#include "scene/distractor_mask.h"
#include "scene/image_io.h"
#include "scene/rigid3d.h"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

namespace vgtw {

// What distractors look like and what makes them inconsistent between views; bits of
// SceneStreamOptions::distractor_kinds.
enum DistractorKind : uint32_t {
  kPersonDistractors = 1u << 0,     // bodies: standing or walking people
  kCarDistractors = 1u << 1,        // cars, toy cars on a table
  kThingDistractors = 1u << 2,      // furniture, parcels, bottles, plants, ...
  kMovingDistractors = 1u << 3,     // ways: the same body stands elsewhere in every view
  kAbsentDistractors = 1u << 4,     // it is missing from some of the views
  kDeformingDistractors = 1u << 5,  // it stays, but its parts change size and place with the view
  kOccludingDistractors = 1u << 6,  // close to the camera, reaching in from the image border
  // Static bodies with the same shapes and textures as the distractors stand in the scene, so that
  // only inconsistency between views tells a distractor.
  kStaticLookAlikes = 1u << 7,
};
inline constexpr uint32_t kAllDistractorKinds = (1u << 8) - 1;

struct SceneStreamOptions {
  int width = 112;                // pixels, in [16, 4096]
  int height = 84;                // pixels, in [16, 4096]
  int min_views = 2;              // >= 2
  int max_views = 6;              // in [min_views, 64]
  double distractor_share = 1.0;  // probability that a scene has distractors at all, in [0,1]
  uint32_t distractor_kinds = kAllDistractorKinds;  // at least one body and one way
  // Photos that become textures of some faces; empty = procedural textures only. At most 256 of the
  // folder are read, spread evenly over the sorted names.
  std::filesystem::path texture_folder;
  uint64_t seed = 0;

  void Check() const;
};

// One scene as a few views see it; index i of every vector is view i, in the order of the camera's
// path: neighbours see much of the same. Maps are [H,W] in the pixels of `images`.
struct SceneSample {
  std::vector<RgbImage> images;
  std::vector<DepthMap> depth;         // z-depth of what is seen, distractors included; never NaN
  std::vector<DepthMap> static_depth;  // z-depth of the static scene behind them; never NaN
  // Exactly 0 or 1: a distractor body is what the pixel's centre shows. Equals depth <
  // static_depth.
  std::vector<DistractorMask> distractor;
  std::vector<Camera> cameras;          // PINHOLE
  std::vector<Rigid3d> cam_from_world;  // z of the world is up; unit about a metre
};

// An endless stream of procedural scenes for training: rooms, table tops, streets and facades with
// furniture, people and cars; varied cameras, light, textures and exposure. Outdoors the sky is a
// dome as consistent between views as a wall; its z-depth is above 75 scene units, while of all
// else only the ground reaches beyond 60. Laws: a sample is a function of options (with the texture
// folder's content) and idx alone. Where a scene has distractors, they cover 2 to 35 % of its
// images' pixels together.
class SceneStream {
 public:
  // Throws Error if texture_folder is set, but is missing, holds no image or a damaged one.
  explicit SceneStream(const SceneStreamOptions& options);
  ~SceneStream();
  SceneStream(SceneStream&&) noexcept;
  SceneStream& operator=(SceneStream&&) noexcept;

  const SceneStreamOptions& options() const;

  // Thread-safe; runs on the calling thread alone.
  SceneSample Sample(uint64_t idx) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vgtw
