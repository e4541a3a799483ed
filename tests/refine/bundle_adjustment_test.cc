// SPDX-License-Identifier: BSD-3-Clause
#include "refine/bundle_adjustment.h"

#include "evaluation/pose_error.h"
#include "scene/reprojection.h"
#include "tests/support/synthetic_model.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

BundleAdjustmentOptions FixedIntrinsics() {
  BundleAdjustmentOptions options;
  options.refine_focal_length = false;
  return options;
}

PoseComparison Compare(const Reconstruction& estimate, const Reconstruction& truth) {
  return ComparePoses(CamFromWorldByName(estimate), CamFromWorldByName(truth)).value();
}

double MaxErrorPx(const Reconstruction& reconstruction) {
  double max_error_px = 0.0;
  for (const auto& [image_id, image] : reconstruction.images) {
    for (const Point2D& point2D : image.points2D) {
      if (!point2D.HasPoint3D()) continue;
      max_error_px = std::max(max_error_px,
                              ReprojectionError(reconstruction, image, point2D)
                                  .value_or(std::numeric_limits<double>::infinity()));
    }
  }
  return max_error_px;
}

// Residuals below 1e-6 px and poses equal up to a similarity: what exact data allow.
void ExpectRecovered(const Reconstruction& adjusted, const Reconstruction& truth) {
  EXPECT_LT(MaxErrorPx(adjusted), 1e-6);
  const PoseComparison comparison = Compare(adjusted, truth);
  // 1e-6 px of 500 px focal length is 1e-7 degrees; ten times that for the weakest direction.
  EXPECT_LT(comparison.rotation_mean_deg, 1e-6);
  EXPECT_LT(comparison.centre_rmse_percent, 1e-6);
}

bool SamePose(const Image& a, const Image& b) {
  return a.cam_from_world.rotation.coeffs() == b.cam_from_world.rotation.coeffs() &&
         a.cam_from_world.translation == b.cam_from_world.translation;
}

TEST(AdjustBundle, LeavesTheTruthWhereItIs) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction adjusted = truth;
  const BundleAdjustmentSummary summary = AdjustBundle({}, adjusted);
  EXPECT_TRUE(summary.success) << summary.message;
  EXPECT_EQ(summary.num_residuals, 2u * 6u * 120u);
  // 1440 squared residuals of rounding size (1e-13 px).
  EXPECT_LT(summary.initial_cost, 1e-20);
  EXPECT_LT(Compare(adjusted, truth).centre_rmse, 1e-10);
}

TEST(AdjustBundle, RecoversPosesAndPoints) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction adjusted = truth;
  PerturbPoses(adjusted, 1.0, 0.1, 1);
  PerturbPoints(adjusted, 0.05, 2);
  EXPECT_GT(MaxErrorPx(adjusted), 10.0);
  const BundleAdjustmentSummary summary = AdjustBundle(FixedIntrinsics(), adjusted);
  EXPECT_TRUE(summary.success) << summary.message;
  EXPECT_LT(summary.final_cost, 1e-9 * summary.initial_cost);
  EXPECT_GT(summary.num_iterations, 1);
  ExpectRecovered(adjusted, truth);
}

TEST(AdjustBundle, RecoversIntrinsicsOfASharedCamera) {
  SyntheticModelOptions model;
  model.camera_model = CameraModel::kOpenCV;
  model.shared_camera = true;
  model.num_images = 10;
  const Reconstruction truth = MakeSyntheticModel(model);
  Reconstruction adjusted = truth;
  PerturbPoses(adjusted, 0.5, 0.05, 3);
  adjusted.cameras.at(1).params = {520.0, 515.0, 322.0, 240.0, 0.0, 0.0, 0.0, 0.0};
  BundleAdjustmentOptions options;
  options.refine_principal_point = true;
  options.refine_extra_params = true;
  options.max_num_iterations = 200;
  const BundleAdjustmentSummary summary = AdjustBundle(options, adjusted);
  EXPECT_TRUE(summary.success) << summary.message;
  ExpectRecovered(adjusted, truth);
  for (size_t i = 0; i < 8; ++i) {
    const double expected = truth.cameras.at(1).params[i];
    EXPECT_NEAR(adjusted.cameras.at(1).params[i], expected, 1e-6 * std::max(1.0, expected)) << i;
  }
}

