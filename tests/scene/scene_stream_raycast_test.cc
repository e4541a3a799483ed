// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_raycast.h"

#include "scene/random.h"

#include <cmath>
#include <optional>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr ShapeKind kKinds[] = {ShapeKind::kBox,
                                ShapeKind::kEllipsoid,
                                ShapeKind::kCylinder,
                                ShapeKind::kRoom,
                                ShapeKind::kDome};

Camera MakeCamera() { return MakePinhole(40, 30, 35.0, 38.0); }

Rigid3d MakePose() { return LookAt({0.3, -4.0, 1.0}, {0.0, 0.0, 0.5}, Eigen::Vector3d::UnitZ()); }

// Around the middle of the picture, partly beside it or behind the camera.
Solid DrawSolid(ShapeKind kind, RandomStream& random) {
  const Eigen::Matrix3d rotation = random.Rotation().toRotationMatrix();
  const Eigen::Vector3d centre = 1.5 * random.NormalVector();
  const double size = kind == ShapeKind::kRoom || kind == ShapeKind::kDome ? 9.0 : 0.7;
  const Eigen::Vector3d half_size{size * random.Uniform(0.3, 1.0),
                                  size * random.Uniform(0.3, 1.0),
                                  size * random.Uniform(0.3, 1.0)};
  return {kind, rotation, centre, half_size};
}

Ray RayOf(const Camera& camera, const Rigid3d& cam_from_world, double x, double y) {
  const Eigen::Vector2d ray_in_cam = *Unproject(camera, {x, y});
  return {OriginInSource(cam_from_world),
          cam_from_world.rotation.conjugate() * ray_in_cam.homogeneous()};
}

// Single precision: 1e-7 of the depth, times the reciprocal of the cosine at which a ray meets the
// surface. Rays that only one of the two lets pass must touch the solid's rim.
TEST(SolidInView, MeetsSolidsWhereDoublePrecisionDoes) {
  const Camera camera = MakeCamera();
  const Rigid3d pose = MakePose();
  RandomStream random(1);
  int num_hits = 0;
  int num_disagreements = 0;
  for (const ShapeKind kind : kKinds) {
    for (int i = 0; i < 40; ++i) {
      const Solid solid = DrawSolid(kind, random);
      const SolidInView seen(solid, camera, pose);
      for (int ray_idx = 0; ray_idx < 100; ++ray_idx) {
        const double x = random.Uniform(0.0, 40.0);
        const double y = random.Uniform(0.0, 30.0);
        const Ray ray = RayOf(camera, pose, static_cast<float>(x), static_cast<float>(y));
        const auto truth = Intersect(solid, ray);
        const float depth = seen.DepthAt(static_cast<float>(x), static_cast<float>(y));
        if (truth.has_value() != std::isfinite(depth)) {
          ++num_disagreements;
          continue;
        }
        if (!truth) continue;
        ++num_hits;
        const Eigen::Vector3d normal = DescribeSurface(solid, ray.At(*truth)).normal_in_world;
        const double cosine = std::abs(normal.dot(ray.direction)) / ray.direction.norm();
        EXPECT_NEAR(depth, *truth, 2e-6 * *truth / std::max(cosine, 0.01));
      }
    }
  }
  EXPECT_GT(num_hits, 4000);
  EXPECT_LE(num_disagreements, 2);
}

TEST(SolidInView, DescribesSurfacesAsDoublePrecisionDoes) {
  const Camera camera = MakeCamera();
  const Rigid3d pose = MakePose();
  RandomStream random(2);
  int num_other_faces = 0;
  for (const ShapeKind kind : kKinds) {
    for (int i = 0; i < 40; ++i) {
      const Solid solid = DrawSolid(kind, random);
      const auto truth = Intersect(solid, RayOf(camera, pose, 20.5, 15.5));
      if (!truth) continue;
      const SurfacePoint expected =
          DescribeSurface(solid, RayOf(camera, pose, 20.5, 15.5).At(*truth));
      const SurfaceSample sample =
          SolidInView(solid, camera, pose).Describe(20.5f, 15.5f, static_cast<float>(*truth));
      if (sample.face != expected.face) {  // on an edge
        ++num_other_faces;
        continue;
      }
      EXPECT_LT((sample.normal_in_world.cast<double>() - expected.normal_in_world).norm(), 1e-4);
      const int axis = sample.face / 2;
      EXPECT_NEAR(sample.point_in_local[(axis + 1) % 3], expected.uv.x(), 1e-4);
      EXPECT_NEAR(sample.point_in_local[(axis + 2) % 3], expected.uv.y(), 1e-4);
    }
  }
  EXPECT_LE(num_other_faces, 1);
}

// The rectangle in which rays are cast must not cut anything off.
TEST(CastInto, MarksEveryPixelWhoseCentreMeetsASolid) {
  const Camera camera = MakeCamera();
  const Rigid3d pose = MakePose();
  RandomStream random(3);
  for (const ShapeKind kind : kKinds) {
    for (int i = 0; i < 30; ++i) {
      Solid solid = DrawSolid(kind, random);
      solid.centre_in_world *= 2.0;  // also behind the camera
      const SolidInView seen(solid, camera, pose);
      HitMap hits(40, 30);
      CastInto({&seen, 1}, 7, hits);
      for (int y = 0; y < 30; ++y) {
        for (int x = 0; x < 40; ++x) {
          const float depth =
              seen.DepthAt(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
          ASSERT_EQ(hits.depth(x, y), depth);
          ASSERT_EQ(hits.index(x, y), std::isfinite(depth) ? 7 : -1);
        }
      }
    }
  }
}

// Two boxes in a row on the optical axis, 4 - 0.5 and 6 - 0.5 before the camera.
TEST(CastInto, KeepsTheNearest) {
  const Rigid3d pose = LookAt({0.0, -4.0, 0.0}, {0.0, 0.0, 0.0}, Eigen::Vector3d::UnitZ());
  const auto box_at = [](double y) {
    return Piece{{ShapeKind::kBox,
                  Eigen::Matrix3d::Identity(),
                  {0.0, y, 0.0},
                  Eigen::Vector3d::Constant(0.5)},
                 0};
  };
  for (const bool near_first : {true, false}) {
    const std::vector<Piece> pieces = {box_at(near_first ? 0.0 : 2.0),
                                       box_at(near_first ? 2.0 : 0.0)};
    HitMap hits(41, 31);
    CastInto(SeePieces(pieces, MakePinhole(41, 31, 40.0, 40.0), pose), 0, hits);
    EXPECT_EQ(hits.index(20, 15), near_first ? 0 : 1);
    EXPECT_FLOAT_EQ(hits.depth(20, 15), 3.5f);
    EXPECT_EQ(hits.index(0, 0), -1);
  }
}

}  // namespace
}  // namespace vgtw
