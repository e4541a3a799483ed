// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model.h"
#include "bridge/import_cameras.h"
#include "bridge/import_loaders.h"
#include "bridge/importer.h"
#include "scene/error.h"
#include "scene/reconstruction.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// VGGT's demo_colmap.py adds a constant to points2D of images that are not square: it takes the bar
// measured at 1024 pixels from coordinates at 518. Projections are exact otherwise (1e-4 px), so
// that a constant residual without spread is no error of the poses.
constexpr double kMinShiftPx = 0.5;
constexpr double kMaxShiftSpreadPx = 0.05;
constexpr size_t kMinShiftObservations = 10;

std::optional<fs::path> Locate(const fs::path& input_path, const PhotoIndex&) {
  for (const char* inside : {"", "sparse", "sparse/0"}) {
    const fs::path folder = inside[0] == '\0' ? input_path : input_path / inside;
    if (IsModelFolder(folder)) return folder;
  }
  return std::nullopt;
}

std::string SizeText(const ImageSize& size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

// What a model says of a photo, in the photo's own pixels.
struct Placement {
  Camera camera;
  PixelMap original_from_model = IdentityPixelMap();
};

Placement RescaleToPhoto(const fs::path& path, const Camera& camera, const Photo& photo) {
  const ImageSize model_size = {camera.width, camera.height};
  if (model_size == photo.size) return {camera};
  if (!IsResized(model_size, photo.size)) {
    Fail(path,
         "the camera of " + Printable(photo.name) + " is for " + SizeText(model_size) +
             " pixels but the photo has " + SizeText(photo.size),
         "the photo resized with its aspect",
         "undo crops and rotations (EXIF orientation), name the model's photos by --image_path, or "
         "say --resize crop if MapAnything cut them");
  }
  Placement placement{Rescale(camera, photo.size.width, photo.size.height)};
  placement.original_from_model.leftCols<2>() =
      Eigen::Vector2d(static_cast<double>(photo.size.width) / static_cast<double>(camera.width),
                      static_cast<double>(photo.size.height) / static_cast<double>(camera.height))
          .asDiagonal();
  return placement;
}

// MapAnything's demo_colmap.py writes cameras of the cut and resized images that it saves beside
// sparse/ under the photos' names. Source: facebookresearch/map-anything: scripts/demo_colmap.py,
// mapanything/utils/colmap_export.py.
Placement UndoCrop(const ImportJob& job, const Camera& camera, const Photo& photo) {
  const MapSize model_size = {static_cast<int>(camera.width), static_cast<int>(camera.height)};
  const NetworkGeometry geometry =
      ResolveMapAnything(job.input_path, job.image_folder, {photo}, model_size).front();
  const Eigen::Vector2d scale = geometry.original_from_network.leftCols<2>().diagonal();
  const Eigen::Vector2d cut_px = geometry.original_from_network.col(2).cwiseQuotient(scale);
  Camera uncut = camera;
  uncut.width =
      static_cast<uint64_t>(std::llround(static_cast<double>(photo.size.width) / scale.x()));
  uncut.height =
      static_cast<uint64_t>(std::llround(static_cast<double>(photo.size.height) / scale.y()));
  uncut.SetPrincipalPoint(camera.PrincipalPoint() + cut_px);
  return {Rescale(uncut, photo.size.width, photo.size.height), geometry.original_from_network};
}

// projection - xy of the observations in front of the camera, in the model's pixels.
std::vector<Eigen::Vector2d> Residuals(const Reconstruction& model,
                                       const Camera& camera,
                                       const Rigid3d& cam_from_world,
                                       const Image& image) {
  std::vector<Eigen::Vector2d> residuals;
  for (const Point2D& point2D : image.points2D) {
    if (!point2D.HasPoint3D()) continue;
    const Eigen::Vector3d& point_in_world = model.points3D.at(point2D.point3D_id).xyz;
    if (const auto pixel = Project(camera, cam_from_world * point_in_world)) {
      residuals.push_back(*pixel - point2D.xy);
    }
  }
  return residuals;
}

// The constant that explains all residuals, or zero.
Eigen::Vector2d DetectShift(const std::vector<Eigen::Vector2d>& residuals) {
  constexpr double kSpreadPercent = 90.0;
  if (residuals.size() < kMinShiftObservations) return Eigen::Vector2d::Zero();
  Eigen::Vector2d shift;
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<double> values;
    for (const Eigen::Vector2d& residual : residuals) values.push_back(residual[axis]);
    shift[axis] = Median(values);
    for (double& value : values) value = std::abs(value - shift[axis]);
    if (Percentile(std::move(values), kSpreadPercent) > kMaxShiftSpreadPx) {
      return Eigen::Vector2d::Zero();
    }
  }
  return shift.norm() > kMinShiftPx ? shift : Eigen::Vector2d::Zero();
}

class ColmapImport {
 public:
  ColmapImport(const ImportJob& job, ImportSummary& summary)
      : job_(job), summary_(summary), model_(ReadModel(job.input_path)) {
    if (model_.images.empty()) Fail(job.input_path, "holds no image", "a model with images");
  }

