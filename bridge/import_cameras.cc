// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_cameras.h"

#include "scene/error.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

namespace vgtw {
namespace {

constexpr double kDefaultFocalFactor = 1.2;  // COLMAP's guess, in units of max(width, height)

std::vector<double> ParseCameraParams(std::string_view text) {
  std::vector<double> params;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    std::string_view token = text.substr(begin, end - begin);
    while (token.starts_with(' ')) token.remove_prefix(1);
    while (token.ends_with(' ')) token.remove_suffix(1);
    double value = 0.0;
    const auto [rest, code] = std::from_chars(token.data(), token.data() + token.size(), value);
    if (code != std::errc() || rest != token.data() + token.size() || !std::isfinite(value)) {
      params.clear();
      break;
    }
    params.push_back(value);
    begin = end + 1;
  }
  const bool is_known = params.size() == 1 || params.size() == 4;
  if (!is_known || params[0] <= 0.0 || (params.size() == 4 && params[1] <= 0.0)) {
    throw Error("camera parameters '" + Printable(text) +
                "': expected \"f\" or \"fx,fy,cx,cy\" in pixels of the photos");
  }
  return params;
}

}  // namespace

bool IsResized(const ImageSize& from, const ImageSize& size) {
  if (from.width == 0 || from.height == 0 || size.width == 0 || size.height == 0) return false;
  const auto deviation = [](uint64_t from_a, uint64_t from_b, uint64_t a, uint64_t b) {
    return std::abs(static_cast<double>(a) / static_cast<double>(from_a) *
                        static_cast<double>(from_b) -
                    static_cast<double>(b));
  };
  // One pixel: resizers round or cut.
  return deviation(from.width, from.height, size.width, size.height) <= 1.0 ||
         deviation(from.height, from.width, size.height, size.width) <= 1.0;
}

CameraSource::CameraSource(std::filesystem::path image_folder,
                           const std::vector<Photo>& photos,
                           std::string_view camera_params)
    : image_folder_(std::move(image_folder)) {
  if (camera_params.empty()) return;
  params_ = ParseCameraParams(camera_params);
  const bool same_size = std::all_of(
      photos.begin(), photos.end(), [&](const Photo& p) { return p.size == photos.front().size; });
  if (params_.size() == 4 && !same_size) {
    throw Error("camera parameters '" + Printable(camera_params) +
                "' name a principal point, but the photos differ in size: expected \"f\" alone");
  }
}

Camera CameraSource::Make(const Photo& photo) {
  ++num_made_;
  const auto [width, height] = photo.size;
  Camera camera = MakePinhole(width, height, 1.0, 1.0);
  camera.has_prior_focal_length = true;
  if (params_.size() == 4) {
    camera.params = params_;
  } else if (params_.size() == 1) {
    camera.SetFocalLength(params_[0], params_[0]);
  } else if (const auto focal = ReadExifFocalLength(image_folder_ / photo.name, photo.size)) {
    camera.SetFocalLength(*focal, *focal);
  } else {
    ++num_guessed_;
    const double guess = kDefaultFocalFactor * static_cast<double>(std::max(width, height));
    camera.SetFocalLength(guess, guess);
    camera.has_prior_focal_length = false;
  }
  return camera;
}

std::string CameraSource::Warning() const {
  if (num_made_ == 0 && !params_.empty()) {
    return "--camera_params is not used: the file brings intrinsics";
  }
  if (num_guessed_ == 0) return {};
  return "the focal length of " + std::to_string(num_guessed_) + " of " +
         std::to_string(num_made_) +
         " photos is unknown (no EXIF): guessed as 1.2 * max(width, height); give it by "
         "--camera_params";
}

}  // namespace vgtw
