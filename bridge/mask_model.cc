// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_model.h"

#include "bridge/colmap_model.h"
#include "scene/error.h"
#include "scene/reprojection.h"

#include <map>
#include <string>

namespace vgtw {
namespace {

void CheckImage(const std::filesystem::path& model_path,
                const MaskedImagesById& images,
                const Image& image) {
  const std::string name =
      "image " + std::to_string(image.image_id) + " '" + Printable(image.name) + "'";
  const std::string hint = "name the model made from this database, before masks were applied";
  const auto found = images.find(image.image_id);
  if (found == images.end() || found->second->summary.image_name != image.name) {
    Fail(model_path, "has " + name + ", which is not the database's", "the same images", hint);
  }
  const size_t num_keypoints = found->second->is_excluded.size();
  if (!image.points2D.empty() && image.points2D.size() != num_keypoints) {
    Fail(model_path,
         "has " + std::to_string(image.points2D.size()) + " points2D in " + name,
         "the database's " + std::to_string(num_keypoints) + " keypoints",
         hint);
  }
}

uint64_t CountObservations(const Reconstruction& reconstruction) {
  uint64_t num_observations = 0;
  for (const auto& [point3D_id, point] : reconstruction.points3D) {
    num_observations += point.track.size();
  }
  return num_observations;
}

}  // namespace

MaskedModel::MaskedModel(const std::filesystem::path& folder,
                         const std::vector<MaskedImage>& images)
    : folder_(folder), images_(images), reconstruction_(ReadModel(folder)) {
  const MaskedImagesById by_id = ById(images);
  for (const auto& [image_id, image] : reconstruction_.images) CheckImage(folder, by_id, image);
  summary_.num_observations_before = CountObservations(reconstruction_);
  summary_.num_points3D_before = reconstruction_.points3D.size();
}

template <typename Predicate>
void MaskedModel::RemoveObservations(ImageId image_id, const Predicate& is_removed) {
  const std::vector<Point2D>& points2D = reconstruction_.images.at(image_id).points2D;
  for (uint32_t idx = 0; idx < points2D.size(); ++idx) {
    if (!points2D[idx].HasPoint3D() || !is_removed(idx)) continue;
    changed_.insert(points2D[idx].point3D_id);
    RemoveObservation(reconstruction_, {image_id, idx});
  }
}

void MaskedModel::RemoveExcluded(MaskRule rule) {
  for (const MaskedImage& masked : images_) {
    const auto image = reconstruction_.images.find(masked.image_id);
    if (image == reconstruction_.images.end()) continue;
    RemoveObservations(masked.image_id, [&](uint32_t idx) { return masked.is_excluded[idx]; });
  }
  if (rule == MaskRule::kTracks) {
    for (const Point3DId point3D_id : changed_) {
      if (reconstruction_.points3D.contains(point3D_id)) {
        RemovePoint3D(reconstruction_, point3D_id);
      }
    }
  }
  if (rule == MaskRule::kKeypoints) Renumber();
}

void MaskedModel::Renumber() {
  std::map<ImageId, std::vector<uint32_t>> new_indices;
  for (const MaskedImage& masked : images_) {
    const auto image = reconstruction_.images.find(masked.image_id);
    if (image == reconstruction_.images.end() || image->second.points2D.empty()) continue;
    new_indices[masked.image_id] = RenumberedIndices(masked.is_excluded);
    std::vector<Point2D> kept;
    for (size_t idx = 0; idx < masked.is_excluded.size(); ++idx) {
      if (!masked.is_excluded[idx]) kept.push_back(image->second.points2D[idx]);
    }
    image->second.points2D = std::move(kept);
  }
  for (auto& [point3D_id, point] : reconstruction_.points3D) {
    for (TrackElement& element : point.track) {
      element.point2D_idx = new_indices.at(element.image_id)[element.point2D_idx];
    }
  }
}

void MaskedModel::Disconnect() {
  for (const MaskedImage& masked : images_) {
    const auto image = reconstruction_.images.find(masked.image_id);
    const bool is_disconnected = masked.had_geometry && !masked.has_geometry;
    if (image == reconstruction_.images.end() || !is_disconnected) continue;
    RemoveObservations(masked.image_id, [](uint32_t) { return true; });
    image->second.points2D.clear();
  }
}

ApplyMasksModelSummary MaskedModel::Write(const std::filesystem::path& folder, bool overwrite) {
  for (const Point3DId point3D_id : changed_) {
    const auto point = reconstruction_.points3D.find(point3D_id);
    if (point != reconstruction_.points3D.end()) UpdatePointError(reconstruction_, point->second);
  }
  WriteModel(reconstruction_, folder, {.format = ModelFormatOf(folder_), .overwrite = overwrite});
  summary_.num_observations_after = CountObservations(reconstruction_);
  summary_.num_points3D_after = reconstruction_.points3D.size();
  return summary_;
}

}  // namespace vgtw