TEST(AdjustBundle, RecoversWithEveryCameraModel) {
  for (int i = 0; i < kNumCameraModels; ++i) {
    SyntheticModelOptions model;
    model.camera_model = static_cast<CameraModel>(i);
    model.num_points = 40;
    const Reconstruction truth = MakeSyntheticModel(model);
    Reconstruction adjusted = truth;
    PerturbPoses(adjusted, 0.5, 0.05, 4);
    SCOPED_TRACE(GetCameraModelInfo(model.camera_model).name);
    EXPECT_TRUE(AdjustBundle(FixedIntrinsics(), adjusted).success);
    ExpectRecovered(adjusted, truth);
  }
}

TEST(AdjustBundle, RecoversAPlanarScene) {
  SyntheticModelOptions model;
  model.planar = true;
  const Reconstruction truth = MakeSyntheticModel(model);
  Reconstruction adjusted = truth;
  PerturbPoses(adjusted, 0.5, 0.05, 5);
  PerturbPoints(adjusted, 0.02, 5);
  EXPECT_TRUE(AdjustBundle(FixedIntrinsics(), adjusted).success);
  ExpectRecovered(adjusted, truth);
}

TEST(AdjustBundle, CauchyLossIgnoresATenthOfOutliers) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction adjusted = truth;
  std::mt19937 random(6);
  std::uniform_real_distribution<double> offset_px(20.0, 120.0);
  std::bernoulli_distribution is_outlier(0.1);
  size_t num_outliers = 0;
  for (auto& [image_id, image] : adjusted.images) {
    for (Point2D& point2D : image.points2D) {
      if (!is_outlier(random)) continue;
      point2D.xy.x() += offset_px(random);
      ++num_outliers;
    }
  }
  ASSERT_GT(num_outliers, 50u);
  Reconstruction squared = adjusted;
  PerturbPoses(adjusted, 0.2, 0.02, 7);
  BundleAdjustmentOptions options = FixedIntrinsics();
  // The pull of an outlier at distance d falls with scale^2 / d: 1e-6 / 20 of the inliers'.
  options.max_num_iterations = 200;
  for (const double scale_px : {4.0, 1.0, 0.1, 0.001}) {
    options.loss_scale_px = scale_px;
    EXPECT_TRUE(AdjustBundle(options, adjusted).success);
  }
  EXPECT_LT(Compare(adjusted, truth).rotation_mean_deg, 1e-5);
  EXPECT_LT(Compare(adjusted, truth).centre_rmse_percent, 1e-4);

  options.loss = RobustLoss::kTrivial;
  EXPECT_TRUE(AdjustBundle(options, squared).success);
  EXPECT_GT(Compare(squared, truth).centre_rmse_percent, 1.0);
}

TEST(AdjustBundle, FromTwoImages) {
  SyntheticModelOptions model;
  model.num_images = 2;
  model.arc_deg = 30.0;
  const Reconstruction truth = MakeSyntheticModel(model);
  Reconstruction adjusted = truth;
  PerturbPoses(adjusted, 0.5, 0.05, 8);
  const BundleAdjustmentSummary summary = AdjustBundle(FixedIntrinsics(), adjusted);
  EXPECT_TRUE(summary.success);
  EXPECT_LT(MaxErrorPx(adjusted), 1e-6);
  // Two centres cannot be aligned by a similarity; what remains is cam2_from_cam1 up to scale.
  const auto relative = [](const Reconstruction& reconstruction) {
    return reconstruction.images.at(2).cam_from_world *
           Inverse(reconstruction.images.at(1).cam_from_world);
  };
  EXPECT_LT(AngleBetweenDeg(relative(adjusted).rotation, relative(truth).rotation), 1e-6);
  EXPECT_LT((relative(adjusted).translation.normalized() - relative(truth).translation.normalized())
                .norm(),
            1e-7);
}

