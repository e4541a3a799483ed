// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/point_cloud.h"

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// A number of each point, under the name that files give it: "confidence", "error".
struct CloudScalar {
  std::string name;  // letters and '_'
  std::vector<float> values;
};

// Points with whatever else is known of them. Law: every list is as long as `points`, but
// `normals` may be empty.
struct SurfaceCloud {
  std::vector<ColoredPoint> points;
  std::vector<Eigen::Vector3f> normals;  // unit, towards the cameras; zero = unknown
  std::vector<CloudScalar> scalars;
};

// Adds the points of `part`, which has the same lists.
void Append(const SurfaceCloud& part, SurfaceCloud& cloud);

// Binary little-endian PLY: float x y z, float nx ny nz where there are normals (as COLMAP's
// fused.ply has them, which its meshers read), uchar red green blue, then each scalar as a float.
void WritePly(const std::filesystem::path& path, const SurfaceCloud& cloud);

// Binary PCD 0.7: x y z rgb, normal_x normal_y normal_z, each scalar, by PCL's names.
void WritePcd(const std::filesystem::path& path, const SurfaceCloud& cloud);

}  // namespace vgtw
