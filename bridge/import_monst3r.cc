// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_arrays.h"
#include "bridge/import_frames.h"
#include "bridge/import_loaders.h"
#include "bridge/import_views.h"
#include "bridge/trajectory_text.h"
#include "scene/error.h"
#include "scene/files.h"

#include <optional>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// A folder of MonST3R or Easi3R, or of CUT3R's evaluation, which writes no maps; frame i = 0, 1,
// ... by line and by file name:
//   pred_traj.txt         "i tx ty tz qw qx qy qz": world_from_cam, OpenCV axes. It looks like a
//                         TUM trajectory, but its scalar comes first: the writer arranges
//                         (w, x, y, z) and then writes columns in that order.
//   pred_intrinsics.txt   K row by row, in pixels of the maps, 6 decimals; principal point W/2, H/2
//   pred_focal.txt        its focal lengths alone; read where pred_intrinsics.txt is absent
//   frame_%04d.npy        [H,W] z-depth (frame_%04d.png beside it is the input image); optional
//   conf_%d.npy           [H,W] confidence, with MonST3R its logarithm; optional
//   dynamic_mask_%d.png   [H,W] 255 = moving; optional
// Names of photos are not kept: frames are the photos sorted by name, as the loader sorts them.
// Half a pixel is settled as in import_arrays.h: depths belong to pixel centres, K is as it is,
// although DUSt3R unprojects at integer positions with W/2.
// Source: Junyi42/monst3r and Inception3D/Easi3R: demo.py (get_reconstructed_scene),
// dust3r/cloud_opt/base_opt.py (save_*), dust3r/utils/vo_eval.py (save_trajectory_tum_format);
// CUT3R/CUT3R: eval/relpose/{launch,utils,evo_utils}.py.
constexpr char kTrajectory[] = "pred_traj.txt";
constexpr char kIntrinsics[] = "pred_intrinsics.txt";
constexpr char kFocals[] = "pred_focal.txt";
constexpr size_t kMaxBytes = size_t{1} << 28;

struct Folder {
  explicit Folder(const fs::path& folder)
      : path(folder),
        depth{folder, "frame_", 4, ".npy"},
        conf{folder, "conf_", 1, ".npy"},
        mask{folder, "dynamic_mask_", 1, ".png"} {}
  fs::path path;
  FrameFiles depth;
  FrameFiles conf;
  FrameFiles mask;
};

std::optional<fs::path> Locate(const fs::path& input_path, const PhotoIndex&) {
  const fs::path folder =
      input_path.filename() == kTrajectory ? input_path.parent_path() : input_path;
  if (!fs::is_regular_file(folder / kTrajectory)) return std::nullopt;
  return folder;
}

// The scalar comes first in the file, last where the TUM parser looks for it.
std::vector<FilePose> ReadPoses(const fs::path& path) {
  std::vector<FilePose> poses;
  for (const TumPose& pose : ParseTumTrajectory(ReadFile(path, kMaxBytes), path.string())) {
    const Eigen::Quaterniond& read = pose.world_from_cam.rotation;
    const Eigen::Quaterniond rotation(read.x(), read.y(), read.z(), read.w());
    poses.push_back({{rotation, pose.world_from_cam.translation},
                     /*is_world_from_cam=*/true,
                     RotationForm::kQuaternionWxyz});
  }
  return poses;
}

std::vector<Eigen::Matrix3d> ReadIntrinsics(const fs::path& path) {
  std::vector<Eigen::Matrix3d> intrinsics;
  for (const auto& row : ParseNumberRows(ReadFile(path, kMaxBytes), 9, path.string())) {
    intrinsics.emplace_back(
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(row.data()));
  }
  return intrinsics;
}

// What is known of the network's images; each is empty where nothing tells it.
struct NetworkCameras {
  std::vector<MapSize> sizes;
  std::vector<Eigen::Matrix3d> intrinsics;
};

std::vector<MapSize> SizesOfMaps(const Folder& folder, size_t num_frames) {
  if (folder.depth.HaveAll(num_frames)) return FrameSizes(folder.depth, num_frames);
  if (folder.conf.HaveAll(num_frames)) return FrameSizes(folder.conf, num_frames);
  return {};
}

NetworkCameras CamerasOfMatrices(const ImportJob& job,
                                 const fs::path& path,
                                 std::vector<MapSize> sizes) {
  NetworkCameras cameras{std::move(sizes), ReadIntrinsics(path)};
  CheckOnePerPhoto(job, cameras.intrinsics.size(), "lines of intrinsics");
  if (!cameras.sizes.empty()) return cameras;
  for (size_t i = 0; i < cameras.intrinsics.size(); ++i) {
    cameras.sizes.push_back(
        MapSizeFromMiddle(path, i, cameras.intrinsics[i].topRightCorner<2, 1>()));
  }
  return cameras;
}