TEST(AdjustBundle, HoldsOnePoseAndOneCoordinate) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction before = truth;
  PerturbPoses(before, 1.0, 0.1, 9);
  Reconstruction adjusted = before;
  const BundleAdjustmentSummary summary = AdjustBundle(FixedIntrinsics(), adjusted);
  size_t num_same = 0;
  std::string held_name;
  for (const auto& [image_id, image] : adjusted.images) {
    if (!SamePose(image, before.images.at(image_id))) continue;
    ++num_same;
    held_name = image.name;
  }
  EXPECT_EQ(num_same, 1u);
  EXPECT_EQ(summary.gauge.find("pose of " + held_name), 0u) << summary.gauge;
}

TEST(AdjustBundle, DoesNotDependOnTheWorld) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction here = truth;
  PerturbPoses(here, 1.0, 0.1, 10);
  Reconstruction there = here;
  // Coordinates as large as those of a national grid.
  const Sim3d there_from_here = {
      250.0, RotationAboutAxis({0.6, 0.0, 0.8}, 100.0), {3.5e6, 5.2e6, 300.0}};
  for (auto& [image_id, image] : there.images) {
    image.cam_from_world = TransformCamera(there_from_here, image.cam_from_world);
  }
  for (auto& [point3D_id, point] : there.points3D) point.xyz = there_from_here * point.xyz;
  EXPECT_TRUE(AdjustBundle(FixedIntrinsics(), here).success);
  EXPECT_TRUE(AdjustBundle(FixedIntrinsics(), there).success);
  // 5e6 is stored to 1e-9, and a unit is 250: 4e-12 times the focal length.
  EXPECT_LT(MaxErrorPx(there), 1e-6);
  EXPECT_LT(Compare(there, here).centre_rmse_percent, 1e-6);
}

TEST(AdjustBundle, FixedIntrinsicsStayBitEqual) {
  SyntheticModelOptions model;
  model.camera_model = CameraModel::kRadial;
  Reconstruction adjusted = MakeSyntheticModel(model);
  PerturbPoses(adjusted, 0.5, 0.05, 11);
  for (auto& [camera_id, camera] : adjusted.cameras) camera.params[0] *= 1.01;
  const auto before = adjusted.cameras;

  BundleAdjustmentOptions options;  // focal length only
  EXPECT_TRUE(AdjustBundle(options, adjusted).success);
  for (const auto& [camera_id, camera] : adjusted.cameras) {
    EXPECT_NE(camera.params[0], before.at(camera_id).params[0]);
    for (size_t i = 1; i < 5; ++i) EXPECT_EQ(camera.params[i], before.at(camera_id).params[i]);
  }
  const auto refined = adjusted.cameras;
  PerturbPoses(adjusted, 0.1, 0.01, 12);
  EXPECT_TRUE(AdjustBundle(FixedIntrinsics(), adjusted).success);
  EXPECT_EQ(adjusted.cameras, refined);
}

