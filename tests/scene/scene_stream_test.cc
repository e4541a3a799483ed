// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream.h"

#include "scene/error.h"
#include "scene/parallel.h"
#include "scene/scene_stream_world.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Small pictures: every law below is independent of the resolution.
SceneStreamOptions SmallOptions() {
  SceneStreamOptions options;
  options.width = 56;
  options.height = 42;
  return options;
}

double DistractorCover(const SceneSample& sample) {
  double sum = 0.0;
  double num_pixels = 0.0;
  for (const DistractorMask& distractor : sample.distractor) {
    for (const float probability : distractor.data()) sum += probability;
    num_pixels += static_cast<double>(distractor.size());
  }
  return sum / num_pixels;
}

void ExpectEqual(const SceneSample& a, const SceneSample& b) {
  EXPECT_EQ(a.images, b.images);
  EXPECT_EQ(a.depth, b.depth);
  EXPECT_EQ(a.static_depth, b.static_depth);
  EXPECT_EQ(a.distractor, b.distractor);
  EXPECT_EQ(a.cameras, b.cameras);
  ASSERT_EQ(a.cam_from_world.size(), b.cam_from_world.size());
  for (size_t i = 0; i < a.cam_from_world.size(); ++i) {
    EXPECT_EQ(a.cam_from_world[i].ToMatrix(), b.cam_from_world[i].ToMatrix());
  }
}

StreamWorld WorldOf(const SceneStreamOptions& options, uint64_t idx) {
  for (uint64_t attempt = 0;; ++attempt) {
    if (auto world = MakeStreamWorld(options, {}, idx, attempt)) return std::move(*world);
  }
}

TEST(SceneStream, IsAFunctionOfOptionsAndIndex) {
  constexpr int kNumSamples = 12;
  const SceneStream stream(SmallOptions());
  std::vector<SceneSample> in_turn;
  for (int i = 0; i < kNumSamples; ++i) in_turn.push_back(SceneStream(SmallOptions()).Sample(i));
  std::vector<SceneSample> at_once(kNumSamples);
  ParallelFor(kNumSamples, 4, [&](int64_t i) {
    const auto idx = static_cast<size_t>(kNumSamples - 1 - i);
    at_once[idx] = stream.Sample(idx);
  });
  for (size_t i = 0; i < kNumSamples; ++i) ExpectEqual(in_turn[i], at_once[i]);
}

TEST(SceneStream, NoTwoScenesAreEqual) {
  std::set<std::vector<float>> depths;
  for (uint64_t seed = 0; seed < 2; ++seed) {
    SceneStreamOptions options = SmallOptions();
    options.seed = seed;
    const SceneStream stream(options);
    for (const uint64_t idx : {0ull, 1ull, 2ull, 3ull, 20'000'000ull, ~0ull}) {
      depths.insert(stream.Sample(idx).static_depth[0].data());
    }
  }
  EXPECT_EQ(depths.size(), 12u);
}

TEST(SceneStream, GivesAsManyViewsAsAskedFor) {
  SceneStreamOptions options = SmallOptions();
  options.min_views = 3;
  options.max_views = 5;
  const SceneStream stream(options);
  std::set<size_t> counts;
  for (uint64_t idx = 0; idx < 30; ++idx) {
    const SceneSample sample = stream.Sample(idx);
    counts.insert(sample.images.size());
    EXPECT_EQ(sample.depth.size(), sample.images.size());
    EXPECT_EQ(sample.static_depth.size(), sample.images.size());
    EXPECT_EQ(sample.distractor.size(), sample.images.size());
    EXPECT_EQ(sample.cameras.size(), sample.images.size());
    EXPECT_EQ(sample.cam_from_world.size(), sample.images.size());
    for (const Camera& camera : sample.cameras) {
      EXPECT_EQ(camera.model, CameraModel::kPinhole);
      EXPECT_GE(camera.FocalLengthX(), 0.6 * 56);
      EXPECT_LE(camera.FocalLengthX(), 1.4 * 56);
    }
  }
  EXPECT_EQ(counts, (std::set<size_t>{3, 4, 5}));
}

