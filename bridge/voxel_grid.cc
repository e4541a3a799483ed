// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/voxel_grid.h"

#include <array>
#include <cmath>
#include <map>

#include <pcl/filters/voxel_grid.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

namespace vgtw {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZRGB>;

constexpr float kMaxCoordinate = 8388608.0f;  // 2^23
// pcl::VoxelGrid numbers the cells of the bounding box with 32 bits and gives the cloud back as it
// was where they do not suffice, so it gets one cube of 1024^3 cells at a time.
constexpr float kBlockEdge = 1024.0f;

bool IsInReach(const ColoredPoint& point) {
  return point.xyz.allFinite() && point.xyz.cwiseAbs().maxCoeff() < kMaxCoordinate;
}

std::array<int, 3> BlockOf(const Eigen::Vector3f& xyz) {
  return {static_cast<int>(std::floor(xyz.x() / kBlockEdge)),
          static_cast<int>(std::floor(xyz.y() / kBlockEdge)),
          static_cast<int>(std::floor(xyz.z() / kBlockEdge))};
}

}  // namespace

std::vector<ColoredPoint> MergeInVoxels(const std::vector<ColoredPoint>& points) {
  std::map<std::array<int, 3>, Cloud::Ptr> clouds;
  for (const ColoredPoint& point : points) {
    if (!IsInReach(point)) continue;
    Cloud::Ptr& cloud = clouds[BlockOf(point.xyz)];
    if (cloud == nullptr) cloud.reset(new Cloud);
    const auto [r, g, b] = point.rgb;
    cloud->push_back(pcl::PointXYZRGB(point.xyz.x(), point.xyz.y(), point.xyz.z(), r, g, b));
  }
  std::vector<ColoredPoint> merged;
  for (const auto& [block, cloud] : clouds) {
    pcl::VoxelGrid<pcl::PointXYZRGB> grid;
    grid.setLeafSize(1.0f, 1.0f, 1.0f);
    grid.setInputCloud(cloud);
    Cloud centroids;
    grid.filter(centroids);
    for (const pcl::PointXYZRGB& point : centroids) {
      merged.push_back({{point.x, point.y, point.z}, {point.r, point.g, point.b}});
    }
  }
  return merged;
}

}  // namespace vgtw