NetworkCameras CamerasOfFocals(const ImportJob& job,
                               const fs::path& path,
                               std::vector<MapSize> sizes,
                               ImportSummary& summary) {
  const auto focals = ParseNumberRows(ReadFile(path, kMaxBytes), 1, path.string());
  CheckOnePerPhoto(job, focals.size(), "focal lengths");
  if (sizes.empty()) sizes = DefaultDust3rSizes(job, summary);
  NetworkCameras cameras{std::move(sizes), {}};
  for (size_t i = 0; i < focals.size(); ++i) {
    cameras.intrinsics.push_back(MiddleIntrinsics({focals[i][0], focals[i][0]}, cameras.sizes[i]));
  }
  return cameras;
}

NetworkCameras ReadCameras(const ImportJob& job, const Folder& folder, ImportSummary& summary) {
  std::vector<MapSize> sizes = SizesOfMaps(folder, job.photos.size());
  if (fs::is_regular_file(folder.path / kIntrinsics)) {
    return CamerasOfMatrices(job, folder.path / kIntrinsics, std::move(sizes));
  }
  if (job.options.camera_params.empty() && fs::is_regular_file(folder.path / kFocals)) {
    return CamerasOfFocals(job, folder.path / kFocals, std::move(sizes), summary);
  }
  return {std::move(sizes), {}};
}

void AddNotes(const ImportJob& job, bool has_masks, ImportSummary& summary) {
  summary.notes.emplace_back("the frames were taken for the photos in the order of their names");
  if (!has_masks) summary.notes.emplace_back("no dynamic_mask_*.png: no distractor masks");
  const Folder folder(job.input_path);
  if (fs::exists(folder.path / kIntrinsics) || fs::exists(folder.path / kFocals)) return;
  if (fs::exists(folder.depth.Path(0))) return;
  summary.notes.emplace_back(
      "the quaternions were read scalar first, as MonST3R and CUT3R write pred_traj.txt; "
      "--swap_quaternion_order reads them scalar last");
}

void Read(const ImportJob& job, const ViewSink& sink, ImportSummary& summary) {
  const Folder folder(job.input_path);
  const std::vector<FilePose> poses = ReadPoses(folder.path / kTrajectory);
  CheckOnePerPhoto(job, poses.size(), "poses");
  const bool has_depth = folder.depth.HaveAll(poses.size());
  const bool has_conf = folder.conf.HaveAll(poses.size());
  const bool has_masks = folder.mask.HaveAll(poses.size());
  const NetworkCameras cameras = ReadCameras(job, folder, summary);
  if (has_masks && cameras.sizes.empty()) {
    Fail(folder.mask.Path(0), "stands alone", "frame_*.npy or pred_intrinsics.txt beside it");
  }
  std::vector<NetworkGeometry> geometries;
  if (!cameras.sizes.empty()) {
    geometries =
        ResolveDust3r(folder.path, job.image_folder, job.photos, cameras.sizes, job.options.resize);
    summary.resize =
        job.options.resize == ImportResize::kAuto ? ImportResize::kCrop : job.options.resize;
  }
  ViewImport views(job, sink, summary);
  for (size_t i = 0; i < poses.size(); ++i) {
    NetworkView view;
    view.pose = poses[i];
    if (!cameras.intrinsics.empty()) view.intrinsic = cameras.intrinsics[i];
    if (!geometries.empty()) view.geometry = geometries[i];
    if (has_depth) view.depth = ReadFrameMap(folder.depth.Path(i), cameras.sizes[i]);
    ForgetNonPositive(view.depth);
    if (has_conf) view.depth_conf = ReadFrameMap(folder.conf.Path(i), cameras.sizes[i]);
    if (has_masks) view.distractor = ReadFrameMask(folder.mask.Path(i), cameras.sizes[i]);
    views.Add(i, std::move(view));
  }
  views.Finish();
  AddNotes(job, has_masks, summary);
}

}  // namespace

const Importer kMonst3rImporter = {ImportFormat::kMonst3r,
                                   "monst3r",
                                   "a folder of MonST3R, Easi3R or CUT3R's evaluation with "
                                   "pred_traj.txt (and pred_intrinsics.txt, frame_*.npy)",
                                   Locate,
                                   Read,
                                   &kTumImporter};

}  // namespace vgtw
