// SPDX-License-Identifier: BSD-3-Clause
#include "scene/synthetic_renderer.h"

#include "scene/parallel.h"
#include "scene/random.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace vgtw {
namespace {

constexpr float kUnknownDepth = std::numeric_limits<float>::quiet_NaN();
constexpr int kTileSize = 16;  // pixels

// Ambient light and two lamps at infinity.
float Shade(const Eigen::Vector3d& normal_in_world) {
  static const Eigen::Vector3d to_lamp1 = Eigen::Vector3d(0.35, -0.60, 0.72).normalized();
  static const Eigen::Vector3d to_lamp2 = Eigen::Vector3d(-0.75, 0.55, 0.35).normalized();
  return static_cast<float>(0.55 + 0.40 * std::max(0.0, normal_in_world.dot(to_lamp1)) +
                            0.20 * std::max(0.0, normal_in_world.dot(to_lamp2)));
}

// The pixels of a tile see nothing but the shapes whose bounding spheres meet its cone.
struct Cone {
  Eigen::Vector3d axis_in_world;
  double half_angle_rad = 0.0;
};

bool MayMeet(const Cone& cone, const Eigen::Vector3d& origin, const Shape& shape) {
  const Eigen::Vector3d to_centre = shape.centre_in_world - origin;
  const double distance = to_centre.norm();
  const double radius = shape.half_size.norm();
  if (shape.kind == ShapeKind::kRoom || distance <= radius) return true;
  const double cos_angle = cone.axis_in_world.dot(to_centre) / distance;
  return std::acos(std::clamp(cos_angle, -1.0, 1.0)) <=
         cone.half_angle_rad + std::asin(radius / distance) + 1e-9;
}

class Renderer {
 public:
  Renderer(const SyntheticWorld& world, const SyntheticOptions& options, size_t view_idx)
      : world_(world),
        options_(options),
        view_idx_(view_idx),
        view_(world.views[view_idx]),
        origin_(OriginInSource(view_.cam_from_world)),
        world_from_cam_rotation_(view_.cam_from_world.rotation.conjugate().toRotationMatrix()),
        pixel_angle_(1.0 / view_.camera.MeanFocalLength()),
        result_{RgbImage(options.width, options.height),
                DepthMap(options.width, options.height, kUnknownDepth),
                DepthMap(options.width, options.height, kUnknownDepth),
                DistractorMask(options.width, options.height, 0.0f)} {
    RandomStream random(HashKey({options.seed, kExposureStream, view_idx}));
    gain_ = 255.0 * std::exp(options.exposure_change * random.Normal());
  }

  SyntheticView Run() {
    const int num_tile_rows = (options_.height + kTileSize - 1) / kTileSize;
    ParallelFor(num_tile_rows, options_.num_threads, [this](int64_t tile_row) {
      for (int x = 0; x < options_.width; x += kTileSize) {
        RenderTile(x, static_cast<int>(tile_row) * kTileSize);
      }
    });
    return std::move(result_);
  }

 private:
  struct Candidates {
    std::vector<const Shape*> statics;
    std::vector<const Shape*> distractors;
  };

  std::optional<Cone> TileCone(int x0, int y0, int x1, int y1) const {
    const auto axis = PixelRay(view_, {0.5 * (x0 + x1), 0.5 * (y0 + y1)});
    if (!axis) return std::nullopt;
    Cone cone{axis->direction.normalized(), 0.0};
    for (const Eigen::Vector2d& corner : {Eigen::Vector2d(x0, y0),
                                          Eigen::Vector2d(x1, y0),
                                          Eigen::Vector2d(x0, y1),
                                          Eigen::Vector2d(x1, y1)}) {
      const auto ray = PixelRay(view_, corner);
      if (!ray) return std::nullopt;
      const double cos_angle = ray->direction.normalized().dot(cone.axis_in_world);
      cone.half_angle_rad =
          std::max(cone.half_angle_rad, std::acos(std::clamp(cos_angle, -1.0, 1.0)));
    }
    return cone;
  }

  std::vector<const Shape*> Select(const std::vector<Shape>& shapes,
                                   const std::optional<Cone>& cone) const {
    std::vector<const Shape*> selected;
    for (const Shape& shape : shapes) {
      if (!cone || MayMeet(*cone, origin_, shape)) selected.push_back(&shape);
    }
    return selected;
  }

