// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_cameras.h"
#include "bridge/importer.h"
#include "bridge/trajectory_text.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxBytes = size_t{1} << 30;

std::optional<fs::path> Locate(const fs::path& input_path, const PhotoIndex&) {
  constexpr size_t kProbeBytes = 1 << 16;
  if (!fs::is_regular_file(input_path)) return std::nullopt;
  const MappedFile file(input_path);
  const std::string_view text(reinterpret_cast<const char*>(file.bytes().data()),
                              std::min(kProbeBytes, file.bytes().size()));
  if (FindTrajectoryFormat(text) != TrajectoryFormat::kTum) return std::nullopt;
  return input_path;
}

// Photo of each pose: by name if every label means a photo, else in order of the timestamps.
std::vector<size_t> MatchPhotos(const ImportJob& job, const std::vector<TumPose>& poses) {
  const PhotoIndex index(job.photos);
  std::vector<std::string> labels;
  for (const TumPose& pose : poses) labels.push_back(pose.label);
  const auto is_number = [](const std::string& label) { return ParseTimestamp(label).has_value(); };
  const auto is_photo = [&](const std::string& label) {
    return index.Find(label, true).has_value();
  };
  if (!std::all_of(labels.begin(), labels.end(), is_number) ||
      std::all_of(labels.begin(), labels.end(), is_photo)) {
    return index.FindAll(job.input_path, labels, true);
  }
  const auto decreasing =
      std::adjacent_find(labels.begin(), labels.end(), [](const auto& a, const auto& b) {
        return *ParseTimestamp(a) >= *ParseTimestamp(b);
      });
  if (decreasing != labels.end()) {
    Fail(job.input_path,
         "timestamp " + Printable(*std::next(decreasing)) + " follows " + Printable(*decreasing),
         "increasing timestamps, which name the photos in their order",
         "write image names in the first column");
  }
  if (poses.size() != job.photos.size()) {
    Fail(job.input_path,
         "holds " + std::to_string(poses.size()) + " poses with timestamps",
         "one for each of the " + std::to_string(job.photos.size()) + " photos, in their order",
         "write image names in the first column");
  }
  std::vector<size_t> in_order(poses.size());
  for (size_t i = 0; i < in_order.size(); ++i) in_order[i] = i;
  return in_order;
}

void Read(const ImportJob& job, const ViewSink& sink, ImportSummary& summary) {
  const std::vector<TumPose> poses =
      ParseTumTrajectory(ReadFile(job.input_path, kMaxBytes), job.input_path.string());
  const std::vector<size_t> photo_indices = MatchPhotos(job, poses);
  CameraSource cameras(job.image_folder, job.photos, job.options.camera_params);
  for (size_t i = 0; i < poses.size(); ++i) {
    const Photo& photo = job.photos[photo_indices[i]];
    ImportedView imported;
    imported.photo_idx = photo_indices[i];
    imported.pose = {poses[i].world_from_cam, true, RotationForm::kQuaternionXyzw};
    imported.prediction.view.name = photo.name;
    imported.prediction.view.camera = cameras.Make(photo);
    imported.prediction.view.cam_from_world = CamFromWorld(imported.pose, job.options.repair);
    sink(std::move(imported));
  }
  if (const std::string warning = cameras.Warning(); !warning.empty()) {
    summary.warnings.push_back(warning);
  }
  if (poses.size() < job.photos.size()) {
    summary.notes.push_back(std::to_string(job.photos.size() - poses.size()) +
                            " photos have no pose and are left out");
  }
}

}  // namespace

const Importer kTumImporter = {ImportFormat::kTum,
                               "tum",
                               "a trajectory \"timestamp tx ty tz qx qy qz qw\" (camera to world)",
                               Locate,
                               Read};

}  // namespace vgtw