  void Read(const ViewSink& sink) {
    std::vector<std::string> names;
    for (const auto& [image_id, image] : model_.images) names.push_back(image.name);
    const std::vector<size_t> photo_indices =
        PhotoIndex(job_.photos).FindAll(job_.input_path, names);
    size_t i = 0;
    for (const auto& [image_id, image] : model_.images) sink(MakeView(image, photo_indices[i++]));
    AddNotes();
  }

 private:
  ImportedView MakeView(const Image& image, size_t photo_idx) {
    const Photo& photo = job_.photos[photo_idx];
    const Camera& model_camera = model_.cameras.at(image.camera_id);
    ImportedView imported;
    imported.photo_idx = photo_idx;
    imported.pose = {image.cam_from_world, false, RotationForm::kQuaternionWxyz};
    View& view = imported.prediction.view;
    view.name = photo.name;
    const Placement placement = job_.options.resize == ImportResize::kCrop
                                    ? UndoCrop(job_, model_camera, photo)
                                    : RescaleToPhoto(job_.input_path, model_camera, photo);
    view.camera = placement.camera;
    view.cam_from_world = CamFromWorld(imported.pose, job_.options.repair);
    const ImageSize model_size = {model_camera.width, model_camera.height};
    if (model_size != photo.size) {
      ++num_images_by_rescale_["from " + SizeText(model_size) + " to " + SizeText(photo.size)];
    }
    const Eigen::Vector2d shift =
        DetectShift(Residuals(model_, model_camera, view.cam_from_world, image));
    if (!shift.isZero()) ++NumImagesWithShift(shift);
    AddSamples(image, shift, placement.original_from_model, imported);
    return imported;
  }

  // Pixels of observed points with z of cam_from_world * point as depth.
  void AddSamples(const Image& image,
                  const Eigen::Vector2d& shift,
                  const PixelMap& original_from_model,
                  ImportedView& imported) {
    for (const Point2D& point2D : image.points2D) {
      if (!point2D.HasPoint3D()) continue;
      const Eigen::Vector3d& point_in_world = model_.points3D.at(point2D.point3D_id).xyz;
      const Eigen::Vector2d pixel = Apply(original_from_model, point2D.xy + shift);
      imported.anchors.push_back({point_in_world, pixel});
      const double depth = (imported.prediction.view.cam_from_world * point_in_world).z();
      const DepthSample sample = {pixel.cast<float>(), static_cast<float>(depth), 1.0f};
      if (sample.depth > 0.0f && std::isfinite(sample.depth) &&
          sample.pixel_in_original.allFinite()) {
        imported.prediction.depth_samples.push_back(sample);
      } else {
        ++num_behind_;
      }
    }
  }

  // Shifts that are the same but for rounding are one.
  size_t& NumImagesWithShift(const Eigen::Vector2d& shift) {
    constexpr double kSamePx = 0.01;
    for (auto& [known, count] : num_images_by_shift_) {
      if ((known - shift).norm() < kSamePx) return count;
    }
    return num_images_by_shift_.emplace_back(shift, 0).second;
  }

  static std::string ShiftText(const Eigen::Vector2d& shift) {
    // Adding 0 turns -0 into 0.
    const auto rounded = [](double value) { return std::round(1000.0 * value) / 1000.0 + 0.0; };
    char text[64];
    std::snprintf(text, sizeof(text), "(%+.3f, %+.3f)", rounded(shift.x()), rounded(shift.y()));
    return text;
  }

  void AddNotes() {
    for (const auto& [text, count] : num_images_by_rescale_) {
      summary_.notes.push_back("cameras rescaled " + text + " pixels, the photos' size, in " +
                               std::to_string(count) + " images");
    }
    for (const auto& [shift, count] : num_images_by_shift_) {
      summary_.notes.push_back("points2D moved by " + ShiftText(shift) + " pixels in " +
                               std::to_string(count) +
                               " images: a constant shift of the exporter, found by reprojection");
    }
    if (num_behind_ > 0) {
      summary_.warnings.push_back(std::to_string(num_behind_) +
                                  " observations lie behind their camera and give no depth sample");
    }
    if (model_.images.size() < job_.photos.size()) {
      summary_.notes.push_back(std::to_string(job_.photos.size() - model_.images.size()) +
                               " photos are not in the model and are left out");
    }
  }

  const ImportJob& job_;
  ImportSummary& summary_;
  Reconstruction model_;
  std::map<std::string, size_t> num_images_by_rescale_;
  std::vector<std::pair<Eigen::Vector2d, size_t>> num_images_by_shift_;
  size_t num_behind_ = 0;
};

void Read(const ImportJob& job, const ViewSink& sink, ImportSummary& summary) {
  const CameraSource unused(job.image_folder, job.photos, job.options.camera_params);
  if (const std::string warning = unused.Warning(); !warning.empty()) {
    summary.warnings.push_back(warning);
  }
  ColmapImport(job, summary).Read(sink);
  if (job.options.resize == ImportResize::kCrop) summary.resize = ImportResize::kCrop;
}

}  // namespace

const Importer kColmapImporter = {ImportFormat::kColmap,
                                  "colmap",
                                  "a sparse model (cameras, images, points3D as .bin or .txt)",
                                  Locate,
                                  Read};

}  // namespace vgtw
