// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"
#include "scene/reconstruction.h"

#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

// An image that `colmap image_undistorter` wrote.
struct UndistortedImage {
  std::string name;
  Camera distorted;    // of its photo
  Camera undistorted;  // a pinhole of the written image's size
};

// The images of the model in <undistorted_folder>/sparse or, where trainers expect it, sparse/0,
// with the lenses of `model`, the sparse model before undistortion, which lies in `model_folder`.
// An image has the size of the file below <undistorted_folder>/images, or of its camera where that
// is missing: with --max_image_size, COLMAP 3.8 shrinks the images of PINHOLE cameras and leaves
// their cameras as they were. Without `undistorted_folder` ("") they are the photos themselves,
// whose cameras must be pinholes. Throws Error if there is no undistorted model, or if an image of
// it is not in `model` or has another aspect than its camera.
std::vector<UndistortedImage> FindUndistortedImages(
    const Reconstruction& model,
    const std::filesystem::path& model_folder,
    const std::filesystem::path& undistorted_folder);

}  // namespace vgtw