TEST(SceneStream, DistractorsAreExactlyWhereDepthIsNearer) {
  const SceneStream stream(SmallOptions());
  for (uint64_t idx = 0; idx < 60; ++idx) {
    const SceneSample sample = stream.Sample(idx);
    for (size_t i = 0; i < sample.depth.size(); ++i) {
      for (size_t p = 0; p < sample.depth[i].size(); ++p) {
        const float distractor = sample.distractor[i].data()[p];
        const float depth = sample.depth[i].data()[p];
        const float static_depth = sample.static_depth[i].data()[p];
        ASSERT_TRUE(std::isfinite(static_depth) && depth > 0.0f);
        ASSERT_TRUE(distractor == 0.0f || distractor == 1.0f);
        ASSERT_TRUE(distractor == 1.0f ? depth < static_depth : depth == static_depth);
      }
    }
  }
}

TEST(SceneStream, DistractorsCoverTheirShare) {
  const SceneStream stream(SmallOptions());
  double sum = 0.0;
  for (uint64_t idx = 0; idx < 200; ++idx) {
    const double cover = DistractorCover(stream.Sample(idx));
    EXPECT_GE(cover, 0.02) << idx;
    EXPECT_LE(cover, 0.35) << idx;
    sum += cover;
  }
  // Wanted shares are uniform in 0.04..0.26, and the last body brings a little more.
  EXPECT_NEAR(sum / 200, 0.18, 0.04);
}

// 200 scenes at a half each: 100, sigma 7.
TEST(SceneStream, SomeScenesHaveNoDistractors) {
  SceneStreamOptions options = SmallOptions();
  options.distractor_share = 0.5;
  int num_without = 0;
  for (uint64_t idx = 0; idx < 200; ++idx) {
    const StreamWorld world = WorldOf(options, idx);
    num_without += std::all_of(world.distractors.begin(),
                               world.distractors.end(),
                               [](const Actors& actors) { return actors.pieces.empty(); })
                       ? 1
                       : 0;
  }
  EXPECT_NEAR(num_without, 100, 28);
  options.distractor_share = 0.0;
  EXPECT_EQ(DistractorCover(SceneStream(options).Sample(3)), 0.0);
}

// Depth of the nearest static piece along a ray to a point, as a share of the point's depth.
double NearestShare(const Stage& stage,
                    const Eigen::Vector3d& origin,
                    const Eigen::Vector3d& point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Piece& piece : stage.pieces) {
    const auto depth = Intersect(piece.solid, {origin, point - origin});
    if (depth) nearest = std::min(nearest, *depth);
  }
  return nearest;
}

// What one view sees, another sees at the same place or behind something, by the solids themselves
// in double precision: never does a ray of the other pass through the point and meet something
// farther. Single precision places points along their ray to some 1e-6 of their depth over the
// cosine at the surface, which moves them by up to a few 1e-5 along the other's ray. Only a ray
// that grazes the point's surface may miss it: one in a thousand.
TEST(SceneStream, StaticPointsAreWhereOtherViewsSeeThem) {
  constexpr double kTolerance = 1e-4;
  const SceneStreamOptions options = SmallOptions();
  size_t num_points = 0;
  size_t num_same = 0;
  size_t num_passing = 0;
  for (uint64_t idx = 0; idx < 30; ++idx) {
    const StreamWorld world = WorldOf(options, idx);
    for (size_t i = 0; i + 1 < world.views.size(); ++i) {
      const StreamView& view = world.views[i];
      HitMap hits(options.width, options.height);
      CastInto(SeePieces(world.stage.pieces, view.camera, view.cam_from_world), 0, hits);
      for (int y = 1; y < options.height; y += 5) {
        for (int x = 1; x < options.width; x += 5) {
          const Eigen::Vector2d ray = *Unproject(view.camera, {x + 0.5, y + 0.5});
          const Eigen::Vector3d point =
              Inverse(view.cam_from_world) * (hits.depth(x, y) * ray.homogeneous());
          const StreamView& other = world.views[i + 1];
          const auto pixel = Project(other.camera, other.cam_from_world * point);
          if (!pixel || (pixel->array() < 0.0).any() || pixel->x() > options.width ||
              pixel->y() > options.height) {
            continue;
          }
          const double share =
              NearestShare(world.stage, OriginInSource(other.cam_from_world), point);
          ++num_points;
          num_passing += share > 1.0 + kTolerance ? 1 : 0;
          num_same += std::abs(share - 1.0) <= kTolerance ? 1 : 0;
        }
      }
    }
  }
  ASSERT_GT(num_points, 4000u);
  EXPECT_LE(num_passing, num_points / 1000);
  // Neighbours share at least half of the picture by construction.
  EXPECT_GT(static_cast<double>(num_same), 0.75 * static_cast<double>(num_points));
}

