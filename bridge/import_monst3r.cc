// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_arrays.h"
#include "bridge/import_loaders.h"
#include "bridge/import_views.h"
#include "bridge/npz.h"
#include "bridge/trajectory_text.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/image_io.h"

#include <cstdio>
#include <optional>
#include <span>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// A folder of MonST3R or Easi3R, frame i = 0, 1, ... by line and by file name:
//   pred_traj.txt         "i tx ty tz qw qx qy qz": world_from_cam, OpenCV axes. It looks like a
//   TUM
//                         trajectory, but its scalar comes first: the writer arranges (w, x, y, z)
//                         and then writes columns in that order.
//   pred_intrinsics.txt   K row by row, in pixels of the maps, 6 decimals; principal point W/2, H/2
//   frame_%04d.npy        [H,W] z-depth (frame_%04d.png beside it is the input image)
//   conf_%d.npy           [H,W] logarithm of the confidence; optional
//   dynamic_mask_%d.png   [H,W] 255 = moving; optional
// Names of photos are not kept: frames are the photos sorted by name, as the loader sorts them.
// Half a pixel is settled as in import_arrays.h: depths belong to pixel centres, K is as it is,
// although DUSt3R unprojects at integer positions with W/2.
// Source: Junyi42/monst3r and Inception3D/Easi3R: demo.py (get_reconstructed_scene),
// dust3r/cloud_opt/base_opt.py (save_*), dust3r/utils/vo_eval.py (save_trajectory_tum_format).
constexpr char kTrajectory[] = "pred_traj.txt";
constexpr char kIntrinsics[] = "pred_intrinsics.txt";
constexpr size_t kMaxBytes = size_t{1} << 28;

std::optional<fs::path> Locate(const fs::path& input_path, const PhotoIndex&) {
  const fs::path folder =
      input_path.filename() == kTrajectory ? input_path.parent_path() : input_path;
  if (!fs::is_regular_file(folder / kTrajectory) || !fs::is_regular_file(folder / kIntrinsics)) {
    return std::nullopt;
  }
  return folder;
}

std::string FrameName(const char* pattern, size_t frame) {
  char name[64];
  std::snprintf(name, sizeof(name), pattern, frame);
  return name;
}

fs::path DepthPath(const fs::path& folder, size_t frame) {
  return folder / FrameName("frame_%04zu.npy", frame);
}
fs::path ConfPath(const fs::path& folder, size_t frame) {
  return folder / FrameName("conf_%zu.npy", frame);
}
fs::path MaskPath(const fs::path& folder, size_t frame) {
  return folder / FrameName("dynamic_mask_%zu.png", frame);
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

void CheckSize(const fs::path& path, const MapSize& size, const MapSize& depth_size) {
  if (size == depth_size) return;
  const auto text = [](const MapSize& map) {
    return std::to_string(map.width) + "x" + std::to_string(map.height);
  };
  Fail(path, "has " + text(size) + " pixels", text(depth_size) + " like the frame's depth");
}

Grid<float> ReadMap(const fs::path& path, const MapSize& depth_size) {
  NpyReader reader = OpenNpyFile(path);
  CheckSize(path, SingleMapSize(reader), depth_size);
  return ReadSingleMap(reader);
}

// Gray values are probabilities in steps of 1/255; the demos write 0 and 255.
DistractorMask ReadMask(const fs::path& path, const MapSize& depth_size) {
  const GrayImage values = ReadMaskValues(path);
  CheckSize(path, {values.width(), values.height()}, depth_size);
  DistractorMask mask(values.width(), values.height());
  for (size_t i = 0; i < values.size(); ++i) {
    mask.data()[i] = static_cast<float>(values.data()[i]) / 255.0f;
  }
  return mask;
}

// Frames that have a file of an optional kind: all or none.
bool HasAll(const fs::path& folder,
            size_t num_frames,
            fs::path (*path_of)(const fs::path&, size_t)) {
  std::optional<size_t> missing;
  size_t num_found = 0;
  for (size_t i = 0; i < num_frames; ++i) {
    if (fs::is_regular_file(path_of(folder, i))) {
      ++num_found;
    } else if (!missing) {
      missing = i;
    }
  }
  if (missing && num_found > 0) {
    Fail(path_of(folder, *missing), "is missing", "such a file for each frame, or for none");
  }
  return num_found > 0;
}

std::vector<MapSize> DepthSizes(const fs::path& folder, size_t num_frames) {
  std::vector<MapSize> sizes;
  for (size_t i = 0; i < num_frames; ++i) {
    sizes.push_back(SingleMapSize(OpenNpyFile(DepthPath(folder, i))));
  }
  return sizes;
}

void Read(const ImportJob& job, const ViewSink& sink, ImportSummary& summary) {
  const fs::path& folder = job.input_path;
  const std::vector<FilePose> poses = ReadPoses(folder / kTrajectory);
  CheckOnePerPhoto(job, poses.size(), "poses");
  const std::vector<Eigen::Matrix3d> intrinsics = ReadIntrinsics(folder / kIntrinsics);
  CheckOnePerPhoto(job, intrinsics.size(), "lines of intrinsics");
  const bool has_conf = HasAll(folder, poses.size(), ConfPath);
  const bool has_masks = HasAll(folder, poses.size(), MaskPath);
  const std::vector<MapSize> sizes = DepthSizes(folder, poses.size());
  const std::vector<NetworkGeometry> geometries =
      ResolveDust3r(folder, job.image_folder, job.photos, sizes, job.options.resize);
  summary.resize =
      job.options.resize == ImportResize::kAuto ? ImportResize::kCrop : job.options.resize;
  ViewImport views(job, sink, summary);
  for (size_t i = 0; i < poses.size(); ++i) {
    NetworkView view;
    view.pose = poses[i];
    view.intrinsic = intrinsics[i];
    view.geometry = geometries[i];
    view.depth = ReadMap(DepthPath(folder, i), sizes[i]);
    ForgetNonPositive(view.depth);
    if (has_conf) view.depth_conf = ReadMap(ConfPath(folder, i), sizes[i]);
    if (has_masks) view.distractor = ReadMask(MaskPath(folder, i), sizes[i]);
    views.Add(i, std::move(view));
  }
  views.Finish();
  summary.notes.emplace_back("the frames were taken for the photos in the order of their names");
  if (!has_masks) summary.notes.emplace_back("no dynamic_mask_*.png: no distractor masks");
}

}  // namespace

const Importer kMonst3rImporter = {ImportFormat::kMonst3r,
                                   "monst3r",
                                   "a folder of MonST3R or Easi3R with pred_traj.txt, "
                                   "pred_intrinsics.txt and frame_*.npy",
                                   Locate,
                                   Read};

}  // namespace vgtw
