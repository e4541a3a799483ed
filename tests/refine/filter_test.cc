// SPDX-License-Identifier: BSD-3-Clause
#include "refine/filter.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Cameras at x = 0, 1 and 2 that look along z with focal length 100 and principal point (50, 50);
// point 1 at (0, 0, 10): pixels x = 50, 40, 30.
Reconstruction ThreeCamerasOnePoint() {
  Reconstruction model;
  model.cameras[1] = MakePinhole(100, 100, 100.0, 100.0);
  model.cameras[1].camera_id = 1;
  model.points3D[1].xyz = {0.0, 0.0, 10.0};
  for (ImageId id = 1; id <= 3; ++id) {
    const double x = id - 1.0;
    Image& image = model.images[id];
    image.image_id = id;
    image.camera_id = 1;
    image.name = std::to_string(id);
    image.cam_from_world.translation = {-x, 0.0, 0.0};
    image.points2D = {{{50.0 - 10.0 * x, 50.0}, 1}};
    model.points3D[1].track.push_back({id, 0});
  }
  return model;
}

TEST(FilterObservations, KeepsWhatFits) {
  Reconstruction model = ThreeCamerasOnePoint();
  const FilterSummary summary = FilterObservations({}, model);
  EXPECT_EQ(summary.num_removed_observations, 0u);
  EXPECT_EQ(summary.num_removed_points3D, 0u);
  EXPECT_EQ(model.points3D.at(1).track.size(), 3u);
}

TEST(FilterObservations, RemovesAnObservationAboveTheLimit) {
  for (const double error_px : {3.9, 4.1}) {
    Reconstruction model = ThreeCamerasOnePoint();
    model.images.at(2).points2D[0].xy.y() += error_px;
    const FilterSummary summary = FilterObservations({}, model);
    EXPECT_EQ(summary.num_removed_observations, error_px > 4.0 ? 1u : 0u);
    EXPECT_EQ(summary.num_removed_points3D, 0u);
    EXPECT_EQ(model.images.at(2).points2D[0].HasPoint3D(), error_px < 4.0);
    EXPECT_EQ(FindFault(model), "");
  }
}

TEST(FilterObservations, RemovesAPointWithOneObservationLeft) {
  Reconstruction model = ThreeCamerasOnePoint();
  model.images.at(1).points2D[0].xy.x() += 10.0;
  model.images.at(3).points2D[0].xy.x() += 10.0;
  const FilterSummary summary = FilterObservations({}, model);
  EXPECT_EQ(summary.num_removed_observations, 3u);
  EXPECT_EQ(summary.num_removed_points3D, 1u);
  EXPECT_TRUE(model.points3D.empty());
  EXPECT_EQ(FindFault(model), "");
}

TEST(FilterObservations, RemovesAnObservationBehindItsCamera) {
  Reconstruction model = ThreeCamerasOnePoint();
  // Turned by 180 degrees about y: the mirrored projection has the same pixel x.
  model.images.at(1).cam_from_world.rotation = RotationAboutAxis({0, 1, 0}, 180.0);
  EXPECT_EQ(FilterObservations({}, model).num_removed_observations, 1u);
  EXPECT_EQ(model.points3D.at(1).track.size(), 2u);
}

TEST(FilterObservations, AngleIsTheLargestOfAllPairs) {
  FilterOptions options;
  const double widest_deg = std::atan2(2.0, 10.0) * 180.0 / std::numbers::pi;
  options.min_triangulation_angle_deg = widest_deg - 1e-9;
  Reconstruction model = ThreeCamerasOnePoint();
  EXPECT_EQ(FilterObservations(options, model).num_removed_points3D, 0u);
  options.min_triangulation_angle_deg = widest_deg + 1e-9;
  EXPECT_EQ(FilterObservations(options, model).num_removed_points3D, 1u);
}

// The rays of the observations that stay count, not those of the removed ones.
TEST(FilterObservations, AngleIsTakenAfterBadObservationsAreGone) {
  FilterOptions options;
  options.min_triangulation_angle_deg = 10.0;  // cameras 1 and 3 only
  Reconstruction model = ThreeCamerasOnePoint();
  model.images.at(3).points2D[0].xy.y() += 10.0;
  const FilterSummary summary = FilterObservations(options, model);
  EXPECT_EQ(summary.num_removed_points3D, 1u);
  EXPECT_EQ(summary.num_removed_observations, 3u);
}

TEST(FilterObservations, RefusesWrongOptions) {
  Reconstruction model;
  EXPECT_THROW(FilterObservations({0.0, 1.5}, model), std::invalid_argument);
  EXPECT_THROW(FilterObservations({4.0, -0.1}, model), std::invalid_argument);
  EXPECT_THROW(FilterObservations({4.0, 90.0}, model), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
