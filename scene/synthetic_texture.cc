// SPDX-License-Identifier: BSD-3-Clause
#include "scene/synthetic_texture.h"

#include "scene/random.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace vgtw {

// Cheaper than HashKey: called about ten times per sample of a picture.
uint32_t LatticeHash(uint32_t x, uint32_t y, uint32_t seed) {
  uint32_t hash = x * 0x8da6b343u ^ y * 0xd8163841u ^ seed;
  hash = (hash ^ (hash >> 16)) * 0x7feb352du;
  hash = (hash ^ (hash >> 15)) * 0x846ca68bu;
  return hash ^ (hash >> 16);
}

namespace {

float ToUnit(uint32_t bits) { return static_cast<float>(bits & 0xffffu) / 65535.0f; }

struct Cell {
  uint32_t x = 0;
  uint32_t y = 0;
  float u = 0.0f;  // position in the cell, [0,1)
  float v = 0.0f;
};

// std::floor and std::lerp are calls with special cases, several times the cost of these.
int32_t Floor(double x) {
  const auto truncated = static_cast<int32_t>(x);
  return truncated - (truncated > x ? 1 : 0);
}

float Lerp(float a, float b, float weight) { return a + weight * (b - a); }

Cell FindCell(const Eigen::Vector2d& uv, double cell_size) {
  const Eigen::Vector2d position = uv / cell_size;
  const int32_t x = Floor(position.x());
  const int32_t y = Floor(position.y());
  return {static_cast<uint32_t>(x),
          static_cast<uint32_t>(y),
          static_cast<float>(position.x() - x),
          static_cast<float>(position.y() - y)};
}

float SmoothStep(float t) { return t * t * (3.0f - 2.0f * t); }

// Smooth noise in [-1,1] with one random value per lattice corner.
float ValueNoise(const Eigen::Vector2d& uv, double cell_size, uint32_t seed) {
  const Cell cell = FindCell(uv, cell_size);
  const float u = SmoothStep(cell.u);
  const float v = SmoothStep(cell.v);
  const float top = Lerp(
      ToUnit(LatticeHash(cell.x, cell.y, seed)), ToUnit(LatticeHash(cell.x + 1, cell.y, seed)), u);
  const float bottom = Lerp(ToUnit(LatticeHash(cell.x, cell.y + 1, seed)),
                            ToUnit(LatticeHash(cell.x + 1, cell.y + 1, seed)),
                            u);
  return 2.0f * Lerp(top, bottom, v) - 1.0f;
}

// 1 while a detail of size `detail` is at least two footprints large, 0 below one.
float Visibility(double detail, double footprint) {
  return static_cast<float>(std::clamp(detail / footprint - 1.0, 0.0, 1.0));
}

// Signed distances to the edge, positive inside, for a figure of half extent `half` around 0.
float QuadDistance(float x, float y, float half, float aspect) {
  return std::min(half - std::abs(x), half * aspect - std::abs(y));
}

float DiscDistance(float x, float y, float half) { return half - std::hypot(x, y); }

float TriangleDistance(float x, float y, float half) {
  constexpr float kSin60 = 0.8660254f;
  return std::min(half * 0.5f + y, half * 0.5f - kSin60 * std::abs(x) - 0.5f * y);
}

// A random pattern of 4 x 4 squares, like a letter of an unknown script.
float GlyphDistance(float x, float y, float half, uint32_t bits) {
  const float element = 0.5f * half;
  const float column = (x + half) / element;
  const float row = (y + half) / element;
  if (!(column >= 0.0f && column < 4.0f && row >= 0.0f && row < 4.0f)) return -half;
  const int index = static_cast<int>(row) * 4 + static_cast<int>(column);
  const float u = column - std::trunc(column);
  const float v = row - std::trunc(row);
  const float to_edge = element * std::min(std::min(u, 1.0f - u), std::min(v, 1.0f - v));
  return (bits >> index & 1u) != 0 ? to_edge : -to_edge;
}

struct Figure {
  float coverage = 0.0f;  // [0,1]
  uint32_t colour_bits = 0;
};

// At most one figure per cell, turned by any angle, never reaching over the cell's border.
Figure FigureInCell(const Cell& cell, float occupancy, float edge_width, uint32_t seed) {
  const uint32_t bits = LatticeHash(cell.x, cell.y, seed);
  if (ToUnit(bits) > occupancy) return {};
  const uint32_t more = LatticeHash(bits, 1, seed);
  const float half =
      0.17f + 0.14f * ToUnit(more);  // of the cell, whose half diagonal is 0.31 * 1.41
  const float slack = 0.5f - 1.4142f * half;
  const float x = cell.u - 0.5f - slack * (2.0f * ToUnit(more >> 8) - 1.0f);
  const float y = cell.v - 0.5f - slack * (2.0f * ToUnit(more >> 16) - 1.0f);
  const float angle = 2.0f * std::numbers::pi_v<float> * ToUnit(bits >> 16);
  const float c = std::cos(angle);
  const float s = std::sin(angle);
  const float turned_x = c * x + s * y;
  const float turned_y = c * y - s * x;
  float distance = 0.0f;
  switch (more >> 30) {
    case 0:
      distance = QuadDistance(turned_x, turned_y, half, 0.35f + 0.65f * ToUnit(bits >> 8));
      break;
    case 1:
      distance = DiscDistance(turned_x, turned_y, half);
      break;
    case 2:
      distance = TriangleDistance(turned_x, turned_y, half);
      break;
    default:
      distance = GlyphDistance(turned_x, turned_y, half, LatticeHash(bits, 2, seed));
      break;
  }
  return {std::clamp(0.5f + distance / edge_width, 0.0f, 1.0f), LatticeHash(bits, 3, seed)};
}

// Strong colours: half of the figures dark, half bright.
Eigen::Vector3f FigureColour(uint32_t bits) {
  const float base = (bits & 1u) != 0 ? 0.05f : 0.62f;
  const Eigen::Vector3f variation(ToUnit(bits >> 1), ToUnit(bits >> 9), ToUnit(bits >> 16));
  return Eigen::Vector3f::Constant(base) + 0.33f * variation;
}

// `hue` in turns, saturation and value in [0,1].
Eigen::Vector3f ColourOfHue(double hue, double saturation, double value) {
  Eigen::Vector3f colour;
  for (int channel = 0; channel < 3; ++channel) {
    const double phase = 2.0 * std::numbers::pi * (hue - channel / 3.0);
    const double weight = 0.5 + 0.5 * std::cos(phase);
    colour[channel] = static_cast<float>(value * (1.0 - saturation * (1.0 - weight)));
  }
  return colour;
}

}  // namespace

