// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/pose_files.h"

#include "bridge/colmap_model.h"
#include "bridge/import_poses.h"
#include "bridge/photo_order.h"
#include "bridge/predictions.h"
#include "bridge/trajectory_text.h"
#include "bridge/transforms_json.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxBytes = size_t{1} << 30;
constexpr char kKnown[] =
    "a COLMAP model, a predictions folder, transforms.json, or a trajectory of TUM or KITTI";

struct NamedFilePose {
  std::string name;
  FilePose pose;
};

std::vector<NamedFilePose> ReadColmap(const fs::path& folder) {
  std::vector<NamedFilePose> poses;
  for (const auto& [name, cam_from_world] : CamFromWorldByName(ReadModel(folder))) {
    poses.push_back({name, {cam_from_world, false, RotationForm::kQuaternionWxyz}});
  }
  return poses;
}

std::vector<NamedFilePose> ReadPredictions(const fs::path& folder) {
  std::vector<NamedFilePose> poses;
  const PredictionReader predictions(folder);
  for (const View& view : predictions.views()) {
    poses.push_back({view.name, {view.cam_from_world, false, RotationForm::kQuaternionWxyz}});
  }
  return poses;
}

std::vector<NamedFilePose> ReadTransforms(std::string_view text, const fs::path& path) {
  std::vector<NamedFilePose> poses;
  for (TransformsFrame& frame : ParseTransformsJson(text, path.string())) {
    poses.push_back({std::move(frame.name), {frame.world_from_cam, true, RotationForm::kMatrix}});
  }
  return poses;
}

std::vector<NamedFilePose> ReadTum(std::string_view text, const fs::path& path) {
  std::vector<NamedFilePose> poses;
  for (TumPose& pose : ParseTumTrajectory(text, path.string())) {
    poses.push_back(
        {std::move(pose.label), {pose.world_from_cam, true, RotationForm::kQuaternionXyzw}});
  }
  return poses;
}

std::vector<NamedFilePose> ReadKitti(std::string_view text, const fs::path& path) {
  std::vector<NamedFilePose> poses;
  for (const Rigid3d& world_from_cam : ParseKittiTrajectory(text, path.string())) {
    poses.push_back({std::to_string(poses.size()), {world_from_cam, true, RotationForm::kMatrix}});
  }
  return poses;
}

bool IsJson(std::string_view text) {
  const size_t begin = text.find_first_not_of(" \t\r\n");
  return begin != std::string_view::npos && text[begin] == '{';
}

// As the file has them.
std::vector<NamedFilePose> ReadFilePoses(const fs::path& path, PoseFormat& format) {
  if (IsModelFolder(path)) {
    format = PoseFormat::kColmap;
    return ReadColmap(path);
  }
  if (fs::exists(path / "predictions.json")) {
    format = PoseFormat::kPredictions;
    return ReadPredictions(path);
  }
  if (!fs::exists(path)) Fail(path, "does not exist", kKnown);
  const fs::path file = fs::is_directory(path) ? path / "transforms.json" : path;
  if (!fs::is_regular_file(file)) Fail(path, "is none of the known forms of poses", kKnown);
  const std::string text = ReadFile(file, kMaxBytes);
  if (IsJson(text)) {
    format = PoseFormat::kTransforms;
    return ReadTransforms(text, file);
  }
  const std::optional<TrajectoryFormat> trajectory = FindTrajectoryFormat(text);
  if (!trajectory) Fail(path, "is none of the known forms of poses", kKnown);
  const bool is_tum = *trajectory == TrajectoryFormat::kTum;
  format = is_tum ? PoseFormat::kTum : PoseFormat::kKitti;
  return is_tum ? ReadTum(text, file) : ReadKitti(text, file);
}

PoseKey KeyOf(PoseFormat format, const std::vector<NamedFilePose>& poses) {
  if (format == PoseFormat::kKitti) return PoseKey::kLine;
  const bool are_times =
      format == PoseFormat::kTum && std::all_of(poses.begin(), poses.end(), [](const auto& pose) {
        return ParseTimestamp(pose.name).has_value();
      });
  return are_times ? PoseKey::kTimestamp : PoseKey::kImageName;
}

void Sort(PoseSet& set) {
  if (set.key == PoseKey::kLine) return;
  std::vector<NamedPose> sorted;
  if (set.key == PoseKey::kImageName) {
    std::vector<std::string> names;
    for (const NamedPose& pose : set.poses) names.push_back(pose.name);
    for (const size_t idx : NaturalOrder(names)) sorted.push_back(std::move(set.poses[idx]));
  } else {
    std::vector<std::pair<double, size_t>> order;
    for (const NamedPose& pose : set.poses) {
      order.emplace_back(*ParseTimestamp(pose.name), order.size());
    }
    std::sort(order.begin(), order.end());
    for (const auto& [time_sec, idx] : order) {
      set.times_sec.push_back(time_sec);
      sorted.push_back(std::move(set.poses[idx]));
    }
  }
  set.poses = std::move(sorted);
}

void CheckUnique(const PoseSet& set) {
  std::vector<std::string> names;
  for (const NamedPose& pose : set.poses) names.push_back(pose.name);
  std::sort(names.begin(), names.end());
  const auto repeated = std::adjacent_find(names.begin(), names.end());
  if (repeated != names.end()) {
    Fail(set.path, "has a pose of '" + Printable(*repeated) + "' twice", "each once");
  }
  const auto same_time = std::adjacent_find(set.times_sec.begin(), set.times_sec.end());
  if (same_time != set.times_sec.end()) {
    Fail(set.path, "has two poses of the time " + std::to_string(*same_time), "each time once");
  }
}

}  // namespace

std::string_view Name(PoseFormat format) {
  switch (format) {
    case PoseFormat::kColmap:
      return "a COLMAP model";
    case PoseFormat::kPredictions:
      return "a predictions folder";
    case PoseFormat::kTransforms:
      return "transforms.json";
    case PoseFormat::kTum:
      return "a TUM trajectory";
    case PoseFormat::kKitti:
      break;
  }
  return "a KITTI trajectory";
}

std::string_view OrderName(PoseKey key) {
  switch (key) {
    case PoseKey::kImageName:
      return "names";
    case PoseKey::kTimestamp:
      return "timestamps";
    case PoseKey::kLine:
      break;
  }
  return "lines";
}

PoseSet ReadPoseSet(const fs::path& path, const ConventionRepair& repair) {
  PoseSet set;
  set.path = path;
  const std::vector<NamedFilePose> read = ReadFilePoses(path, set.format);
  set.key = KeyOf(set.format, read);
  for (const NamedFilePose& file_pose : read) {
    if (repair.swap_quaternion_order && file_pose.pose.form == RotationForm::kMatrix) {
      Fail(path,
           "holds rotations as matrices",
           "quaternions to swap",
           "leave --swap_quaternion_order out");
    }
    set.poses.push_back({file_pose.name, CamFromWorld(file_pose.pose, repair)});
  }
  Sort(set);
  CheckUnique(set);
  return set;
}

std::map<std::string, Rigid3d> ReadPoses(const fs::path& path) {
  PoseSet set = ReadPoseSet(path);
  if (set.key != PoseKey::kImageName) {
    Fail(path,
         "is " + std::string(Name(set.format)) + " without image names",
         "poses by image name",
         "write image names in the first column of a TUM trajectory");
  }
  std::map<std::string, Rigid3d> poses;
  for (NamedPose& pose : set.poses) poses[std::move(pose.name)] = pose.cam_from_world;
  return poses;
}

}  // namespace vgtw
