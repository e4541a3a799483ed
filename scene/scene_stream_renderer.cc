// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vgtw {
namespace {

using Eigen::Vector3f;

Vector3f Light(const Lighting& lighting, const Vector3f& normal) {
  return lighting.ambient +
         std::max(0.0f, normal.dot(lighting.sun.direction)) * lighting.sun.colour +
         std::max(0.0f, normal.dot(lighting.fill.direction)) * lighting.fill.colour;
}

// How much of the ambient light what stands on the floor takes from the floor around its foot.
class ContactShadows {
 public:
  ContactShadows(const StreamWorld& world, size_t view_idx)
      : floor_height_(static_cast<float>(world.stage.floor_height)) {
    for (const Footprint& footprint : world.stage.footprints) Add(footprint);
    for (const Footprint& footprint : world.distractors[view_idx].footprints) Add(footprint);
  }

  // Factor of the light at a point of a horizontal surface.
  float LightAt(const Vector3f& point_in_world) const {
    constexpr float kThickness = 0.02f;  // carpets, pavements
    constexpr float kDarkness = 0.5f;
    if (std::abs(point_in_world.z() - floor_height_) > kThickness) return 1.0f;
    float light = 1.0f;
    for (const Disc& disc : discs_) {
      const float dx = point_in_world.x() - disc.x;
      const float dy = point_in_world.y() - disc.y;
      const float inside = 1.0f - (dx * dx + dy * dy) * disc.inverse_square;
      if (inside > 0.0f) light *= 1.0f - kDarkness * inside * inside;
    }
    return light;
  }

 private:
  struct Disc {
    float x, y, inverse_square;
  };

  void Add(const Footprint& footprint) {
    constexpr double kReach = 1.3;
    const double radius = kReach * footprint.radius;
    discs_.push_back({static_cast<float>(footprint.centre.x()),
                      static_cast<float>(footprint.centre.y()),
                      static_cast<float>(1.0 / (radius * radius))});
  }

  float floor_height_;
  std::vector<Disc> discs_;
};

class Painter {
 public:
  Painter(const StreamWorld& world, const SeenView& seen)
      : world_(world), seen_(seen), shadows_(world, seen.view_idx) {
    const StreamView& view = world.views[seen.view_idx];
    const Eigen::Matrix3d world_from_cam =
        view.cam_from_world.rotation.conjugate().toRotationMatrix();
    const double focal_length = view.camera.MeanFocalLength();
    const Eigen::Vector2d principal_point = view.camera.PrincipalPoint();
    origin_ = OriginInSource(view.cam_from_world).cast<float>();
    per_x_ = (world_from_cam.col(0) / focal_length).cast<float>();
    per_y_ = (world_from_cam.col(1) / focal_length).cast<float>();
    at_zero_ =
        (world_from_cam *
         Eigen::Vector3d(-principal_point.x(), -principal_point.y(), focal_length) / focal_length)
            .cast<float>();
  }

  Vector3f PixelColour(int x, int y) const {
    const int32_t piece = seen_.hits.index(x, y);
    const float px = static_cast<float>(x) + 0.5f;
    const float py = static_cast<float>(y) + 0.5f;
    if (!IsEdge(x, y)) return Shade(piece, px, py, seen_.hits.depth(x, y));
    return EdgeColour(x, y);
  }

 private:
  bool IsEdge(int x, int y) const {
    const Grid<int32_t>& pieces = seen_.hits.index;
    const int32_t here = pieces(x, y);
    return (x > 0 && pieces(x - 1, y) != here) || (y > 0 && pieces(x, y - 1) != here) ||
           (x + 1 < pieces.width() && pieces(x + 1, y) != here) ||
           (y + 1 < pieces.height() && pieces(x, y + 1) != here);
  }

