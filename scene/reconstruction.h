// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"
#include "scene/rigid3d.h"

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

using CameraId = uint32_t;
using ImageId = uint32_t;
using RigId = uint32_t;
using FrameId = uint32_t;
using Point3DId = uint64_t;
inline constexpr Point3DId kInvalidPoint3DId = std::numeric_limits<Point3DId>::max();

struct Point2D {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();  // original pixels
  Point3DId point3D_id = kInvalidPoint3DId;

  bool HasPoint3D() const { return point3D_id != kInvalidPoint3DId; }
  bool operator==(const Point2D&) const = default;
};

struct Image {
  ImageId image_id = 0;
  CameraId camera_id = 0;
  std::string name;
  Rigid3d cam_from_world;
  std::vector<Point2D> points2D;  // point2D_idx = row of the database's keypoints
};

struct TrackElement {
  ImageId image_id = 0;
  uint32_t point2D_idx = 0;
  auto operator<=>(const TrackElement&) const = default;
};

struct Point3D {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  std::array<uint8_t, 3> rgb = {0, 0, 0};
  double error = -1.0;  // mean reprojection error in pixels, -1 = not computed
  std::vector<TrackElement> track;
};

// A sensor of COLMAP >= 3.12; type 0 is a camera.
struct SensorId {
  int32_t type = 0;
  uint32_t id = 0;
  auto operator<=>(const SensorId&) const = default;
};

struct Rig {
  RigId rig_id = 0;
  SensorId reference;
  std::map<SensorId, std::optional<Rigid3d>> sensor_from_rig;  // without the reference
};

struct FrameData {
  SensorId sensor;
  uint64_t data_id = 0;  // image_id for cameras
};

struct Frame {
  FrameId frame_id = 0;
  RigId rig_id = 0;
  Rigid3d rig_from_world;
  std::vector<FrameData> data;
};

// A sparse model as COLMAP stores it. Ids are those of the database it belongs to.
// Law (FindFault): keys equal the ids inside; every image has a camera; points2D and tracks name
// each other. rigs and frames are both empty (models before 3.12) or cover every image.
struct Reconstruction {
  std::map<CameraId, Camera> cameras;
  std::map<ImageId, Image> images;
  std::map<Point3DId, Point3D> points3D;
  std::map<RigId, Rig> rigs;
  std::map<FrameId, Frame> frames;
};

// The first violation of the law above, in words, or "".
std::string FindFault(const Reconstruction& reconstruction);

// Makes frames agree with the images' poses after these were changed. Frames of rigs with a single
// sensor take the image's pose; if any rig has more sensors, rigs and frames are dropped, because
// freely moved images no longer form that rig.
void UpdateFrames(Reconstruction& reconstruction);

void RemovePoint3D(Reconstruction& reconstruction, Point3DId point3D_id);

// Removes one observation; the point goes with it when fewer than two remain.
void RemoveObservation(Reconstruction& reconstruction, const TrackElement& observation);

std::map<std::string, Rigid3d> CamFromWorldByName(const Reconstruction& reconstruction);

}  // namespace vgtw
