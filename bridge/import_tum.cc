// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_tum.h"

#include "bridge/import_cameras.h"
#include "bridge/importer.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxBytes = size_t{1} << 30;
constexpr size_t kNumNumbers = 7;  // tx ty tz qx qy qz qw
constexpr std::string_view kSpace = " \t\r,";

std::string_view Trim(std::string_view text) {
  const size_t begin = text.find_first_not_of(kSpace);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kSpace) - begin + 1);
}

std::optional<double> ParseNumber(std::string_view token) {
  if (token.starts_with('+')) token.remove_prefix(1);
  double value = 0.0;
  const auto [end, code] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (code != std::errc() || end != token.data() + token.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::optional<TumPose> ParseLine(std::string_view line) {
  std::array<double, kNumNumbers> numbers{};
  std::string_view rest = Trim(line);
  for (size_t i = kNumNumbers; i-- > 0;) {
    const size_t space = rest.find_last_of(kSpace);
    if (space == std::string_view::npos) return std::nullopt;
    const std::optional<double> number = ParseNumber(rest.substr(space + 1));
    if (!number) return std::nullopt;
    numbers[i] = *number;
    rest = Trim(rest.substr(0, space));
  }
  const auto& [tx, ty, tz, qx, qy, qz, qw] = numbers;
  const Eigen::Quaterniond rotation(qw, qx, qy, qz);
  constexpr double kMaxNormError = 1e-2;
  if (rest.empty() || !(std::abs(rotation.norm() - 1.0) < kMaxNormError)) return std::nullopt;
  return TumPose{std::string(rest), {rotation.normalized(), {tx, ty, tz}}};
}

// A line that is neither empty nor a comment.
bool HoldsPose(std::string_view line) {
  const std::string_view trimmed = Trim(line);
  return !trimmed.empty() && !trimmed.starts_with('#');
}

std::optional<fs::path> Locate(const fs::path& input_path, const PhotoIndex&) {
  constexpr size_t kProbeBytes = 1 << 16;
  if (!fs::is_regular_file(input_path)) return std::nullopt;
  const MappedFile file(input_path);
  std::string_view text(reinterpret_cast<const char*>(file.bytes().data()),
                        std::min(kProbeBytes, file.bytes().size()));
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    if (HoldsPose(line)) return ParseLine(line) ? std::optional(input_path) : std::nullopt;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return std::nullopt;
}

// Photo of each pose: by name if every label means a photo, else in order of the timestamps.
std::vector<size_t> MatchPhotos(const ImportJob& job, const std::vector<TumPose>& poses) {
  const PhotoIndex index(job.photos);
  std::vector<std::string> labels;
  for (const TumPose& pose : poses) labels.push_back(pose.label);
  const auto is_number = [](const std::string& label) { return ParseNumber(label).has_value(); };
  const auto is_photo = [&](const std::string& label) {
    return index.Find(label, true).has_value();
  };
  if (!std::all_of(labels.begin(), labels.end(), is_number) ||
      std::all_of(labels.begin(), labels.end(), is_photo)) {
    return index.FindAll(job.input_path, labels, true);
  }
  const auto decreasing =
      std::adjacent_find(labels.begin(), labels.end(), [](const auto& a, const auto& b) {
        return *ParseNumber(a) >= *ParseNumber(b);
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

std::vector<TumPose> ParseTumTrajectory(std::string_view text, const std::string& origin) {
  std::vector<TumPose> poses;
  for (size_t line_number = 1; !text.empty(); ++line_number) {
    const size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    if (HoldsPose(line)) {
      std::optional<TumPose> pose = ParseLine(line);
      if (!pose) {
        Fail(origin,
             "line " + std::to_string(line_number) + " is '" + Printable(line) + "'",
             "\"timestamp tx ty tz qx qy qz qw\" with a unit quaternion");
      }
      poses.push_back(*std::move(pose));
    }
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  if (poses.empty()) Fail(origin, "holds no pose", "lines \"timestamp tx ty tz qx qy qz qw\"");
  return poses;
}

const Importer kTumImporter = {ImportFormat::kTum,
                               "tum",
                               "a trajectory \"timestamp tx ty tz qx qy qz qw\" (camera to world)",
                               Locate,
                               Read};

}  // namespace vgtw
