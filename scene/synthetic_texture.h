// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Core>

namespace vgtw {

// A procedural surface colour: value noise of many scales under crisp quads, discs, triangles and
// glyphs, so that corner and blob detectors find much at every distance.
struct Texture {
  struct Colours {
    Eigen::Vector3f dark = Eigen::Vector3f::Zero();  // the noise mixes these two, RGB in [0,1]
    Eigen::Vector3f light = Eigen::Vector3f::Ones();
  };
  uint32_t seed = 0;
  std::array<Colours, 6> faces;
  float noise_contrast = 1.0f;
  float figure_density = 1.0f;  // scales the share of places that hold a figure
  double scale = 1.0;           // size of the pattern; 1 suits furniture and walls
};

// Colours of the faces differ by up to `hue_range` turns of the colour circle.
struct TextureStyle {
  double scale = 1.0;
  double max_saturation = 0.7;
  double hue_range = 0.12;
};
Texture MakeTexture(uint64_t seed, const TextureStyle& style = {});

// Smooth noise, zero on the average and rarely beyond [-1,1]: octaves with cells of 0.8 (scene
// units) and smaller, those below `footprint` left out.
float FractalNoise(const Eigen::Vector2d& uv, double footprint, uint32_t seed);

// Well mixed bits of a place on an integer lattice.
uint32_t LatticeHash(uint32_t x, uint32_t y, uint32_t seed);

// RGB in [0,1] at `uv` (scene units) of one face of a body, averaged over about a square of side
// `footprint` (scene units, > 0): finer detail fades out instead of aliasing.
Eigen::Vector3f Albedo(const Texture& texture,
                       int face,
                       const Eigen::Vector2d& uv,
                       double footprint);

}  // namespace vgtw
