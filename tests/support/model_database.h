// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"
#include "scene/reconstruction.h"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <utility>

namespace vgtw {

inline Keypoints KeypointsOf(const Image& image) {
  Keypoints keypoints;
  keypoints.rows = static_cast<uint32_t>(image.points2D.size());
  keypoints.cols = 4;
  for (const Point2D& point2D : image.points2D) {
    const Eigen::Vector2f xy = point2D.xy.cast<float>();
    keypoints.data.insert(keypoints.data.end(), {xy.x(), xy.y(), 2.0f, 0.0f});
  }
  return keypoints;
}

// A database of the model's cameras and images, their keypoints where the model has its points2D.
inline ColmapDatabase CreateDatabaseOf(const Reconstruction& model,
                                       const std::filesystem::path& path) {
  ColmapDatabase database = ColmapDatabase::Create(path);
  ColmapDatabase::Transaction transaction(database);
  for (const auto& [id, camera] : model.cameras) database.WriteCamera(camera);
  for (const auto& [id, image] : model.images) {
    database.WriteImage({id, image.name, image.camera_id});
    database.WriteKeypoints(id, KeypointsOf(image));
  }
  transaction.Commit();
  return database;
}

inline void WriteVerifiedMatches(ImageId image_id1,
                                 ImageId image_id2,
                                 const FeatureMatches& matches,
                                 ColmapDatabase& database) {
  ColmapDatabase::Transaction transaction(database);
  TwoViewGeometry geometry;
  geometry.config = kTwoViewCalibrated;
  geometry.inlier_matches = matches;
  database.WriteTwoViewGeometry(image_id1, image_id2, geometry);
  transaction.Commit();
}

// Verified matches between all images of each track.
inline void WriteMatchesOfTracks(const Reconstruction& model, ColmapDatabase& database) {
  std::map<std::pair<ImageId, ImageId>, FeatureMatches> matches;
  for (const auto& [id, point] : model.points3D) {
    for (size_t i = 0; i < point.track.size(); ++i) {
      for (size_t k = i + 1; k < point.track.size(); ++k) {
        matches[{point.track[i].image_id, point.track[k].image_id}].push_back(
            {point.track[i].point2D_idx, point.track[k].point2D_idx});
      }
    }
  }
  for (const auto& [pair, inliers] : matches) {
    WriteVerifiedMatches(pair.first, pair.second, inliers, database);
  }
}

}  // namespace vgtw
