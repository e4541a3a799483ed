// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"
#include "bridge/predictions.h"
#include "scene/reconstruction.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

struct SeedOptions {
  // One camera for all images of the same size: robust combination (median) of their intrinsics.
  bool shared_camera = false;
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
  int num_threads = 0;

  void Check() const;
};

struct SeedSummary {
  size_t num_images = 0;
  size_t num_points3D = 0;
  double mean_track_length = 0.0;
  double confidence_threshold = 0.0;
  // Spread of the focal lengths that a shared camera combined, percent of their median.
  double focal_spread_percent = 0.0;
};

// cameras and images of the predictions with the ids of `database` (matched by name), intrinsics at
// original resolution, the database's camera assignment. Views that the database lacks are left
// out and named in `missing`. Throws Error if none remains.
struct Seed {
  Reconstruction reconstruction;
  SeedSummary summary;
  std::vector<std::string> missing;
};
Seed MakeSeed(const PredictionReader& predictions,
              const ColmapDatabase& database,
              const SeedOptions& options);

// The same without a database: ids 1..n in order of names.
Seed MakeSeed(const PredictionReader& predictions, const SeedOptions& options);

// Fills an empty database with cameras, images, and trivial rigs and frames for the images that
// exist below `image_folder` and have a prediction; PINHOLE per image or shared, prior focal length
// set, so that the extractor keeps ids, models and intrinsics. Throws Error if an image's size is
// not that of its prediction.
void WriteSeedCameras(const PredictionReader& predictions,
                      const std::filesystem::path& image_folder,
                      const SeedOptions& options,
                      ColmapDatabase& database);

}  // namespace vgtw
