// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"
#include "scene/rigid3d.h"

#include <string>

#include <Eigen/Geometry>

namespace vgtw {

// A small model that keeps the law and has what formats trip over: ids with gaps, a name in a
// folder, an image without points2D, points2D without a point, a shared camera, no error.
inline Reconstruction SampleModel() {
  Reconstruction model;
  const auto add_camera = [&](CameraId id, CameraModel camera_model, std::vector<double> params) {
    model.cameras[id] = {id, camera_model, 640, 480, std::move(params), false};
  };
  add_camera(2, CameraModel::kPinhole, {500.0, 500.0 + 1.0 / 3.0, 320.0, 240.0});
  add_camera(7, CameraModel::kSimpleRadial, {499.25, 320.5, 239.5, -0.1});

  const auto add_image = [&](ImageId id, CameraId camera_id, std::string name, double angle_deg) {
    Image& image = model.images[id];
    image.image_id = id;
    image.camera_id = camera_id;
    image.name = std::move(name);
    image.cam_from_world.rotation =
        RotationAboutAxis(Eigen::Vector3d(1.0, 2.0, 3.0).normalized(), angle_deg);
    image.cam_from_world.translation = Eigen::Vector3d(0.1 * id, -1.0 / 3.0, 1e-300);
    return &image;
  };
  Image* first = add_image(3, 2, "a/one.jpg", 0.0);
  Image* second = add_image(4, 7, "two.jpg", 33.0);
  add_image(100, 2, "three.png", -170.0);
  first->points2D = {{{10.5, 20.25}, 5}, {{0.1, 479.9}, kInvalidPoint3DId}, {{30.0, 40.0}, 9}};
  second->points2D = {{{600.125, 7.0}, 9}, {{1.0 / 3.0, 2.0}, 5}};

  model.points3D[5] = {{1.0, -2.0, 3.0 + 1e-15}, {255, 0, 128}, 0.75, {{3, 0}, {4, 1}}};
  model.points3D[9] = {{0.1, 0.2, 0.3}, {1, 2, 3}, -1.0, {{4, 0}, {3, 2}}};
  return model;
}

// The same with rigs and frames: image 100 is alone, images 3 and 4 were taken by a rig whose
// second camera has a pose; an IMU has none.
inline Reconstruction SampleModelWithRigs() {
  Reconstruction model = SampleModel();
  constexpr int kCamera = 0;
  constexpr int kImu = 1;
  const Rigid3d second_from_first = {RotationAboutAxis(Eigen::Vector3d::UnitY(), 12.5),
                                     Eigen::Vector3d(-0.5, 0.25, 0.0)};
  model.rigs[1] = {1, {kCamera, 2}, {{{kCamera, 7}, second_from_first}, {{kImu, 1}, {}}}};
  Image& second = model.images.at(4);
  const Rigid3d rig_from_world = model.images.at(3).cam_from_world;
  second.cam_from_world = second_from_first * rig_from_world;
  model.frames[1] = {1, 1, rig_from_world, {{{kCamera, 2}, 3}, {{kCamera, 7}, 4}, {{kImu, 1}, 77}}};
  model.frames[20] = {20, 1, model.images.at(100).cam_from_world, {{{kCamera, 2}, 100}}};
  return model;
}

}  // namespace vgtw