  Vector3f Shade(int32_t piece, float x, float y, float depth) const {
    const auto piece_idx = static_cast<size_t>(piece);
    const SurfaceSample sample = seen_.solids[piece_idx].Describe(x, y, depth);
    const Surface& surface = world_.stage.surfaces[static_cast<size_t>(seen_.surfaces[piece_idx])];
    const Vector3f colour = SurfaceColour(surface, sample);
    if (surface.pattern == Pattern::kSky) return colour;
    Vector3f light = Light(world_.lighting, sample.normal_in_world);
    constexpr float kHorizontal = 0.99f;
    if (sample.normal_in_world.z() > kHorizontal) {
      light *= shadows_.LightAt(origin_ + depth * (at_zero_ + x * per_x_ + y * per_y_));
    }
    return colour.cwiseProduct(light);
  }

  // The pieces seen at the pixel and its eight neighbours, none twice.
  struct Candidates {
    std::array<int32_t, 9> pieces;
    int count = 0;
  };
  Candidates FindCandidates(int x, int y) const {
    Candidates candidates;
    const Grid<int32_t>& pieces = seen_.hits.index;
    for (int j = std::max(0, y - 1); j <= std::min(pieces.height() - 1, y + 1); ++j) {
      for (int i = std::max(0, x - 1); i <= std::min(pieces.width() - 1, x + 1); ++i) {
        const auto end = candidates.pieces.begin() + candidates.count;
        if (std::find(candidates.pieces.begin(), end, pieces(i, j)) != end) continue;
        candidates.pieces[static_cast<size_t>(candidates.count++)] = pieces(i, j);
      }
    }
    return candidates;
  }

  // Each piece counts by how many of the four rays meet it first, and is looked at once.
  Vector3f EdgeColour(int x, int y) const {
    const Candidates candidates = FindCandidates(x, y);
    Vector3f colour = Vector3f::Zero();
    float weight = 0.0f;
    struct Seen {
      float x, y, depth;
      float weight = 0.0f;
    };
    std::array<Seen, 9> seen;
    for (const float dy : {0.25f, 0.75f}) {
      for (const float dx : {0.25f, 0.75f}) {
        const float px = static_cast<float>(x) + dx;
        const float py = static_cast<float>(y) + dy;
        float nearest = SolidInView::kNothing;
        size_t winner = 0;
        for (size_t i = 0; i < static_cast<size_t>(candidates.count); ++i) {
          const auto piece_idx = static_cast<size_t>(candidates.pieces[i]);
          const float depth = seen_.solids[piece_idx].DepthAt(px, py);
          if (depth >= nearest) continue;
          nearest = depth;
          winner = i;
        }
        if (nearest == SolidInView::kNothing) continue;
        const float sum = seen[winner].weight + 1.0f;
        seen[winner] = {px, py, nearest, sum};
        weight += 1.0f;
      }
    }
    for (size_t i = 0; i < static_cast<size_t>(candidates.count); ++i) {
      if (seen[i].weight == 0.0f) continue;
      colour += seen[i].weight / weight *
                Shade(candidates.pieces[i], seen[i].x, seen[i].y, seen[i].depth);
    }
    return colour;
  }

  const StreamWorld& world_;
  const SeenView& seen_;
  ContactShadows shadows_;
  // Rays in the world: origin_ + depth * (at_zero_ + x * per_x_ + y * per_y_).
  Vector3f origin_;
  Vector3f at_zero_;
  Vector3f per_x_;
  Vector3f per_y_;
};

// [1 2 1] / 4 along rows and columns, mixed with the sharp picture.
void Blur(Grid<Vector3f>& picture, float strength) {
  const int width = picture.width();
  const int height = picture.height();
  const float side = 0.25f * strength;
  const float middle = 1.0f - 2.0f * side;
  Grid<Vector3f> rows = picture;
  for (int y = 0; y < height; ++y) {
    for (int x = 1; x + 1 < width; ++x) {
      rows(x, y) = middle * picture(x, y) + side * (picture(x - 1, y) + picture(x + 1, y));
    }
  }
  for (int y = 1; y + 1 < height; ++y) {
    for (int x = 0; x < width; ++x) {
      picture(x, y) = middle * rows(x, y) + side * (rows(x, y - 1) + rows(x, y + 1));
    }
  }
}

float MeanBrightness(const Grid<Vector3f>& picture) {
  Vector3f sum = Vector3f::Zero();
  for (const Vector3f& colour : picture.data()) sum += colour.cwiseMin(1.0f);
  return sum.mean() / static_cast<float>(picture.size());
}

// Sums of four uniform 16-bit numbers: sigma 1, close to normal, and cheap.
Vector3f DrawNoise(RandomStream& random) {
  const auto draw = [&random] {
    const uint64_t bits = random.Bits();
    const auto sum = static_cast<float>((bits & 0xffff) + (bits >> 16 & 0xffff) +
                                        (bits >> 32 & 0xffff) + (bits >> 48));
    constexpr float kMean = 2.0f * 65535.0f;
    constexpr float kSigma = 65535.0f * 0.57735027f;  // sqrt(4 / 12)
    return (sum - kMean) / kSigma;
  };
  const float red = draw();
  const float green = draw();
  return {red, green, draw()};
}

}  // namespace

