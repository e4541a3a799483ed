// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_views.h"

#include "bridge/import_loaders.h"
#include "scene/error.h"
#include "scene/network_pixels.h"

#include <algorithm>
#include <utility>

namespace vgtw {
namespace {

// A coarse grid of the point map.
std::vector<Anchor> MakeAnchors(const NetworkGeometry& geometry,
                                const Grid<Eigen::Vector3f>& points) {
  constexpr int kPerSide = 24;
  std::vector<Anchor> anchors;
  if (points.empty()) return anchors;
  const int step_x = std::max(1, points.width() / kPerSide);
  const int step_y = std::max(1, points.height() / kPerSide);
  for (int y = step_y / 2; y < points.height(); y += step_y) {
    for (int x = step_x / 2; x < points.width(); x += step_x) {
      if (!points(x, y).allFinite()) continue;
      const Eigen::Vector2d pixel =
          Apply(geometry.original_from_network, Eigen::Vector2d(x + 0.5, y + 0.5));
      anchors.push_back({points(x, y).cast<double>(), pixel});
    }
  }
  return anchors;
}

}  // namespace

ViewImport::ViewImport(const ImportJob& job, const ViewSink& sink, ImportSummary& summary)
    : job_(job),
      sink_(sink),
      summary_(summary),
      cameras_(job.image_folder, job.photos, job.options.camera_params) {}

void ViewImport::LeaveOut(size_t photo_idx) { bad_views_.push_back(job_.photos[photo_idx].name); }

void ViewImport::Add(size_t photo_idx, NetworkView network_view) {
  const Photo& photo = job_.photos[photo_idx];
  const NetworkGeometry geometry = network_view.geometry.value_or(NetworkGeometry{});
  const std::optional<Camera> camera =
      network_view.intrinsic ? CameraFromNetwork(*network_view.intrinsic, geometry, photo.size)
                             : cameras_.Make(photo);
  if (!camera) return LeaveOut(photo_idx);
  ImportedView imported;
  imported.photo_idx = photo_idx;
  imported.pose = network_view.pose;
  ViewPrediction& prediction = imported.prediction;
  prediction.view.name = photo.name;
  prediction.view.camera = *camera;
  prediction.view.cam_from_world = CamFromWorld(imported.pose, job_.options.repair);
  prediction.depth = std::move(network_view.depth);
  prediction.depth_conf = std::move(network_view.depth_conf);
  prediction.distractor = std::move(network_view.distractor);
  prediction.points = std::move(network_view.points);
  const bool has_maps = !prediction.depth.empty() || !prediction.depth_conf.empty() ||
                        !prediction.distractor.empty() || !prediction.points.empty();
  if (has_maps) {
    prediction.view.network_width = geometry.network_width;
    prediction.view.network_height = geometry.network_height;
    prediction.view.original_from_network = geometry.original_from_network;
  }
  ForgetBars(prediction);
  imported.anchors = MakeAnchors(geometry, prediction.points);
  sink_(std::move(imported));
}

void ViewImport::Finish() {
  if (!bad_views_.empty()) {
    summary_.warnings.push_back(
        std::to_string(bad_views_.size()) +
        " views are left out: their pose or intrinsics are not finite or "
        "have no positive focal length, or their points fit no pinhole camera (first: " +
        Printable(bad_views_.front()) + ")");
  }
  if (const std::string warning = cameras_.Warning(); !warning.empty()) {
    summary_.warnings.push_back(warning);
  }
}

FilePose PoseFromMatrix(const std::filesystem::path& path,
                        const std::string& name,
                        const Eigen::Matrix<double, 3, 4>& matrix,
                        bool is_world_from_cam) {
  const std::optional<Rigid3d> transform = RigidFromMatrix(matrix);
  if (!transform) {
    Fail(path,
         "the 3x3 part of the extrinsic of " + Printable(name) + " is no rotation",
         "[R|t] with R R^T = 1 and determinant +1");
  }
  return {*transform, is_world_from_cam, RotationForm::kMatrix};
}

void CheckOnePerPhoto(const ImportJob& job, size_t num_found, const std::string& what) {
  if (num_found == job.photos.size()) return;
  Fail(job.input_path,
       "holds " + std::to_string(num_found) + " " + what,
       "one for each of the " + std::to_string(job.photos.size()) + " photos",
       "name the folder that the network saw by --image_path");
}

Eigen::Matrix3d MiddleIntrinsics(const Eigen::Vector2d& focal, const MapSize& map_size) {
  return Eigen::Matrix3d{{focal.x(), 0.0, 0.5 * map_size.width},
                         {0.0, focal.y(), 0.5 * map_size.height},
                         {0.0, 0.0, 1.0}};
}

std::vector<MapSize> DefaultDust3rSizes(const ImportJob& job, ImportSummary& summary) {
  std::vector<MapSize> sizes;
  for (const Photo& photo : job.photos) sizes.push_back(DefaultDust3rMapSize(photo.size));
  summary.warnings.push_back(
      "nothing tells the size of the network's images, to which the focal "
      "lengths belong: supposed to be the loader's default, " +
      std::to_string(sizes.front().width) + "x" + std::to_string(sizes.front().height) +
      "; else give them by --camera_params");
  return sizes;
}

void NotePhotosLeftOut(const ImportJob& job, size_t num_read, ImportSummary& summary) {
  if (num_read == job.photos.size()) return;
  summary.notes.push_back(std::to_string(job.photos.size() - num_read) +
                          " photos have no arrays and are left out");
}

}  // namespace vgtw
