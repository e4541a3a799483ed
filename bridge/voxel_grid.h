// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/point_cloud.h"

#include <vector>

namespace vgtw {

// One point per occupied unit cube of the integer lattice: the mean position and colour of the
// points in it. Points beyond 2^23 have coordinates coarser than a cube and are left out, as are
// those that are not finite. The result does not depend on anything but the points in their order.
std::vector<ColoredPoint> MergeInVoxels(const std::vector<ColoredPoint>& points);

}  // namespace vgtw
