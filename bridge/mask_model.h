// SPDX-License-Identifier: BSD-3-Clause
// What ApplyMasks does to a sparse model, by rule.
#pragma once

#include "bridge/mask_apply_images.h"
#include "scene/reconstruction.h"

#include <filesystem>
#include <set>
#include <vector>

namespace vgtw {

// A sparse model while masks are applied to it and its database.
class MaskedModel {
 public:
  // Throws Error if the folder holds no model, if its images are not those of the database, or
  // their points2D not its keypoints; an image without any is fine.
  MaskedModel(const std::filesystem::path& folder, const std::vector<MaskedImage>& images);

  // Removes the observations of excluded keypoints and the points that keep fewer than two, under
  // kTracks every point that had one; under kKeypoints also the points2D themselves, so that the
  // others have the indices that the database then gives them.
  void RemoveExcluded(MaskRule rule);
  // Leaves images whose last geometry went (see FilterPairs) their pose alone.
  void Disconnect();
  // Errors of points that lost an observation are written anew. Format as read.
  ApplyMasksModelSummary Write(const std::filesystem::path& folder, bool overwrite);

 private:
  template <typename Predicate>
  void RemoveObservations(ImageId image_id, const Predicate& is_removed);
  void Renumber();

  std::filesystem::path folder_;
  const std::vector<MaskedImage>& images_;
  Reconstruction reconstruction_;
  ApplyMasksModelSummary summary_;
  std::set<Point3DId> changed_;
};

}  // namespace vgtw