// The same by the maps alone. Bilinear depth of a plane is off by the square of a pixel's relative
// step; a step of 2 % leaves 1e-4, and curved surfaces a little more.
TEST(SceneStream, StaticDepthsOfNeighboursAgree) {
  const SceneStream stream(SmallOptions());
  std::vector<double> errors;
  for (uint64_t idx = 0; idx < 20; ++idx) {
    const SceneSample sample = stream.Sample(idx);
    const Rigid3d to_other = sample.cam_from_world[1] * Inverse(sample.cam_from_world[0]);
    for (int y = 0; y < 42; ++y) {
      for (int x = 0; x < 56; ++x) {
        const Eigen::Vector2d ray = *Unproject(sample.cameras[0], {x + 0.5, y + 0.5});
        const Eigen::Vector3d point = to_other * (sample.static_depth[0](x, y) * ray.homogeneous());
        const auto pixel = Project(sample.cameras[1], point);
        const auto depth = pixel ? SampleDepth(sample.static_depth[1], *pixel, 0.02) : std::nullopt;
        if (depth && *depth > 0.97 * point.z())
          errors.push_back(std::abs(*depth / point.z() - 1.0));
      }
    }
  }
  ASSERT_GT(errors.size(), 20u * 56 * 42 / 4);
  std::nth_element(
      errors.begin(), errors.begin() + static_cast<long>(errors.size() / 2), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 2e-4);
}

TEST(SceneStream, OnlySkyAndGroundAreFar) {
  SceneStreamOptions options = SmallOptions();
  options.distractor_share = 0.0;
  size_t num_sky = 0;
  for (uint64_t idx = 0; idx < 80; ++idx) {
    const StreamWorld world = WorldOf(options, idx);
    for (const StreamView& view : world.views) {
      for (size_t p = 0; p < view.coarse.depth.size(); ++p) {
        const float depth = view.coarse.depth.data()[p];
        const auto piece_idx = static_cast<size_t>(view.coarse.index.data()[p]);
        const Piece& piece = world.stage.pieces[piece_idx];
        const bool is_ground = piece.solid.half_size.minCoeff() == 0.5 && piece_idx == 1;
        if (piece.solid.kind == ShapeKind::kDome) {
          ++num_sky;
          EXPECT_GT(depth, 75.0f);
        } else if (!is_ground) {
          EXPECT_LT(depth, 60.0f);
        }
      }
    }
  }
  EXPECT_GT(num_sky, 1000u);
}

// Pieces of all views' distractors by their surface.
std::set<int> SurfacesOf(const std::vector<Piece>& pieces) {
  std::set<int> surfaces;
  for (const Piece& piece : pieces) surfaces.insert(piece.surface);
  return surfaces;
}

SceneStreamOptions OptionsOfKinds(uint32_t kinds) {
  SceneStreamOptions options = SmallOptions();
  options.distractor_kinds = kinds;
  return options;
}

TEST(SceneStream, MovingDistractorsAreNeverTwiceInOnePlace) {
  const SceneStreamOptions options = OptionsOfKinds(kThingDistractors | kMovingDistractors);
  for (uint64_t idx = 0; idx < 20; ++idx) {
    const StreamWorld world = WorldOf(options, idx);
    for (size_t i = 0; i + 1 < world.views.size(); ++i) {
      const auto& here = world.distractors[i].pieces;
      const auto& there = world.distractors[i + 1].pieces;
      ASSERT_EQ(here.size(), there.size());
      ASSERT_FALSE(here.empty());
      for (size_t p = 0; p < here.size(); ++p) {
        EXPECT_EQ(here[p].surface, there[p].surface);
        EXPECT_EQ(here[p].solid.half_size, there[p].solid.half_size);
        EXPECT_GT((here[p].solid.centre_in_world - there[p].solid.centre_in_world).norm(), 1e-3);
      }
    }
  }
}

TEST(SceneStream, AbsentDistractorsStandStillAndAreMissingSomewhere) {
  const SceneStreamOptions options = OptionsOfKinds(kCarDistractors | kAbsentDistractors);
  for (uint64_t idx = 0; idx < 20; ++idx) {
    const StreamWorld world = WorldOf(options, idx);
    std::set<std::vector<double>> places;
    size_t num_placed = 0;
    for (const Actors& actors : world.distractors) {
      num_placed += actors.pieces.size();
      for (const Piece& piece : actors.pieces) {
        const Eigen::Vector3d& centre = piece.solid.centre_in_world;
        places.insert({centre.x(), centre.y(), centre.z()});
      }
    }
    ASSERT_GT(num_placed, 0u);
    EXPECT_LE(num_placed, places.size() * (world.views.size() - 1));
  }
}

