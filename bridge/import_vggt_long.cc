// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_geometry.h"
#include "bridge/import_views.h"
#include "bridge/trajectory_text.h"
#include "scene/error.h"
#include "scene/files.h"

#include <optional>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// VGGT-Long's results for a sequence, one line a photo in the order of the photos' names:
//   camera_poses.txt   a 4x4 matrix row by row: world_from_cam, OpenCV axes
//   intrinsic.txt      "fx fy cx cy" in pixels of the network; absent with pi3 as its base
// No size is written, but VGGT's head always says cx = W/2, cy = H/2, so that it is told by them.
// Source: DengKaiCQ/VGGT-Long: vggt_long.py (save_camera_poses), base_models/base_model.py.
constexpr char kPoses[] = "camera_poses.txt";
constexpr char kIntrinsics[] = "intrinsic.txt";
constexpr size_t kMaxBytes = size_t{1} << 28;

std::optional<fs::path> Locate(const fs::path& input_path, const PhotoIndex&) {
  const fs::path folder = input_path.filename() == kPoses ? input_path.parent_path() : input_path;
  if (!fs::is_regular_file(folder / kPoses)) return std::nullopt;
  return folder;
}

std::vector<FilePose> ReadPoses(const ImportJob& job, const fs::path& path) {
  const auto rows = ParseNumberRows(ReadFile(path, kMaxBytes), 16, path.string());
  CheckOnePerPhoto(job, rows.size(), "poses");
  std::vector<FilePose> poses;
  for (size_t i = 0; i < rows.size(); ++i) {
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(rows[i].data());
    if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
      Fail(path, "matrix " + std::to_string(i) + " has another last row", "0 0 0 1");
    }
    poses.push_back(
        PoseFromMatrix(path, job.photos[i].name, matrix.topRows<3>(), /*is_world_from_cam=*/true));
  }
  return poses;
}

struct NetworkCameras {
  std::vector<Eigen::Matrix3d> intrinsics;
  std::vector<NetworkGeometry> geometries;
};

NetworkCameras ReadCameras(const ImportJob& job, const fs::path& path, ImportSummary& summary) {
  const auto rows = ParseNumberRows(ReadFile(path, kMaxBytes), 4, path.string());
  CheckOnePerPhoto(job, rows.size(), "lines of intrinsics");
  NetworkCameras cameras;
  std::vector<ImageSize> photo_sizes;
  std::vector<MapSize> map_sizes;
  for (size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& row = rows[i];
    Eigen::Matrix3d intrinsic;
    intrinsic << row[0], 0.0, row[2], 0.0, row[1], row[3], 0.0, 0.0, 1.0;
    cameras.intrinsics.push_back(intrinsic);
    map_sizes.push_back(MapSizeFromMiddle(path, i, {row[2], row[3]}));
    photo_sizes.push_back(job.photos[i].size);
  }
  ResolvedResize resolved = ResolveResize(path, photo_sizes, map_sizes, job.options.resize);
  summary.resize = resolved.resize;
  if (!resolved.warning.empty()) summary.warnings.push_back(resolved.warning);
  cameras.geometries = std::move(resolved.geometries);
  return cameras;
}

void Read(const ImportJob& job, const ViewSink& sink, ImportSummary& summary) {
  const std::vector<FilePose> poses = ReadPoses(job, job.input_path / kPoses);
  const fs::path intrinsics_path = job.input_path / kIntrinsics;
  std::optional<NetworkCameras> cameras;
  if (job.options.camera_params.empty() && fs::exists(intrinsics_path)) {
    cameras = ReadCameras(job, intrinsics_path, summary);
  }
  ViewImport views(job, sink, summary);
  for (size_t i = 0; i < poses.size(); ++i) {
    NetworkView view;
    view.pose = poses[i];
    if (cameras) {
      view.intrinsic = cameras->intrinsics[i];
      view.geometry = cameras->geometries[i];
    }
    views.Add(i, std::move(view));
  }
  views.Finish();
  summary.notes.emplace_back("the poses were taken for the photos in the order of their names");
}

}  // namespace

const Importer kVggtLongImporter = {ImportFormat::kVggtLong,
                                    "vggt_long",
                                    "camera_poses.txt (and intrinsic.txt) of VGGT-Long",
                                    Locate,
                                    Read};

}  // namespace vgtw
