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
    for (const Point2D& point2D : image.points2D) {
      if (!point2D.HasPoint3D() || !IsExcluded(mask, point2D.xy.x(), point2D.xy.y())) continue;
      ++count.num_observations;
      points3D.insert(point2D.point3D_id);
    }
  }
  count.num_points3D = points3D.size();
  return count;
}

}  // namespace vgtw