TEST(AdjustBundle, FixedPosesStayBitEqual) {
  Reconstruction before = MakeSyntheticModel({});
  PerturbPoses(before, 0.5, 0.05, 13);
  Reconstruction adjusted = before;
  BundleAdjustmentOptions options = FixedIntrinsics();
  options.refine_poses = false;
  const BundleAdjustmentSummary summary = AdjustBundle(options, adjusted);
  EXPECT_TRUE(summary.success);
  EXPECT_LT(summary.final_cost, summary.initial_cost);
  for (const auto& [image_id, image] : adjusted.images) {
    EXPECT_TRUE(SamePose(image, before.images.at(image_id)));
  }
  EXPECT_NE(adjusted.points3D.at(1).xyz, before.points3D.at(1).xyz);

  adjusted = before;
  options.refine_poses = true;
  options.fixed_images = {2, 5};
  EXPECT_TRUE(AdjustBundle(options, adjusted).success);
  for (const auto& [image_id, image] : adjusted.images) {
    EXPECT_EQ(SamePose(image, before.images.at(image_id)), image_id == 2 || image_id == 5);
  }
}

TEST(AdjustBundle, ImagesWithFewObservationsKeepTheirPose) {
  Reconstruction before = MakeSyntheticModel({});
  for (Point3DId id = 3; id <= 120; ++id) {
    RemoveObservation(before, {4, static_cast<uint32_t>(id - 1)});
  }
  for (Point3DId id = 1; id <= 120; ++id) {
    RemoveObservation(before, {5, static_cast<uint32_t>(id - 1)});
  }
  PerturbPoses(before, 0.5, 0.05, 14);
  Reconstruction adjusted = before;
  EXPECT_TRUE(AdjustBundle(FixedIntrinsics(), adjusted).success);
  EXPECT_TRUE(SamePose(adjusted.images.at(4), before.images.at(4)));
  EXPECT_TRUE(SamePose(adjusted.images.at(5), before.images.at(5)));
  EXPECT_FALSE(SamePose(adjusted.images.at(6), before.images.at(6)));
}

TEST(AdjustBundle, GroupsWithoutCommonPointsAreAdjustedEach) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction adjusted = truth;
  for (const auto& [point3D_id, point] : truth.points3D) {
    for (const TrackElement& element : point.track) {
      if ((element.image_id <= 3) != (point3D_id <= 60)) RemoveObservation(adjusted, element);
    }
  }
  PerturbPoses(adjusted, 0.5, 0.05, 15);
  const BundleAdjustmentSummary summary = AdjustBundle(FixedIntrinsics(), adjusted);
  EXPECT_TRUE(summary.success);
  EXPECT_LT(MaxErrorPx(adjusted), 1e-6);
  EXPECT_EQ(std::count(summary.gauge.begin(), summary.gauge.end(), ';'), 1) << summary.gauge;
  for (const ImageId first : {ImageId{1}, ImageId{4}}) {
    Reconstruction group = adjusted;
    std::erase_if(group.images, [&](const auto& entry) {
      return entry.first < first || entry.first > first + 2;
    });
    EXPECT_LT(Compare(group, truth).rotation_mean_deg, 1e-6);
    EXPECT_LT(Compare(group, truth).centre_rmse_percent, 1e-6);
  }
}

TEST(AdjustBundle, ObservationsBehindTheCameraTakeNoPart) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction adjusted = truth;
  adjusted.points3D.at(1).xyz = {0.0, 0.0, -50.0};  // behind all cameras
  const Eigen::Vector3d behind = adjusted.points3D.at(1).xyz;
  PerturbPoses(adjusted, 0.5, 0.05, 16);
  const BundleAdjustmentSummary summary = AdjustBundle(FixedIntrinsics(), adjusted);
  EXPECT_TRUE(summary.success);
  EXPECT_EQ(summary.num_residuals, 2u * 6u * 119u);
  EXPECT_EQ(adjusted.points3D.at(1).xyz, behind);
  EXPECT_LT(Compare(adjusted, truth).rotation_mean_deg, 1e-6);
}

