// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_model.h"

#include "scene/error.h"
#include "scene/reprojection.h"

#include <map>
#include <set>
#include <string>

namespace vgtw {
namespace {

const MaskedImage& FindImage(const std::filesystem::path& model_path,
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
  return *found->second;
}

uint64_t CountObservations(const Reconstruction& reconstruction) {
  uint64_t num_observations = 0;
  for (const auto& [point3D_id, point] : reconstruction.points3D) {
    num_observations += point.track.size();
  }
  return num_observations;
}

// Returns the points that lost observations and remain.
std::set<Point3DId> RemoveObservations(const MaskedImage& masked,
                                       bool whole_track,
                                       ImageId image_id,
                                       Reconstruction& reconstruction) {
  std::set<Point3DId> changed;
  const std::vector<Point2D>& points2D = reconstruction.images.at(image_id).points2D;
  for (uint32_t idx = 0; idx < points2D.size(); ++idx) {
    if (!masked.is_excluded[idx] || !points2D[idx].HasPoint3D()) continue;
    const Point3DId point3D_id = points2D[idx].point3D_id;
    if (whole_track) {
      RemovePoint3D(reconstruction, point3D_id);
    } else {
      RemoveObservation(reconstruction, {image_id, idx});
      changed.insert(point3D_id);
    }
  }
  return changed;
}

void RemovePoints2D(const MaskedImagesById& images, Reconstruction& reconstruction) {
  std::map<ImageId, std::vector<uint32_t>> new_indices;
  for (auto& [image_id, image] : reconstruction.images) {
    if (image.points2D.empty()) continue;
    const std::vector<bool>& is_excluded = images.at(image_id)->is_excluded;
    new_indices[image_id] = RenumberedIndices(is_excluded);
    std::vector<Point2D> kept;
    for (size_t idx = 0; idx < is_excluded.size(); ++idx) {
      if (!is_excluded[idx]) kept.push_back(image.points2D[idx]);
    }
    image.points2D = std::move(kept);
  }
  for (auto& [point3D_id, point] : reconstruction.points3D) {
    for (TrackElement& element : point.track) {
      element.point2D_idx = new_indices.at(element.image_id)[element.point2D_idx];
    }
  }
}

}  // namespace

ApplyMasksModelSummary MaskModel(const std::filesystem::path& model_path,
                                 const std::vector<MaskedImage>& masked_images,
                                 MaskRule rule,
                                 Reconstruction& reconstruction) {
  ApplyMasksModelSummary summary;
  summary.num_observations_before = CountObservations(reconstruction);
  summary.num_points3D_before = reconstruction.points3D.size();
  const MaskedImagesById images = ById(masked_images);
  std::set<Point3DId> changed;
  for (const auto& [image_id, image] : reconstruction.images) {
    const MaskedImage& masked = FindImage(model_path, images, image);
    changed.merge(RemoveObservations(masked, rule == MaskRule::kTracks, image_id, reconstruction));
  }
  if (rule == MaskRule::kKeypoints) RemovePoints2D(images, reconstruction);
  for (const Point3DId point3D_id : changed) {
    const auto point = reconstruction.points3D.find(point3D_id);
    if (point != reconstruction.points3D.end()) UpdatePointError(reconstruction, point->second);
  }
  summary.num_observations_after = CountObservations(reconstruction);
  summary.num_points3D_after = reconstruction.points3D.size();
  return summary;
}

}  // namespace vgtw