float FractalNoise(const Eigen::Vector2d& uv, double footprint, uint32_t seed) {
  constexpr std::array<float, 6> kAmplitudes = {0.34f, 0.28f, 0.24f, 0.20f, 0.16f, 0.12f};
  constexpr double kLargestCell = 0.8;
  float sum = 0.0f;
  double cell_size = kLargestCell;
  for (size_t octave = 0; octave < kAmplitudes.size(); ++octave, cell_size *= 0.5) {
    const float visibility = Visibility(cell_size, footprint);
    if (visibility == 0.0f) break;
    const uint32_t octave_seed = seed + static_cast<uint32_t>(octave) * 0x9e3779b9u;
    sum += kAmplitudes[octave] * visibility * ValueNoise(uv, cell_size, octave_seed);
  }
  return sum;
}

Texture MakeTexture(uint64_t seed, const TextureStyle& style) {
  RandomStream random(HashKey({seed}));
  Texture texture;
  texture.seed = static_cast<uint32_t>(random.Bits());
  texture.scale = style.scale;
  texture.noise_contrast = static_cast<float>(random.Uniform(0.5, 1.0));
  texture.figure_density = static_cast<float>(random.Uniform(0.6, 1.0));
  const double hue = random.Uniform();
  const double saturation = random.Uniform(0.3, 1.0) * style.max_saturation;
  for (Texture::Colours& face : texture.faces) {
    const double face_hue = hue + style.hue_range * random.Uniform(-0.5, 0.5);
    face.dark = ColourOfHue(face_hue, saturation, random.Uniform(0.2, 0.4));
    face.light = ColourOfHue(face_hue + 0.08, saturation, random.Uniform(0.65, 0.95));
  }
  return texture;
}

Eigen::Vector3f Albedo(const Texture& texture,
                       int face,
                       const Eigen::Vector2d& uv,
                       double footprint) {
  const Eigen::Vector2d scaled_uv = uv / texture.scale;
  const double scaled_footprint = footprint / texture.scale;
  const uint32_t face_seed = texture.seed + 0x51ed270bu * static_cast<uint32_t>(face + 1);
  const float noise = FractalNoise(scaled_uv, scaled_footprint, face_seed);
  const float mix = std::clamp(0.5f + texture.noise_contrast * noise, 0.0f, 1.0f);
  const Texture::Colours& colours = texture.faces[static_cast<size_t>(face)];
  Eigen::Vector3f colour = colours.dark + mix * (colours.light - colours.dark);
  struct Layer {
    double cell_size;
    float occupancy;
  };
  constexpr std::array<Layer, 4> kLayers = {
      {{0.83, 0.60f}, {0.37, 0.45f}, {0.17, 0.30f}, {0.075, 0.20f}}};
  for (size_t i = 0; i < kLayers.size(); ++i) {
    const Layer& layer = kLayers[i];
    // A figure is about half a cell large, its parts an eighth.
    const float visibility = Visibility(0.25 * layer.cell_size, scaled_footprint);
    if (visibility == 0.0f) break;
    const Figure figure = FigureInCell(FindCell(scaled_uv, layer.cell_size),
                                       layer.occupancy * texture.figure_density,
                                       static_cast<float>(scaled_footprint / layer.cell_size),
                                       face_seed ^ (0xa511e9b3u * static_cast<uint32_t>(i + 1)));
    if (figure.coverage == 0.0f) continue;
    colour += visibility * figure.coverage * (FigureColour(figure.colour_bits) - colour);
  }
  return colour;
}

}  // namespace vgtw
