// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/predictions.h"
#include "bridge/static_depths.h"
#include "bridge/surface_cloud.h"
#include "scene/progress.h"
#include "scene/reconstruction.h"

#include <filesystem>

namespace vgtw {

struct ExportPointsOptions {
  StaticDepthFilter filter = {};
  // Edge of the cubes that give one point each (see VoxelMeans), as a share of the camera extent;
  // 0 = every pixel gives its own.
  double voxel_size = 0.0;
  // The photos, for the colours of the points; empty = gray points.
  std::filesystem::path image_folder;
  int num_threads = 0;  // 0 = all cores

  void Check() const;
};

// The static depths of predictions as points of the world: with normals if a view has a map of
// depths or points (zero where they are unknown), and "confidence" if a view has any. Views follow
// each other in their order and pixels row by row, whatever the number of threads; memory holds the
// cloud and one view per thread. Throws Error if no depth is left or a photo is wrong.
SurfaceCloud PointsOfPredictions(const PredictionReader& predictions,
                                 const ExportPointsOptions& options,
                                 const ProgressCallback& progress = {});

// The points of a model in the order of their ids, with "error" (mean reprojection error in pixels,
// -1 = not computed) and "track_length" (number of observations); thinned as above.
SurfaceCloud PointsOfModel(const Reconstruction& model, double voxel_size);

}  // namespace vgtw
