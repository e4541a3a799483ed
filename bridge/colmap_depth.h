// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/predictions.h"
#include "bridge/static_depths.h"
#include "scene/depth_map.h"
#include "scene/grid.h"
#include "scene/progress.h"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Maps of COLMAP's dense workspace: the text "<width>&<height>&<channels>&", then little-endian
// float32, row by row, one channel after the other. In files 0 is unknown, here it is NaN (depth)
// or zero (normals, in camera coordinates, towards the camera).
// Source: COLMAP's documentation, "Output format", "Dense reconstruction".
void WriteColmapDepthMap(const std::filesystem::path& path, const DepthMap& depth);
void WriteColmapNormalMap(const std::filesystem::path& path, const Grid<Eigen::Vector3f>& normals);

struct ColmapDepthOptions {
  StaticDepthFilter filter = {};
  // Multiplies the depths of each photo by the median of (depth of a point of the model / predicted
  // depth at its pixel), over kMinScalePoints points or more, else by the median of the other
  // photos' factors: a refined model has not exactly the predictions' scale, and networks get the
  // scale of single photos wrong.
  bool rescale = true;
  bool with_normals = true;
  bool overwrite = false;  // replace depth and normal maps that are there
  int num_threads = 0;     // 0 = all cores
};
inline constexpr size_t kMinScalePoints = 10;

struct DepthMapSummary {
  std::string image_name;
  bool has_map = false;         // whether the predictions hold a map of depths of the photo
  double known_share = 0.0;     // of the image's pixels
  double scale = 1.0;           // that the depths were multiplied by
  size_t num_scale_points = 0;  // of this photo that gave the scale
};

// Writes <workspace>/stereo/{depth_maps,normal_maps}/<image>.geometric.bin for the images of
// FindUndistortedImages, where `model_folder` is the sparse model before undistortion and
// `workspace_folder` what image_undistorter wrote or, if that holds no sparse/, a folder for maps
// of the photos themselves; then fusion.cfg (the names) is written beside them if there is none. So
// `colmap stereo_fusion --input_type geometric`, its meshers and splatting trainers can read them.
// Depth is read bilinearly (see SampleDepth) where the ray of a pixel's centre meets the photo; a
// normal is that of the nearest pixel of the prediction. Photos without a map of depths are left
// out. Each of the two folders appears complete or not at all. Throws Error as
// FindUndistortedImages does, if maps are there and not to be replaced, or if no image of the model
// has a depth map.
std::vector<DepthMapSummary> WriteColmapDepthMaps(const PredictionReader& predictions,
                                                  const std::filesystem::path& model_folder,
                                                  const std::filesystem::path& workspace_folder,
                                                  const ColmapDepthOptions& options,
                                                  const ProgressCallback& progress = {});

}  // namespace vgtw
