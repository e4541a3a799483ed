// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/view_features.h"
#include "scene/random.h"
#include "scene/reconstruction.h"
#include "tests/support/wall_prediction.h"

#include <cmath>
#include <map>
#include <string>
#include <vector>

namespace vgtw {

// Points, the views that see them with exact rays and depths (as floats), and their tracks.
struct TrackScene {
  std::vector<Eigen::Vector3d> points;
  std::map<ImageId, ViewFeatures> views;
  std::vector<std::vector<TrackElement>> tracks;  // of each point
};

// Adds a keypoint of each point to a view with the given pose, whether the image is that large or
// not.
inline void AddView(const Rigid3d& cam_from_world, ImageId image_id, TrackScene& scene) {
  ViewFeatures& view = scene.views[image_id];
  view.view.name = std::to_string(image_id);
  view.view.camera = MakePinhole(64, 48, 61.2, 61.2);
  view.view.cam_from_world = cam_from_world;
  scene.tracks.resize(scene.points.size());
  for (size_t i = 0; i < scene.points.size(); ++i) {
    const Eigen::Vector3d point_in_cam = cam_from_world * scene.points[i];
    const Eigen::Vector2d ray = point_in_cam.hnormalized();
    view.pixels.push_back((61.2 * ray + Eigen::Vector2d(32.0, 24.0)).cast<float>());
    view.rays.push_back(ray.cast<float>());
    view.scales.push_back(1.0f);
    view.depths.push_back(static_cast<float>(point_in_cam.z()));
    view.depth_confs.push_back(1.0f);
    scene.tracks[i].push_back({image_id, static_cast<uint32_t>(i)});
  }
}

// Nine points on the wall z = 5.1 and views 1, 2, ... at x = 0, 0.5, 1, ... and z = 0,
// `forward`, 2 `forward`, ... that look along z.
inline TrackScene MakeWallScene(int num_views, double forward = 0.0) {
  TrackScene scene;
  for (const double x : {-1.0, 0.0, 1.0}) {
    for (const double y : {-1.0, 0.0, 1.0}) scene.points.emplace_back(x, y, kWallDepth);
  }
  for (int i = 0; i < num_views; ++i) {
    AddView({Eigen::Quaterniond::Identity(), {-0.5 * i, 0.0, -forward * i}},
            static_cast<ImageId>(i + 1),
            scene);
  }
  return scene;
}

// Points in a box of edge 2 around the origin, views on an arc of `arc_deg` at the distance 4.
inline TrackScene MakeArcScene(int num_views, int num_points, double arc_deg, uint64_t seed) {
  RandomStream random(HashKey({seed, 17}));
  TrackScene scene;
  for (int i = 0; i < num_points; ++i) {
    const double x = random.Uniform(-1.0, 1.0);
    const double y = random.Uniform(-1.0, 1.0);
    scene.points.emplace_back(x, y, random.Uniform(-1.0, 1.0));
  }
  for (int i = 0; i < num_views; ++i) {
    const double angle_deg = arc_deg * (i / (num_views - 1.0) - 0.5);
    const Eigen::Vector3d centre =
        RotationAboutAxis(Eigen::Vector3d::UnitY(), angle_deg) * Eigen::Vector3d(0.0, 0.0, -4.0);
    AddView(LookAt(centre, Eigen::Vector3d::Zero(), {0.0, -1.0, 0.0}),
            static_cast<ImageId>(i + 1),
            scene);
  }
  return scene;
}

// Depths of a view, multiplied by `factor` and by noise of this relative sigma.
inline void ScaleDepths(double factor, double sigma, RandomStream& random, ViewFeatures& view) {
  for (float& depth : view.depths) {
    depth = static_cast<float>(depth * factor * (1.0 + sigma * random.Normal()));
  }
}

// Turns a view about a random axis by an angle of this sigma and moves its centre by `distance`
// (rms); what it sees stays.
inline void MoveView(double sigma_deg, double distance, RandomStream& random, ViewFeatures& view) {
  Rigid3d& cam_from_world = view.view.cam_from_world;
  const Eigen::Vector3d axis = random.NormalVector().normalized();
  const double angle_deg = sigma_deg * random.Normal();
  const Eigen::Vector3d centre =
      OriginInSource(cam_from_world) + distance / std::sqrt(3.0) * random.NormalVector();
  cam_from_world.rotation = RotationAboutAxis(axis, angle_deg) * cam_from_world.rotation;
  cam_from_world.translation = -(cam_from_world.rotation * centre);
}

}  // namespace vgtw
