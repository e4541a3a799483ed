// SPDX-License-Identifier: BSD-3-Clause
// COLMAP's image_undistorter makes the workspace, its stereo_fusion reads our maps in place of
// those of patch_match_stereo, which needs CUDA.
#include "tests/support/colmap.h"

#include "bridge/colmap_depth.h"
#include "bridge/colmap_model.h"
#include "bridge/point_cloud.h"
#include "bridge/seed.h"
#include "scene/statistics.h"
#include "scene/synthetic.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Photos of a room through a distorting lens, their true predictions and the seed of these.
void WriteRoom(const SyntheticScene& scene, const TemporaryFolder& folder) {
  for (size_t i = 0; i < scene.views().size(); ++i) {
    WriteImage(folder.path() / "photos" / scene.views()[i].name, scene.Render(i).image);
  }
  WritePrediction(MakeTruePrediction(scene), folder / "predictions", false);
  WriteModel(MakeSeed(PredictionReader(folder / "predictions"), SeedOptions()).reconstruction,
             folder / "seed");
}

// How far a point is from what the views see at its pixel: the least of all views, over its depth.
double RelativeError(const SyntheticScene& scene, const Eigen::Vector3d& point) {
  double least = HUGE_VAL;
  for (size_t i = 0; i < scene.views().size(); ++i) {
    const View& view = scene.views()[i];
    const Eigen::Vector3d in_cam = view.cam_from_world * point;
    const auto pixel = Project(view.camera, in_cam);
    if (!pixel) continue;
    const auto truth = scene.StaticPoint(i, *pixel);
    if (truth) least = std::min(least, (*truth - point).norm() / in_cam.z());
  }
  return least;
}

// COLMAP's fusion takes column and row of a pixel for its place, though its centre lies half a
// pixel from there, so that its clouds are displaced by up to half a pixel. With
// the principal points moved as far, it is exact, and what is left is the error of our maps.
void ShiftByHalfAPixel(const std::filesystem::path& model_folder) {
  Reconstruction model = ReadModel(model_folder);
  for (auto& [id, camera] : model.cameras) {
    camera.SetPrincipalPoint(camera.PrincipalPoint() - Eigen::Vector2d(0.5, 0.5));
  }
  WriteModel(model, model_folder, {.overwrite = true});
}

TEST(ColmapDepthByColmap, StereoFusionMakesTheSceneOfOurMaps) {
  VGTW_NEED_COLMAP();
  SyntheticOptions options;
  options.num_views = 6;
  options.width = 320;
  options.height = 240;
  options.path_extent_deg = 30.0;
  options.radial_distortion = -0.05;
  const SyntheticScene scene(options);
  const TemporaryFolder folder;
  WriteRoom(scene, folder);
  const ColmapRun undistorter = RunColmap({"image_undistorter",
                                           "--image_path",
                                           folder / "photos",
                                           "--input_path",
                                           folder / "seed",
                                           "--output_path",
                                           folder / "dense"});
  ASSERT_EQ(undistorter.exit_code, 0) << undistorter.output;

  ColmapDepthOptions depth;
  depth.filter.keep_percent = 100.0;
  const auto summaries = WriteColmapDepthMaps(
      PredictionReader(folder / "predictions"), folder / "seed", folder / "dense", depth);
  for (const DepthMapSummary& summary : summaries) {
    // The seed's points are means over cubes of 0.5 % of the extent.
    EXPECT_NEAR(summary.scale, 1.0, 1e-3) << summary.image_name;
    EXPECT_GT(summary.num_scale_points, 100u);
  }
  ShiftByHalfAPixel(folder / "dense/sparse");
  const ColmapRun fusion = RunColmap({"stereo_fusion",
                                      "--workspace_path",
                                      folder / "dense",
                                      "--input_type",
                                      "geometric",
                                      "--StereoFusion.min_num_pixels",
                                      "3",
                                      "--output_path",
                                      folder / "fused.ply"});
  ASSERT_EQ(fusion.exit_code, 0) << fusion.output;

  const std::vector<ColoredPoint> fused = ReadPly(folder / "fused.ply");
  ASSERT_GT(fused.size(), 20000u) << fusion.output;
  std::vector<double> errors;
  for (size_t i = 0; i < fused.size(); i += 7) {
    errors.push_back(RelativeError(scene, fused[i].xyz.cast<double>()));
  }
  // 1e-7 is a float's rounding; without the shift it is 7e-4, 0.2 px. A percent of the points joins
  // pixels on both sides of a crease.
  EXPECT_LT(Median(errors), 1e-6);
  EXPECT_LT(Percentile(errors, 98.0), 1e-3);
}

}  // namespace
}  // namespace vgtw
