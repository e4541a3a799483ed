// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"
#include "bridge/predictions.h"
#include "scene/reconstruction.h"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

struct SeedOptions {
  // One camera for all images of the same size and camera model: the median of each parameter.
  bool shared_camera = false;
  // Model of new cameras whose prediction is a pinhole, so that refinement can find the lens'
  // distortion (see PinholeInModel); nullopt = as predicted.
  std::optional<CameraModel> camera_model;
  // 3D points from confident static depth; without them the model has poses only.
  bool with_points = true;
  // Share of depth pixels kept, by confidence pooled over all views, in percent, (0, 100]. Taken
  // before the distractor test, as VGTW's authors do.
  double keep_percent = 50.0;
  // A pixel with at least this distractor probability gives no point; in (0, 1].
  double distractor_threshold = 0.5;
  // Edge length of the grid that merges points, as a share of the camera extent; 0 = no grid.
  double voxel_size = 0.005;
  // Two views observe the same point if its depth agrees within this relative difference.
  double max_relative_depth_difference = 0.02;
  // Points seen by fewer views are left out (COLMAP's viewer hides short tracks). >= 1.
  int min_track_length = 2;
  // The photos, for the colours of the points; empty = gray points.
  std::filesystem::path image_folder;
  int num_threads = 0;  // 0 = all cores

  void Check() const;
};

struct SeedSummary {
  size_t num_images = 0;
  size_t num_points3D = 0;
  double mean_track_length = 0.0;
  double confidence_threshold = 0.0;
  // Largest minus smallest of the focal lengths that became one camera, percent of their median;
  // the largest over all cameras. A zoom lens, or two cameras of one size, show here.
  double focal_spread_percent = 0.0;
};

struct Seed {
  Reconstruction reconstruction;
  SeedSummary summary;
  std::vector<std::string> missing;  // predicted views that the database lacks
};

// A sparse model of the predictions with the ids of `database` (matched by name), intrinsics at
// original resolution, and the database's cameras: where several images share one, it gets the
// median of their intrinsics. A camera keeps the database's model: predictions of that model give
// all parameters, pinhole predictions give focal lengths and principal point and leave the
// distortion as the database has it; others throw Error, as do sizes that disagree.
// Rigs and frames are the database's where each rig has one camera, else none.
// The points come from depth: their points2D are projections, not rows of the database's keypoints.
// COLMAP's point_triangulator does without them (--clear_points 1, or with_points = false).
// Throws Error if no view of the predictions is in the database.
Seed MakeSeed(const PredictionReader& predictions,
              const ColmapDatabase& database,
              const SeedOptions& options);

// The same without a database: ids 1..n in order of names, the cameras of WriteSeedCameras.
Seed MakeSeed(const PredictionReader& predictions, const SeedOptions& options);

// Fills an empty database with cameras, images, and trivial rigs and frames for the images that
// exist below `image_folder` and have a prediction, with ids 1..n in order of names. Cameras are
// those of the predictions, one per image or shared, with prior focal length set, so that the
// extractor keeps ids, models and intrinsics. Throws Error if the database has images or cameras,
// no image has a prediction, or an image's size is not that of its prediction.
void WriteSeedCameras(const PredictionReader& predictions,
                      const std::filesystem::path& image_folder,
                      const SeedOptions& options,
                      ColmapDatabase& database);

}  // namespace vgtw