TEST(SceneStream, DeformingDistractorsChangeTheirSize) {
  const SceneStreamOptions options = OptionsOfKinds(kPersonDistractors | kDeformingDistractors);
  for (uint64_t idx = 0; idx < 20; ++idx) {
    const StreamWorld world = WorldOf(options, idx);
    const auto& here = world.distractors[0].pieces;
    const auto& there = world.distractors[1].pieces;
    ASSERT_EQ(here.size(), there.size());
    for (size_t p = 0; p < here.size(); ++p) {
      EXPECT_NE(here[p].solid.half_size, there[p].solid.half_size);
    }
    for (size_t f = 0; f < world.distractors[0].footprints.size(); ++f) {
      EXPECT_EQ(world.distractors[0].footprints[f].centre,
                world.distractors[1].footprints[f].centre);
    }
  }
}

TEST(SceneStream, OccludingDistractorsAreNearTheCamera) {
  const SceneStream stream(OptionsOfKinds(kPersonDistractors | kOccludingDistractors));
  for (uint64_t idx = 0; idx < 20; ++idx) {
    const SceneSample sample = stream.Sample(idx);
    double depth = 0.0;
    double static_depth = 0.0;
    for (size_t i = 0; i < sample.depth.size(); ++i) {
      for (size_t p = 0; p < sample.depth[i].size(); ++p) {
        if (sample.distractor[i].data()[p] == 0.0f) continue;
        depth += sample.depth[i].data()[p];
        static_depth += sample.static_depth[i].data()[p];
      }
    }
    EXPECT_LT(depth, 0.75 * static_depth) << idx;
  }
}

TEST(SceneStream, LookAlikesOfDistractorsStandStill) {
  int num_with = 0;
  for (const bool has_look_alikes : {true, false}) {
    const SceneStreamOptions options = OptionsOfKinds(
        has_look_alikes ? kAllDistractorKinds : kAllDistractorKinds & ~kStaticLookAlikes);
    for (uint64_t idx = 0; idx < 40; ++idx) {
      const StreamWorld world = WorldOf(options, idx);
      const std::set<int> statics = SurfacesOf(world.stage.pieces);
      bool is_shared = false;
      for (const Actors& actors : world.distractors) {
        for (const int surface : SurfacesOf(actors.pieces)) is_shared |= statics.count(surface) > 0;
      }
      if (has_look_alikes) num_with += is_shared ? 1 : 0;
      EXPECT_TRUE(has_look_alikes || !is_shared);
    }
  }
  EXPECT_GE(num_with, 30);
}

TEST(SceneStream, PhotosOfAFolderAreUsed) {
  const TemporaryFolder folder;
  RgbImage photo(64, 48);
  for (Rgb& rgb : photo.data()) rgb = {255, 0, 255};
  WriteImage(folder / "photo.png", photo);
  SceneStreamOptions options = SmallOptions();
  options.texture_folder = folder.path();
  const SceneStream stream(options);
  size_t num_pink = 0;
  for (uint64_t idx = 0; idx < 10; ++idx) {
    for (const RgbImage& image : stream.Sample(idx).images) {
      num_pink += static_cast<size_t>(
          std::count_if(image.data().begin(), image.data().end(), [](const Rgb& rgb) {
            return rgb[0] > 60 && rgb[2] > 60 && rgb[1] < 20;
          }));
    }
  }
  EXPECT_GT(num_pink, 1000u);
  options.texture_folder = folder / "missing";
  EXPECT_THROW(SceneStream{options}, Error);
}

TEST(SceneStream, RefusesOptionsOutOfRange) {
  SceneStreamOptions options;
  options.min_views = 1;
  EXPECT_THROW(SceneStream{options}, std::invalid_argument);
  options = {};
  options.max_views = 1;
  EXPECT_THROW(SceneStream{options}, std::invalid_argument);
  options = {};
  options.distractor_kinds = kPersonDistractors | kStaticLookAlikes;
  try {
    SceneStream stream(options);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("a body and a way"), std::string::npos);
  }
}

}  // namespace
}  // namespace vgtw
