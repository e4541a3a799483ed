// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/random.h"
#include "scene/scene_stream_photo.h"
#include "scene/scene_stream_raycast.h"
#include "scene/synthetic_texture.h"

#include <vector>

#include <Eigen/Core>

namespace vgtw {

enum class Pattern {
  kFigures,   // the texture of synthetic scenes: noise under quads, discs, triangles and glyphs
  kPlain,     // one colour a face
  kGradient,  // from dark to light, upwards
  kStripes,
  kBricks,   // rows shifted by half a brick, joints
  kTiles,    // a checkerboard with joints
  kWindows,  // a grid of window panes in a wall
  kNoise,    // plaster, grass, stone, foliage
  kWood,     // noise stretched along one direction
  kPhoto,
  kSky  // by direction from the solid's centre: horizon, zenith, clouds; not shaded
};

// How a face looks. Every pattern fades into its mean where it is finer than a pixel.
struct Surface {
  Pattern pattern = Pattern::kPlain;
  Texture texture;                                   // colours of the faces and seeds
  Eigen::Vector2f period = Eigen::Vector2f::Ones();  // of the pattern, across and up, scene units
  float joint = 0.1f;                   // its share that is joint, frame or second stripe
  float dirt = 0.0f;                    // amplitude of noise over the pattern
  float dirt_size = 1.0f;               // scene units
  const PhotoTexture* photo = nullptr;  // kPhoto
};

enum class SurfaceUse {
  kWall,
  kFloor,
  kCeiling,
  kGround,
  kFacade,
  kWood,
  kThing,
  kCloth,
  kSkin,
  kPicture,
  kFoliage,
  kPaint,
  kGlass,
  kRubber,
  kSky
};

// A surface that suits the use; `size` (scene units) is that of the things it covers.
Surface MakeSurface(SurfaceUse use,
                    double size,
                    const std::vector<PhotoTexture>& photos,
                    RandomStream& random);

// RGB in [0,1], before light falls on it.
Eigen::Vector3f SurfaceColour(const Surface& surface, const SurfaceSample& sample);

}  // namespace vgtw
