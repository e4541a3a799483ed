// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/distractor_points.h"

#include <set>

namespace vgtw {

DistractorCount CountOnDistractors(const Reconstruction& reconstruction,
                                   const std::function<StaticMask(const std::string&)>& true_mask) {
  DistractorCount count;
  std::set<Point3DId> points3D;
  for (const auto& [id, image] : reconstruction.images) {
    const StaticMask mask = true_mask(image.name);
    size_t& num_observations = count.num_observations_by_image[id];
    for (const Point2D& point2D : image.points2D) {
      if (!point2D.HasPoint3D() || !IsExcluded(mask, point2D.xy.x(), point2D.xy.y())) continue;
      ++num_observations;
      points3D.insert(point2D.point3D_id);
    }
    count.num_observations += num_observations;
  }
  count.num_points3D = points3D.size();
  return count;
}

}  // namespace vgtw
