// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/import_arrays.h"
#include "bridge/import_cameras.h"
#include "bridge/importer.h"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// What a file says of one photo: pose, and optionally intrinsics and maps in network pixels.
struct NetworkView {
  FilePose pose;
  std::optional<Eigen::Matrix3d> intrinsic;  // without one the camera comes from CameraSource
  std::optional<NetworkGeometry> geometry;   // needed where there are intrinsics or maps
  DepthMap depth;
  ConfidenceMap depth_conf;
  DistractorMask distractor;
  Grid<Eigen::Vector3f> points;
};

// Turns what networks say of photos into views in original pixels, and counts what it must leave
// out. Bars and padding become unknown.
class ViewImport {
 public:
  ViewImport(const ImportJob& job, const ViewSink& sink, ImportSummary& summary);

  // Views whose pose or intrinsics are not usable are left out and counted.
  void Add(size_t photo_idx, NetworkView network_view);

  // A photo whose pose is not finite.
  void LeaveOut(size_t photo_idx);

  // Adds the warnings.
  void Finish();

 private:
  const ImportJob& job_;
  const ViewSink& sink_;
  ImportSummary& summary_;
  CameraSource cameras_;
  std::vector<std::string> bad_views_;
};

// Pose of a matrix [R|t]. Throws Error naming `path` and `name` if R is no rotation.
FilePose PoseFromMatrix(const std::filesystem::path& path,
                        const std::string& name,
                        const Eigen::Matrix<double, 3, 4>& matrix,
                        bool is_world_from_cam);

// Throws Error unless there is one of `what` ("poses") for each photo. For formats that know no
// names: their frames are the photos in the order of their names.
void CheckOnePerPhoto(const ImportJob& job, size_t num_found, const std::string& what);

// Intrinsics in pixels of a map whose principal point is its middle.
Eigen::Matrix3d MiddleIntrinsics(const Eigen::Vector2d& focal, const MapSize& map_size);

// What DUSt3R's loader makes of the photos at its default size; adds the warning that it is a
// guess. For focal lengths in network pixels without anything that tells the network's size.
std::vector<MapSize> DefaultDust3rSizes(const ImportJob& job, ImportSummary& summary);

// Adds how many photos had nothing to read, if any.
void NotePhotosLeftOut(const ImportJob& job, size_t num_read, ImportSummary& summary);

}  // namespace vgtw
