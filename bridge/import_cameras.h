// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/import_photos.h"
#include "scene/camera.h"
#include "scene/view.h"

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Whether `size` is `from` resized with its aspect, up to rounding to whole pixels.
bool IsResized(const ImageSize& from, const ImageSize& size);

// Cameras for formats that bring none: the parameters of --camera_params ("f" or "fx,fy,cx,cy" in
// original pixels), else the focal length of the photo's EXIF, else 1.2 * max(width, height).
class CameraSource {
 public:
  // Throws Error if `camera_params` is not one of these forms, or names a principal point for
  // photos of different sizes.
  CameraSource(std::filesystem::path image_folder,
               const std::vector<Photo>& photos,
               std::string_view camera_params);

  Camera Make(const Photo& photo);

  // "" or what a user should know after all calls of Make(): that focal lengths were guessed, or
  // that nothing needed the parameters.
  std::string Warning() const;

 private:
  std::filesystem::path image_folder_;
  std::vector<double> params_;
  size_t num_made_ = 0;
  size_t num_guessed_ = 0;
};

}  // namespace vgtw
