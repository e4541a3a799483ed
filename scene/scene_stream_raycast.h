// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"
#include "scene/grid.h"
#include "scene/rigid3d.h"
#include "scene/synthetic_geometry.h"

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// A solid with its look; `surface` is an index into a list kept elsewhere.
struct Piece {
  Solid solid;
  int surface = 0;
};

// What a ray meets, as textures and lamps need it.
struct SurfaceSample {
  Eigen::Vector3f normal_in_world = Eigen::Vector3f::UnitZ();  // unit, towards the visible side
  Eigen::Vector3f point_in_local = Eigen::Vector3f::Zero();    // scene units, in the solid's frame
  int face = 0;                                                // 0..5, of the enclosing box
  float footprint = 0.0f;                                      // side of the pixel's patch
};

// A solid as one view's pixel rays meet it: the law of synthetic_geometry's Intersect in single
// precision, and for whole rectangles of pixels at once. Source of the speed: in the frame where
// the solid is a cube or ball of half size 1, rays are affine functions of the pixel.
class SolidInView {
 public:
  static constexpr float kNothing = std::numeric_limits<float>::infinity();

  // `camera` must be PINHOLE.
  SolidInView(const Solid& solid, const Camera& camera, const Rigid3d& cam_from_world);

  // z-depth at a pixel, kNothing where the ray misses.
  float DepthAt(float x, float y) const;

  // Where a pixel's ray meets the solid at `depth`.
  SurfaceSample Describe(float x, float y, float depth) const;

  // At every pixel centre where the solid is nearer than `depth`, writes its depth and `index`.
  void Cast(int32_t index, Grid<float>& depth, Grid<int32_t>& indices) const;

 private:
  using Vector = std::array<float, 3>;
  template <ShapeKind kind>
  void CastRows(int32_t index, Grid<float>& depth, Grid<int32_t>& indices) const;
  void BoundPixels(const Solid& solid, const Camera& camera, const Rigid3d& cam_from_world);
  Vector DirectionAt(float x, float y) const {
    Vector direction;
    for (size_t i = 0; i < 3; ++i) direction[i] = direction_[i] + y * per_y_[i] + x * per_x_[i];
    return direction;
  }

  ShapeKind kind_;
  // In the frame of the unit solid: the camera's centre and directions of camera z 1.
  Vector origin_;
  Vector direction_;  // at pixel (0, 0)
  Vector per_x_;
  Vector per_y_;
  Eigen::Array3f half_size_;
  Eigen::Matrix3f world_from_local_rotation_;
  float pixel_angle_;                                  // rad, at the image centre
  int min_x_ = 0, min_y_ = 0, end_x_ = 0, end_y_ = 0;  // pixels that may show it
};

// Nearest depth and index of the solid that has it (-1 and kNothing where there is none).
struct HitMap {
  HitMap(int width, int height)
      : depth(width, height, SolidInView::kNothing), index(width, height, -1) {}

  Grid<float> depth;
  Grid<int32_t> index;
};

std::vector<SolidInView> SeePieces(std::span<const Piece> pieces,
                                   const Camera& camera,
                                   const Rigid3d& cam_from_world);

// Adds solids to the map; indices count from first_index.
void CastInto(std::span<const SolidInView> solids, int32_t first_index, HitMap& hits);

}  // namespace vgtw