// Matches that contradict the poses send points through infinity or onto a camera.
TEST(AdjustBundle, StaysFiniteWhenPointsPassBehindCameras) {
  Reconstruction adjusted = MakeSyntheticModel({});
  std::mt19937 random(17);
  std::uniform_real_distribution<double> pixel(0.0, 480.0);
  for (auto& [image_id, image] : adjusted.images) {
    for (size_t i = 0; i < 40; ++i) {
      const double x = pixel(random);
      image.points2D[i].xy = {x, pixel(random)};
    }
  }
  for (Point3DId id = 1; id <= 40; ++id) {
    adjusted.points3D.at(id).xyz =
        Inverse(adjusted.images.at(1).cam_from_world) * Eigen::Vector3d(0.0, 0.0, 1e-3);
  }
  for (const RobustLoss loss : {RobustLoss::kCauchy, RobustLoss::kTrivial}) {
    BundleAdjustmentOptions options;
    options.loss = loss;
    Reconstruction copy = adjusted;
    const BundleAdjustmentSummary summary = AdjustBundle(options, copy);
    EXPECT_LE(summary.final_cost, summary.initial_cost);
    EXPECT_EQ(FindFault(copy), "");
  }
}

TEST(AdjustBundle, FramesFollowTheImages) {
  Reconstruction adjusted = MakeSyntheticModel({});
  for (const auto& [image_id, image] : adjusted.images) {
    const SensorId sensor = {0, image.camera_id};
    adjusted.rigs[image.camera_id] = {image.camera_id, sensor, {}};
    adjusted.frames[image_id] = {
        image_id, image.camera_id, image.cam_from_world, {{sensor, image_id}}};
  }
  PerturbPoses(adjusted, 0.5, 0.05, 18);
  EXPECT_TRUE(AdjustBundle(FixedIntrinsics(), adjusted).success);
  for (const auto& [image_id, image] : adjusted.images) {
    EXPECT_EQ(adjusted.frames.at(image_id).rig_from_world.translation,
              image.cam_from_world.translation);
  }
}

TEST(AdjustBundle, StopsWhenItsCallerSaysSo) {
  Reconstruction adjusted = MakeSyntheticModel({});
  PerturbPoses(adjusted, 1.0, 0.1, 19);
  BundleAdjustmentOptions options = FixedIntrinsics();
  std::vector<double> costs;
  options.on_iteration = [&](int iteration, double cost) {
    EXPECT_EQ(iteration, static_cast<int>(costs.size()));
    costs.push_back(cost);
    return iteration < 2;
  };
  const BundleAdjustmentSummary summary = AdjustBundle(options, adjusted);
  EXPECT_TRUE(summary.success);
  ASSERT_EQ(costs.size(), 3u);
  EXPECT_EQ(costs.front(), summary.initial_cost);
  EXPECT_EQ(summary.final_cost, *std::min_element(costs.begin(), costs.end()));
  EXPECT_LT(summary.final_cost, summary.initial_cost);
}

TEST(AdjustBundle, HasNothingToDoWithoutPoints) {
  Reconstruction empty;
  BundleAdjustmentSummary summary = AdjustBundle({}, empty);
  EXPECT_FALSE(summary.success);
  EXPECT_EQ(summary.message, "no point is observed by two images");

  SyntheticModelOptions one_image;
  one_image.num_images = 1;
  Reconstruction single = MakeSyntheticModel(one_image);
  EXPECT_FALSE(AdjustBundle({}, single).success);
}

TEST(AdjustBundle, RefusesWrongOptionsAndBrokenModels) {
  Reconstruction reconstruction = MakeSyntheticModel({});
  BundleAdjustmentOptions options;
  options.loss_scale_px = 0.0;
  EXPECT_THROW(AdjustBundle(options, reconstruction), std::invalid_argument);
  options = {};
  options.max_num_iterations = -1;
  EXPECT_THROW(AdjustBundle(options, reconstruction), std::invalid_argument);
  options = {};
  options.function_tolerance = 1.0;
  EXPECT_THROW(AdjustBundle(options, reconstruction), std::invalid_argument);
  reconstruction.images.at(1).points2D.clear();
  EXPECT_THROW(AdjustBundle({}, reconstruction), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