  void RenderTile(int x0, int y0) {
    const int x1 = std::min(x0 + kTileSize, options_.width);
    const int y1 = std::min(y0 + kTileSize, options_.height);
    const auto cone = TileCone(x0, y0, x1, y1);
    const Candidates candidates{Select(world_.static_shapes, cone),
                                Select(world_.distractor_shapes[view_idx_], cone)};
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) RenderPixel(x, y, candidates);
    }
  }

  Ray RayInWorld(const Eigen::Vector2d& ray_in_cam) const {
    return {origin_, world_from_cam_rotation_ * ray_in_cam.homogeneous()};
  }

  void RenderPixel(int x, int y, const Candidates& candidates) {
    const auto ray_in_cam = Unproject(view_.camera, {x + 0.5, y + 0.5});
    if (!ray_in_cam) return;
    const Ray ray = RayInWorld(*ray_in_cam);
    const auto behind = FindNearest(candidates.statics, ray);
    const auto before = FindNearest(candidates.distractors, ray);
    if (behind) {
      result_.static_depth(x, y) = static_cast<float>(behind->depth);
      result_.depth(x, y) = result_.static_depth(x, y);
    }
    if (before && (!behind || before->depth < behind->depth)) {
      result_.depth(x, y) = static_cast<float>(before->depth);
      result_.distractor(x, y) = 1.0f;
    }
    result_.image(x, y) = Expose(PixelColour(*ray_in_cam, candidates), x, y);
  }

  struct Sample {
    Ray ray;
    std::optional<Hit> hit;
    SurfacePoint surface;
  };

  Sample TakeSample(const Eigen::Vector2d& ray_in_cam, const Candidates& candidates) const {
    Sample sample{RayInWorld(ray_in_cam), std::nullopt, {}};
    sample.hit = FindNearest(candidates.statics, sample.ray);
    const auto before = FindNearest(candidates.distractors, sample.ray);
    if (before && (!sample.hit || before->depth < sample.hit->depth)) sample.hit = before;
    if (sample.hit) {
      sample.surface = DescribeSurface(*sample.hit->shape, sample.ray.At(sample.hit->depth));
    }
    return sample;
  }

  // The texture filters itself, so that one look at it is enough where the four rays of a pixel
  // meet the same face.
  Eigen::Vector3f PixelColour(const Eigen::Vector2d& ray_in_cam,
                              const Candidates& candidates) const {
    // Undistorted steps between the four rays: off by a tenth of a quarter pixel at most, in no
    // preferred direction.
    const double step = 0.25 * pixel_angle_;
    const std::array<Sample, 4> samples = {
        TakeSample(ray_in_cam + Eigen::Vector2d(-step, -step), candidates),
        TakeSample(ray_in_cam + Eigen::Vector2d(step, -step), candidates),
        TakeSample(ray_in_cam + Eigen::Vector2d(-step, step), candidates),
        TakeSample(ray_in_cam + Eigen::Vector2d(step, step), candidates)};
    const bool is_one_face = std::all_of(samples.begin(), samples.end(), [&](const Sample& sample) {
      return sample.hit && samples[0].hit && sample.hit->shape == samples[0].hit->shape &&
             sample.surface.face == samples[0].surface.face;
    });
    if (is_one_face) return SampleColour(TakeSample(ray_in_cam, candidates), 1.0);
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (const Sample& sample : samples) sum += SampleColour(sample, 0.5);
    return 0.25f * sum;
  }

  Eigen::Vector3f SampleColour(const Sample& sample, double size_px) const {
    if (!sample.hit) return Eigen::Vector3f::Zero();
    const Eigen::Vector3d& normal = sample.surface.normal_in_world;
    const Eigen::Vector3d& direction = sample.ray.direction;
    const double cos_incidence = std::abs(normal.dot(direction)) / direction.norm();
    // On slanted surfaces the geometric mean of both directions: the shorter one would alias, the
    // longer one would blur all detail away.
    const double footprint =
        size_px * pixel_angle_ * sample.hit->depth / std::sqrt(std::max(cos_incidence, 0.05));
    return Shade(normal) *
           Albedo(sample.hit->shape->texture, sample.surface.face, sample.surface.uv, footprint);
  }

  Rgb Expose(const Eigen::Vector3f& colour, int x, int y) const {
    const auto pixel_idx =
        static_cast<uint64_t>(y) * static_cast<uint64_t>(options_.width) + static_cast<uint64_t>(x);
    RandomStream random(HashKey({options_.seed, kNoiseStream, view_idx_, pixel_idx}));
    Rgb rgb;
    for (int channel = 0; channel < 3; ++channel) {
      const double grey = gain_ * colour[channel] + options_.image_noise * random.Normal();
      rgb[static_cast<size_t>(channel)] =
          static_cast<uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0)));
    }
    return rgb;
  }

  const SyntheticWorld& world_;
  const SyntheticOptions& options_;
  size_t view_idx_;
  const View& view_;
  Eigen::Vector3d origin_;
  Eigen::Matrix3d world_from_cam_rotation_;
  double pixel_angle_;
  double gain_ = 0.0;
  SyntheticView result_;
};

}  // namespace

SyntheticView RenderView(const SyntheticWorld& world,
                         const SyntheticOptions& options,
                         size_t view_idx) {
  return Renderer(world, options, view_idx).Run();
}

}  // namespace vgtw
