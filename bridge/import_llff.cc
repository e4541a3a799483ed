// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_cameras.h"
#include "bridge/importer.h"
#include "bridge/npz.h"
#include "scene/error.h"

#include <array>
#include <cmath>
#include <span>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// poses_bounds.npy of LLFF (Mildenhall et al. 2019): [N,17], rows in the order of the photos.
// A row is a 3x5 matrix [R|c|(height, width, f)], row-major, then the near and far depth. R|c is
// world_from_cam with the columns (down, right, backwards); f is in pixels of height x width.
constexpr size_t kRowLength = 17;
using PoseRow = std::array<double, kRowLength>;

bool HasRows(const NpyReader& reader) {
  return reader.shape().size() == 2 && reader.shape()[1] == kRowLength;
}

std::optional<fs::path> Locate(const fs::path& input_path, const PhotoIndex&) {
  const fs::path file = fs::is_directory(input_path) ? input_path / "poses_bounds.npy" : input_path;
  if (!fs::is_regular_file(file) || file.extension() != ".npy") return std::nullopt;
  if (!HasRows(OpenNpyFile(file))) return std::nullopt;
  return file;
}

FilePose MakePose(const ImportJob& job, size_t row_idx, const PoseRow& row) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 5, Eigen::RowMajor>> matrix(row.data());
  Eigen::Matrix<double, 3, 4> world_from_cam;
  world_from_cam << matrix.col(1), matrix.col(0), -matrix.col(2), matrix.col(3);
  const std::optional<Rigid3d> transform = RigidFromMatrix(world_from_cam);
  if (!transform) {
    Fail(job.input_path,
         "row " + std::to_string(row_idx) + " holds no rotation",
         "columns (down, right, backwards) of unit length");
  }
  return {*transform, /*is_world_from_cam=*/true, RotationForm::kMatrix};
}

Camera MakeCamera(const ImportJob& job, size_t row_idx, const PoseRow& row) {
  const double height = row[4];
  const double width = row[9];
  const double focal_length = row[14];
  const Photo& photo = job.photos[row_idx];
  const auto is_size = [](double value) { return value >= 1.0 && value < 1e6; };
  const bool fits =
      is_size(width) && is_size(height) &&
      IsResized({static_cast<uint64_t>(width), static_cast<uint64_t>(height)}, photo.size) &&
      std::isfinite(focal_length) && focal_length > 0.0;
  if (!fits) {
    Fail(job.input_path,
         "row " + std::to_string(row_idx) + " is for " + std::to_string(width) + " x " +
             std::to_string(height) + " pixels and a focal length of " +
             std::to_string(focal_length) + ", the photo has " + std::to_string(photo.size.width) +
             "x" + std::to_string(photo.size.height),
         "the photo resized with its aspect and a positive focal length");
  }
  Camera camera = MakePinhole(photo.size.width,
                              photo.size.height,
                              focal_length * static_cast<double>(photo.size.width) / width,
                              focal_length * static_cast<double>(photo.size.height) / height);
  camera.has_prior_focal_length = true;
  return camera;
}

void Read(const ImportJob& job, const ViewSink& sink, ImportSummary& summary) {
  NpyReader reader = OpenNpyFile(job.input_path);
  if (!HasRows(reader)) {
    Fail(job.input_path, "has shape " + ShapeText(reader.shape()), "(N, 17)");
  }
  if (reader.shape()[0] != job.photos.size()) {
    Fail(job.input_path,
         "holds " + std::to_string(reader.shape()[0]) + " poses",
         "one for each of the " + std::to_string(job.photos.size()) + " photos, in their order");
  }
  const CameraSource unused(job.image_folder, job.photos, job.options.camera_params);
  if (const std::string warning = unused.Warning(); !warning.empty()) {
    summary.warnings.push_back(warning);
  }
  PoseRow row{};
  for (size_t i = 0; i < job.photos.size(); ++i) {
    reader.Read(std::span<double>(row));
    ImportedView imported;
    imported.photo_idx = i;
    imported.pose = MakePose(job, i, row);
    imported.prediction.view.name = job.photos[i].name;
    imported.prediction.view.camera = MakeCamera(job, i, row);
    imported.prediction.view.cam_from_world = CamFromWorld(imported.pose, job.options.repair);
    sink(std::move(imported));
  }
  summary.notes.emplace_back(
      "poses_bounds.npy knows no distortion and no principal point: PINHOLE, centred");
}

}  // namespace

const Importer kLlffImporter = {
    ImportFormat::kLlff, "llff", "poses_bounds.npy of LLFF", Locate, Read};

}  // namespace vgtw
