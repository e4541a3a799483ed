// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"
#include "scene/distractor_mask.h"

namespace vgtw {

// The mask of an undistorted image, of size undistorted.width x height: the ray through each pixel
// centre is seen by the `distorted` camera, and the photo's pixel that it falls into gives the
// value (nearest neighbour, so that it stays 0 or 255). That is the map of `colmap
// image_undistorter`, so the mask's edges lie on those of the image. Excluded is also what the
// photo does not show: a pixel that falls farther out than the photo's outermost pixel centres,
// where COLMAP cannot interpolate and paints black. Law: two equal cameras give the mask back.
// Throws std::invalid_argument if the mask is not of the distorted camera's size.
StaticMask UndistortMask(const StaticMask& static_mask,
                         const Camera& distorted,
                         const Camera& undistorted);

}  // namespace vgtw
