// SPDX-License-Identifier: BSD-3-Clause
#include "tests/support/synthetic_model.h"

#include "scene/error.h"
#include "scene/rigid3d.h"

#include <cmath>
#include <numbers>
#include <string>

namespace vgtw {
namespace {

Eigen::Vector3d RandomVector(std::mt19937& random, double rms_length) {
  std::normal_distribution<double> normal;
  const double x = normal(random);
  const double y = normal(random);
  return rms_length / std::sqrt(3.0) * Eigen::Vector3d(x, y, normal(random));
}

}  // namespace

Camera MakeTestCamera(CameraModel model) {
  Camera camera = MakePinhole(640, 480, 500.0, 500.0);
  camera.camera_id = 1;
  camera.model = model;
  const CameraModelInfo& info = GetCameraModelInfo(model);
  camera.params = {500.0, 318.0, 243.0};
  if (info.num_focal_lengths == 2) camera.params.insert(camera.params.begin(), 495.0);
  const double extra[] = {-0.05, 0.02, 0.003, -0.002, 0.004, -0.003, 0.002, 0.001};
  for (int i = 0; camera.params.size() < static_cast<size_t>(info.num_params); ++i) {
    camera.params.push_back(model == CameraModel::kFOV ? 0.4 : extra[i]);
  }
  return camera;
}

Reconstruction MakeSyntheticModel(const SyntheticModelOptions& options) {
  std::mt19937 random(options.seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Reconstruction model;
  for (int i = 0; i < options.num_images; ++i) {
    const auto image_id = static_cast<ImageId>(i + 1);
    Camera camera = MakeTestCamera(options.camera_model);
    camera.camera_id = options.shared_camera ? 1 : image_id;
    model.cameras[camera.camera_id] = camera;
    Image image;
    image.image_id = image_id;
    image.camera_id = camera.camera_id;
    image.name = "image" + std::to_string(image_id) + ".jpg";
    const double share = options.num_images > 1 ? i / (options.num_images - 1.0) - 0.5 : 0.0;
    const double angle = options.arc_deg * share * std::numbers::pi / 180.0;
    const Eigen::Vector3d centre(
        4.0 * std::sin(angle), 0.4 * uniform(random), -4.0 * std::cos(angle));
    image.cam_from_world = LookAt(centre, 0.2 * RandomVector(random, 1.0), {0.0, -1.0, 0.0});
    model.images[image_id] = image;
  }
  for (int i = 0; i < options.num_points; ++i) {
    const auto point3D_id = static_cast<Point3DId>(i + 1);
    Point3D point;
    point.xyz.x() = uniform(random);
    point.xyz.y() = 0.8 * uniform(random);
    point.xyz.z() = options.planar ? 0.3 * point.xyz.x() : uniform(random);
    for (auto& [image_id, image] : model.images) {
      point.track.push_back({image_id, static_cast<uint32_t>(image.points2D.size())});
      image.points2D.push_back({Eigen::Vector2d::Zero(), point3D_id});
    }
    model.points3D[point3D_id] = point;
  }
  ProjectAgain(model, 0.0, options.seed);
  return model;
}

void ProjectAgain(Reconstruction& reconstruction, double sigma_px, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  for (auto& [image_id, image] : reconstruction.images) {
    const Camera& camera = reconstruction.cameras.at(image.camera_id);
    for (Point2D& point2D : image.points2D) {
      if (!point2D.HasPoint3D()) continue;
      const auto pixel = Project(
          camera, image.cam_from_world * reconstruction.points3D.at(point2D.point3D_id).xyz);
      VGTW_CHECK(pixel.has_value(), "a point is behind " + image.name);
      const double x = normal(random);
      point2D.xy = *pixel + sigma_px * Eigen::Vector2d(x, normal(random));
    }
  }
}

void PerturbPoses(Reconstruction& reconstruction,
                  double rotation_deg,
                  double centre_distance,
                  unsigned seed,
                  ImageId kept_image_id) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  for (auto& [image_id, image] : reconstruction.images) {
    const Eigen::Vector3d axis = RandomVector(random, 1.0).normalized();
    const Eigen::Quaterniond change = RotationAboutAxis(axis, rotation_deg * normal(random));
    const Eigen::Vector3d centre =
        OriginInSource(image.cam_from_world) + RandomVector(random, centre_distance);
    if (image_id == kept_image_id) continue;
    const Eigen::Quaterniond rotation = (change * image.cam_from_world.rotation).normalized();
    image.cam_from_world = {rotation, -(rotation * centre)};
  }
}

void PerturbPoints(Reconstruction& reconstruction, double distance, unsigned seed) {
  std::mt19937 random(seed);
  for (auto& [point3D_id, point] : reconstruction.points3D) {
    point.xyz += RandomVector(random, distance);
  }
}

}  // namespace vgtw
