// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/model_quality.h"

#include "tests/support/synthetic_model.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Two cameras of 100 x 100 pixels, f = 100, that look along z from x = -1 and x = 1; points at
// depth 1 (90 degrees) and 10.
Reconstruction MakeModel() {
  Reconstruction model;
  Camera camera = MakePinhole(100, 100, 100.0, 100.0);
  camera.camera_id = 1;
  model.cameras[1] = camera;
  for (const ImageId id : {1u, 2u}) {
    Image& image = model.images[id];
    image.image_id = id;
    image.camera_id = 1;
    image.name = std::to_string(id);
    image.cam_from_world.translation.x() = id == 1 ? 1.0 : -1.0;
  }
  const auto add = [&](Point3DId point3D_id, const Eigen::Vector3d& xyz, double error_px) {
    Point3D& point = model.points3D[point3D_id];
    point.xyz = xyz;
    for (auto& [id, image] : model.images) {
      point.track.push_back({id, static_cast<uint32_t>(image.points2D.size())});
      const Eigen::Vector3d x = image.cam_from_world * xyz;
      image.points2D.push_back(
          {{50.0 + 100.0 * x.x() / x.z() + error_px, 50.0 + 100.0 * x.y() / x.z()}, point3D_id});
    }
  };
  add(1, {0.0, 0.0, 10.0}, 0.5);
  add(2, {0.1, 0.2, 10.0}, 1.0);
  add(3, {0.0, 0.0, 1.0}, 2.0);
  return model;
}

TEST(MeasureQuality, FiguresByHand) {
  const ModelQuality quality = MeasureQuality(MakeModel());
  EXPECT_EQ(quality.reprojection.num_points3D, 3u);
  EXPECT_FALSE(quality.num_points_on_distractors.has_value());
  // atan(1 / 10) to either side, or nearly, and 45 degrees to either side.
  const double shallow_deg = 2.0 * std::atan(0.1) * 180.0 / M_PI;
  EXPECT_NEAR(quality.median_angle_deg, shallow_deg, 1e-9);
  const ViewQuality& view = quality.views.at(1);
  EXPECT_EQ(view.num_observations, 3u);
  EXPECT_EQ(view.mean_track_length, 2.0);
  EXPECT_NEAR(view.median_px, 1.0, 1e-9);
  EXPECT_NEAR(view.median_angle_deg, shallow_deg, 1e-9);
  // Cells (6, 5), (6, 5) and, beyond the border, (9, 5).
  EXPECT_DOUBLE_EQ(view.coverage_percent, 2.0);
  ASSERT_EQ(quality.errors_px.size(), 6u);
  EXPECT_NEAR(quality.errors_px[3 + 2], 2.0, 1e-9);
  EXPECT_EQ(quality.track_lengths, (std::vector<double>{2.0, 2.0, 2.0}));
}

TEST(MeasureQuality, ImagesWithoutObservationsHaveNoMedians) {
  Reconstruction model = MakeModel();
  model.images[3] = model.images[1];
  model.images[3].image_id = 3;
  model.images[3].points2D.clear();
  const ModelQuality quality = MeasureQuality(model);
  EXPECT_EQ(quality.views.at(3).num_observations, 0u);
  EXPECT_TRUE(std::isnan(quality.views.at(3).median_px));
  EXPECT_TRUE(std::isnan(quality.views.at(3).median_angle_deg));
  EXPECT_EQ(quality.views.at(3).coverage_percent, 0.0);
  EXPECT_DOUBLE_EQ(
      quality.coverage_percent,
      (quality.views.at(1).coverage_percent + quality.views.at(2).coverage_percent) / 3.0);
}

TEST(MeasureQuality, CountsWhatLiesOnDistractors) {
  // All of image 1 is excluded from column 100 * 0.62 on.
  const ModelQuality quality = MeasureQuality(MakeModel(), [](const std::string& name) {
    StaticMask mask(100, 100, 255);
    for (int y = 0; y < 100 && name == "1"; ++y) {
      for (int x = 62; x < 100; ++x) mask(x, y) = 0;
    }
    return mask;
  });
  // 60.5, 62.0 and 152 px; image 2 sees the last one outside of its mask, at -48 px.
  EXPECT_EQ(quality.num_points_on_distractors, 2u);
  EXPECT_EQ(quality.views.at(1).num_on_distractors, 2u);
  EXPECT_EQ(quality.views.at(2).num_on_distractors, 1u);
}

}  // namespace
}  // namespace vgtw
