// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_surface.h"

#include "scene/scene_stream_noise.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

namespace vgtw {
namespace {

// A place on a face: u across, v up (or along y, on horizontal faces).
struct FacePlace {
  float u;
  float v;
  float footprint;
  uint32_t seed;  // of this face
  const Texture::Colours& colours;
};

FacePlace FindPlace(const Surface& surface, const SurfaceSample& sample) {
  const Eigen::Vector3f& local = sample.point_in_local;
  const int axis = sample.face / 2;
  const Eigen::Vector2f uv = axis == 0   ? Eigen::Vector2f(local.y(), local.z())
                             : axis == 1 ? Eigen::Vector2f(local.x(), local.z())
                                         : Eigen::Vector2f(local.x(), local.y());
  return {uv.x(),
          uv.y(),
          sample.footprint,
          surface.texture.seed + 0x51ed270bu * static_cast<uint32_t>(sample.face + 1),
          surface.texture.faces[static_cast<size_t>(sample.face)]};
}

Eigen::Vector3f Mix(const Eigen::Vector3f& a, const Eigen::Vector3f& b, float weight) {
  return a + weight * (b - a);
}

// Share of an interval of width `footprint` around x that lies in [min, max].
float Coverage(float x, float min, float max, float footprint) {
  const float from = std::max(x - 0.5f * footprint, min);
  const float to = std::min(x + 0.5f * footprint, max);
  return std::max(0.0f, to - from) / footprint;
}

// Share of [0, share) in a wave of period 1 under a window of width `width` around x.
float PulseCoverage(float x, float share, float width) {
  if (width >= 1.0f) return share;
  const float place = x - std::floor(x);
  return Coverage(place, 0.0f, share, width) + Coverage(place - 1.0f, 0.0f, share, width) +
         Coverage(place + 1.0f, 0.0f, share, width);
}

// 1 while cells of size `period` can be told apart, 0 where a pixel covers one.
float CellVisibility(float period, float footprint) {
  return std::clamp(2.0f - 2.0f * footprint / period, 0.0f, 1.0f);
}

float CellNoise(float column, float row, uint32_t seed) {
  const uint32_t bits = LatticeHash(static_cast<uint32_t>(static_cast<int32_t>(column)),
                                    static_cast<uint32_t>(static_cast<int32_t>(row)),
                                    seed);
  return static_cast<float>(bits & 0xffffu) / 65535.0f;
}

Eigen::Vector3f Stripes(const Surface& surface, const FacePlace& place) {
  const float period = surface.period.x();
  const float share = PulseCoverage(place.u / period, surface.joint, place.footprint / period);
  return Mix(place.colours.light, place.colours.dark, share);
}

Eigen::Vector3f Bricks(const Surface& surface, const FacePlace& place, bool is_checkered) {
  const Eigen::Vector2f& period = surface.period;
  const float row = std::floor(place.v / period.y());
  const float shift = is_checkered ? 0.0f : 0.5f * row;
  const float column_position = place.u / period.x() + shift;
  const float column = std::floor(column_position);
  const float joint =
      PulseCoverage(place.v / period.y(), surface.joint, place.footprint / period.y());
  const float joint_share = surface.joint * period.y() / period.x();
  const float side_joint =
      PulseCoverage(column_position, joint_share, place.footprint / period.x());
  const float visibility = CellVisibility(period.y(), place.footprint);
  const float noise = CellNoise(column, row, place.seed) - 0.5f;
  const bool is_odd = is_checkered && std::fmod(std::abs(row + column), 2.0f) == 1.0f;
  const float checker = is_checkered ? (is_odd ? 0.45f : -0.1f) : 0.0f;
  const float mean = is_checkered ? 0.175f : 0.0f;
  const float darkness = mean + visibility * (0.3f * noise + checker - mean);
  const Eigen::Vector3f brick = Mix(place.colours.light, place.colours.dark, 0.25f + darkness);
  const Eigen::Vector3f mortar = 0.5f * (place.colours.light + place.colours.dark);
  return Mix(brick, 0.8f * mortar, joint + side_joint - joint * side_joint);
}

// Panes with a frame, each with a reflection of its own.
Eigen::Vector3f Windows(const Surface& surface,
                        const SurfaceSample& sample,
                        const FacePlace& place) {
  if (sample.face / 2 == 2) return place.colours.dark;
  const Eigen::Vector2f& period = surface.period;
  const Eigen::Vector2f cell(std::floor(place.u / period.x()), std::floor(place.v / period.y()));
  const Eigen::Vector2f at(place.u / period.x() - cell.x(), place.v / period.y() - cell.y());
  const Eigen::Vector2f width(place.footprint / period.x(), place.footprint / period.y());
  const float margin = surface.joint;
  const auto pane = [&](float border) {
    return Coverage(at.x(), margin + border, 1.0f - margin - border, width.x()) *
           Coverage(at.y(), margin + border, 1.0f - 0.8f * margin - border, width.y());
  };
  const float frame = 0.06f;
  const float bar = Coverage(at.x(), 0.47f, 0.53f, width.x());
  const float glass = CellNoise(cell.x(), cell.y(), place.seed);
  const Eigen::Vector3f reflection = Eigen::Vector3f(0.12f, 0.15f, 0.19f) +
                                     (0.35f * glass * at.y()) * Eigen::Vector3f(0.8f, 0.95f, 1.1f);
  const Eigen::Vector3f wall = place.colours.light;
  const Eigen::Vector3f framed = Mix(wall, Eigen::Vector3f::Constant(0.85f), pane(0.0f));
  return Mix(framed, reflection, pane(frame) * (1.0f - bar));
}

// Stretched along v where `stretch` > 1.
Eigen::Vector3f Noise(const FacePlace& place, float scale, float stretch) {
  const float noise = TableNoise(place.u / scale,
                                 place.v / (scale * stretch),
                                 place.footprint / (scale * std::sqrt(stretch)),
                                 place.seed);
  return Mix(place.colours.dark, place.colours.light, std::clamp(0.5f + noise, 0.0f, 1.0f));
}

Eigen::Vector3f Photo(const Surface& surface, const FacePlace& place) {
  const float offset_u = CellNoise(0.0f, 1.0f, place.seed);
  const float offset_v = CellNoise(1.0f, 0.0f, place.seed);
  const float width = surface.period.x();
  return surface.photo->ColourAt({place.u / width + offset_u, offset_v - place.v / width},
                                 place.footprint / width);
}

Eigen::Vector3f Sky(const Surface& surface, const SurfaceSample& sample) {
  const Eigen::Vector3f direction = sample.point_in_local.normalized();
  const float elevation = std::max(0.0f, direction.z());
  const Texture::Colours& colours = surface.texture.faces[0];
  const Eigen::Vector3f clear = Mix(colours.light, colours.dark, std::sqrt(elevation));
  const Eigen::Vector2f cloud_place = direction.head<2>() / (elevation + 0.25f);
  const float cloud =
      FractalNoise((surface.period.x() * cloud_place).cast<double>(), 0.05, surface.texture.seed);
  const float cover = std::clamp(surface.joint + 1.5f * cloud, 0.0f, 1.0f);
  return Mix(clear, Eigen::Vector3f::Constant(0.95f), cover);
}

Eigen::Vector3f PatternColour(const Surface& surface,
                              const SurfaceSample& sample,
                              const FacePlace& place) {
  switch (surface.pattern) {
    case Pattern::kFigures:
      return Albedo(surface.texture, sample.face, {place.u, place.v}, place.footprint);
    case Pattern::kGradient:
      return Mix(place.colours.dark,
                 place.colours.light,
                 std::clamp(0.5f + place.v / surface.period.y(), 0.0f, 1.0f));
    case Pattern::kStripes:
      return Stripes(surface, place);
    case Pattern::kBricks:
    case Pattern::kTiles:
      return Bricks(surface, place, surface.pattern == Pattern::kTiles);
    case Pattern::kWindows:
      return Windows(surface, sample, place);
    case Pattern::kNoise:
      return Noise(place, surface.period.x(), 1.0f);
    case Pattern::kWood:
      return Noise(place, surface.period.x(), 8.0f);
    case Pattern::kPhoto:
      return Photo(surface, place);
    case Pattern::kSky:
      return Sky(surface, sample);
    case Pattern::kPlain:
      break;
  }
  return place.colours.light;
}

struct Look {
  Pattern pattern;
  double weight;
};

Pattern Draw(std::initializer_list<Look> looks, RandomStream& random) {
  double rest = 0.0;
  for (const Look& look : looks) rest += look.weight;
  rest *= random.Uniform();
  for (const Look& look : looks) {
    rest -= look.weight;
    if (rest < 0.0) return look.pattern;
  }
  return looks.begin()->pattern;
}

Pattern DrawPattern(SurfaceUse use, bool has_photos, RandomStream& random) {
  using enum Pattern;
  const double photo = has_photos ? 1.0 : 0.0;
  switch (use) {
    case SurfaceUse::kWall:
      return Draw({{kPlain, 3},
                   {kGradient, 1},
                   {kStripes, 1},
                   {kNoise, 3},
                   {kBricks, 1.5},
                   {kFigures, 1},
                   {kPhoto, photo}},
                  random);
    case SurfaceUse::kFloor:
      return Draw({{kTiles, 2},
                   {kWood, 3},
                   {kNoise, 2},
                   {kPlain, 1},
                   {kFigures, 1.5},
                   {kPhoto, 0.5 * photo}},
                  random);
    case SurfaceUse::kCeiling:
      return Draw({{kPlain, 4}, {kTiles, 1}, {kNoise, 1}}, random);
    case SurfaceUse::kGround:
      return Draw({{kNoise, 4}, {kTiles, 1}, {kBricks, 1}}, random);
    case SurfaceUse::kFacade:
      return Draw({{kWindows, 5}, {kBricks, 2}, {kNoise, 1}, {kPhoto, 2 * photo}}, random);
    case SurfaceUse::kWood:
      return Draw({{kWood, 4}, {kPlain, 2}, {kNoise, 1}}, random);
    case SurfaceUse::kThing:
      return Draw({{kFigures, 4},
                   {kPlain, 2},
                   {kStripes, 1.5},
                   {kGradient, 1},
                   {kNoise, 1},
                   {kTiles, 0.5},
                   {kPhoto, 2.5 * photo}},
                  random);
    case SurfaceUse::kCloth:
      return Draw({{kPlain, 3}, {kStripes, 2}, {kNoise, 2}, {kFigures, 1.5}, {kTiles, 0.5}},
                  random);
    case SurfaceUse::kPicture:
      return Draw({{kFigures, 3}, {kGradient, 1}, {kPhoto, 9 * photo}}, random);
    case SurfaceUse::kFoliage:
      return kNoise;
    case SurfaceUse::kSky:
      return kSky;
    case SurfaceUse::kSkin:
    case SurfaceUse::kPaint:
    case SurfaceUse::kGlass:
    case SurfaceUse::kRubber:
      break;
  }
  return kPlain;
}

void SetColours(Surface& surface, const Eigen::Vector3f& dark, const Eigen::Vector3f& light) {
  surface.texture.faces.fill({dark, light});
}

// Where a use has a colour of its own.
void TintForUse(SurfaceUse use, Surface& surface, RandomStream& random) {
  const auto tone = static_cast<float>(random.Uniform());
  switch (use) {
    case SurfaceUse::kSkin: {
      const Eigen::Vector3f skin =
          Mix(Eigen::Vector3f(0.30f, 0.19f, 0.13f), Eigen::Vector3f(0.92f, 0.74f, 0.62f), tone);
      return SetColours(surface, 0.8f * skin, skin);
    }
    case SurfaceUse::kFoliage: {
      const Eigen::Vector3f leaf =
          Mix(Eigen::Vector3f(0.25f, 0.45f, 0.15f), Eigen::Vector3f(0.55f, 0.60f, 0.25f), tone);
      return SetColours(surface, 0.25f * leaf, leaf);
    }
    case SurfaceUse::kWood: {
      const Eigen::Vector3f brown =
          Mix(Eigen::Vector3f(0.42f, 0.26f, 0.16f), Eigen::Vector3f(0.85f, 0.70f, 0.50f), tone);
      if (random.Chance(0.75)) SetColours(surface, 0.6f * brown, brown);
      return;
    }
    case SurfaceUse::kWall:
    case SurfaceUse::kFloor:
    case SurfaceUse::kCeiling:
    case SurfaceUse::kFacade:
      for (Texture::Colours& face : surface.texture.faces) {
        face.dark = Mix(face.dark, face.light, 0.6f * tone);
      }
      return;
    case SurfaceUse::kGlass:
      return SetColours(surface,
                        Eigen::Vector3f(0.06f, 0.07f, 0.09f),
                        Eigen::Vector3f(0.15f, 0.18f, 0.22f) * (0.5f + tone));
    case SurfaceUse::kRubber:
      return SetColours(
          surface, Eigen::Vector3f::Constant(0.05f), Eigen::Vector3f::Constant(0.1f + 0.1f * tone));
    case SurfaceUse::kGround: {
      const Eigen::Vector3f stone = Eigen::Vector3f::Constant(0.35f + 0.3f * tone);
      const Eigen::Vector3f grass(0.30f, 0.42f, 0.18f);
      const Eigen::Vector3f light = random.Chance(0.3) ? grass : stone;
      return SetColours(surface, 0.55f * light, light);
    }
    case SurfaceUse::kSky:
      return SetColours(
          surface,
          Mix(Eigen::Vector3f(0.25f, 0.45f, 0.80f), Eigen::Vector3f(0.55f, 0.60f, 0.68f), tone),
          Mix(Eigen::Vector3f(0.75f, 0.85f, 0.95f), Eigen::Vector3f(0.85f, 0.85f, 0.85f), tone));
    default:
      return;
  }
}

TextureStyle StyleFor(SurfaceUse use, double size) {
  const bool is_large = use == SurfaceUse::kWall || use == SurfaceUse::kFloor ||
                        use == SurfaceUse::kCeiling || use == SurfaceUse::kFacade;
  if (is_large) return {.scale = 1.0, .max_saturation = 0.3, .hue_range = 0.15};
  return {.scale = std::clamp(size, 0.05, 2.0), .max_saturation = 0.65, .hue_range = 0.2};
}

}  // namespace

Surface MakeSurface(SurfaceUse use,
                    double size,
                    const std::vector<PhotoTexture>& photos,
                    RandomStream& random) {
  Surface surface;
  surface.texture = MakeTexture(random.Bits(), StyleFor(use, size));
  surface.pattern = DrawPattern(use, !photos.empty(), random);
  const bool is_small = size < 2.0;
  const double base = is_small ? size * random.Uniform(0.12, 0.5) : random.Uniform(0.2, 0.7);
  surface.period = Eigen::Vector2d{base, base * random.Uniform(0.4, 0.9)}.cast<float>();
  surface.joint = static_cast<float>(random.Uniform(0.05, 0.15));
  surface.dirt = static_cast<float>(random.Uniform(0.0, 0.35));
  surface.dirt_size = static_cast<float>(is_small ? size : 2.5);
  switch (surface.pattern) {
    case Pattern::kStripes:
      surface.joint = static_cast<float>(random.Uniform(0.2, 0.6));
      break;
    case Pattern::kGradient:
      surface.period.y() = static_cast<float>(size * random.Uniform(1.0, 2.5));
      break;
    case Pattern::kWindows:
      surface.period =
          Eigen::Vector2d{random.Uniform(1.6, 3.2), random.Uniform(2.4, 3.6)}.cast<float>();
      surface.joint = static_cast<float>(random.Uniform(0.15, 0.3));
      break;
    case Pattern::kNoise:
    case Pattern::kWood:
      surface.period.x() = static_cast<float>(size * random.Uniform(0.3, 1.0));
      break;
    case Pattern::kPhoto:
      surface.photo = &photos[random.Index(photos.size())];
      surface.period.x() = static_cast<float>(2.0 * size * random.Uniform(0.8, 1.6));
      surface.dirt = 0.0f;
      break;
    case Pattern::kSky:
      surface.period.x() = static_cast<float>(random.Uniform(0.3, 1.0));
      surface.joint = static_cast<float>(random.Uniform(-0.6, 0.5));
      surface.dirt = 0.0f;
      break;
    default:
      break;
  }
  TintForUse(use, surface, random);
  return surface;
}

Eigen::Vector3f SurfaceColour(const Surface& surface, const SurfaceSample& sample) {
  const FacePlace place = FindPlace(surface, sample);
  Eigen::Vector3f colour = PatternColour(surface, sample, place);
  if (surface.dirt > 0.0f) {
    // Coarse noise is enough to tell one brick from the next.
    const float size = surface.dirt_size;
    const float footprint = std::max(place.footprint / size, 0.1f);
    colour *=
        1.0f + surface.dirt * TableNoise(place.u / size, place.v / size, footprint, ~place.seed);
  }
  return colour;
}

}  // namespace vgtw