SeenView SeeView(const StreamWorld& world, size_t view_idx) {
  const StreamView& view = world.views[view_idx];
  const std::vector<Piece>& distractors = world.distractors[view_idx].pieces;
  const auto width = static_cast<int>(view.camera.width);
  const auto height = static_cast<int>(view.camera.height);
  SeenView seen{view_idx,
                SeePieces(world.stage.pieces, view.camera, view.cam_from_world),
                {},
                world.stage.pieces.size(),
                HitMap(width, height),
                HitMap(0, 0)};
  CastInto(seen.solids, 0, seen.static_hits);
  seen.hits = seen.static_hits;
  const auto moving = SeePieces(distractors, view.camera, view.cam_from_world);
  CastInto(moving, static_cast<int32_t>(seen.num_static), seen.hits);
  seen.solids.insert(seen.solids.end(), moving.begin(), moving.end());
  for (const Piece& piece : world.stage.pieces) seen.surfaces.push_back(piece.surface);
  for (const Piece& piece : distractors) seen.surfaces.push_back(piece.surface);
  return seen;
}

Grid<Eigen::Vector3f> PaintView(const StreamWorld& world, const SeenView& seen) {
  const Painter painter(world, seen);
  Grid<Vector3f> picture(seen.hits.index.width(), seen.hits.index.height());
  for (int y = 0; y < picture.height(); ++y) {
    for (int x = 0; x < picture.width(); ++x) picture(x, y) = painter.PixelColour(x, y);
  }
  return picture;
}

RgbImage Photograph(const Grid<Vector3f>& picture, RandomStream& random) {
  // Automatic exposure brings the mean near a middle grey, but not all the way.
  constexpr float kMiddleGrey = 0.45f;
  const double log_gain = 0.7 * std::log(kMiddleGrey / std::max(MeanBrightness(picture), 0.02f)) +
                          0.12 * random.Normal();
  const Eigen::Vector3d white_balance = 0.03 * random.NormalVector();
  const Vector3f gain =
      (255.0 * std::exp(log_gain) * (Eigen::Vector3d::Ones() + white_balance)).cast<float>();
  const auto vignetting = static_cast<float>(random.Uniform(0.0, 0.3));
  const auto noise = static_cast<float>(random.Uniform(0.0, 5.0));
  const auto blur = static_cast<float>(random.Uniform(0.0, 0.8));
  Grid<Vector3f> exposed = picture;
  if (random.Chance(0.4)) Blur(exposed, blur);
  const float centre_x = 0.5f * static_cast<float>(picture.width());
  const float centre_y = 0.5f * static_cast<float>(picture.height());
  const float inverse = 1.0f / (centre_x * centre_x + centre_y * centre_y);
  RgbImage image(picture.width(), picture.height());
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      const float dx = static_cast<float>(x) + 0.5f - centre_x;
      const float dy = static_cast<float>(y) + 0.5f - centre_y;
      const float falloff = 1.0f - vignetting * inverse * (dx * dx + dy * dy);
      const Vector3f grey = falloff * gain.cwiseProduct(exposed(x, y)) + noise * DrawNoise(random);
      for (int c = 0; c < 3; ++c) {
        image(x, y)[static_cast<size_t>(c)] =
            static_cast<uint8_t>(std::clamp(grey[c], 0.0f, 255.0f) + 0.5f);
      }
    }
  }
  return image;
}

}  // namespace vgtw
