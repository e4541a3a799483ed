// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/undistorted_images.h"

#include "bridge/colmap_model.h"
#include "bridge/mask_files.h"
#include "scene/error.h"
#include "scene/image_io.h"

#include <cmath>
#include <map>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

ImageSize SizeOf(const Camera& camera) { return {camera.width, camera.height}; }

bool IsPinhole(const Camera& camera) {
  return camera.model == CameraModel::kSimplePinhole || camera.model == CameraModel::kPinhole;
}

fs::path UndistortedModelFolder(const fs::path& undistorted_folder) {
  for (const char* name : {"sparse", "sparse/0"}) {
    if (IsModelFolder(undistorted_folder / name)) return undistorted_folder / name;
  }
  Fail(undistorted_folder,
       "holds no model in sparse/",
       "a folder that `colmap image_undistorter` wrote",
       "run it with --output_type COLMAP");
}

// The camera at the size of the image that was written with it, where that is there.
Camera CameraOfImage(const Camera& camera, const fs::path& path) {
  if (!fs::exists(path)) return camera;
  const ImageSize size = ReadImageSize(path);
  if (size == SizeOf(camera)) return camera;
  const double scale = static_cast<double>(size.width) / static_cast<double>(camera.width);
  const double height = scale * static_cast<double>(camera.height);
  if (std::abs(static_cast<double>(size.height) - height) > 1.0) {
    CheckSize(path,
              size,
              SizeOf(camera),
              "the size of its undistorted camera",
              "run `colmap image_undistorter` again");
  }
  return Rescale(camera, size.width, size.height);
}

std::vector<UndistortedImage> PlanUndistortion(const Reconstruction& model,
                                               const fs::path& model_folder,
                                               const fs::path& undistorted_folder) {
  std::map<std::string, Camera> distorted;
  for (const auto& [id, image] : model.images) {
    distorted[image.name] = model.cameras.at(image.camera_id);
  }
  const fs::path folder = UndistortedModelFolder(undistorted_folder);
  const Reconstruction undistorted = ReadModel(folder);
  std::vector<UndistortedImage> jobs;
  for (const auto& [id, image] : undistorted.images) {
    const auto found = distorted.find(image.name);
    if (found == distorted.end()) {
      Fail(folder,
           "has an image " + Printable(image.name),
           "only images of " + model_folder.string(),
           "give the model that was undistorted");
    }
    const Camera& camera = undistorted.cameras.at(image.camera_id);
    const fs::path path = undistorted_folder / "images" / image.name;
    jobs.push_back({image.name, found->second, CameraOfImage(camera, path)});
  }
  return jobs;
}

std::vector<UndistortedImage> PlanIdentity(const Reconstruction& model,
                                           const fs::path& model_folder) {
  std::vector<UndistortedImage> jobs;
  for (const auto& [id, image] : model.images) {
    const Camera& camera = model.cameras.at(image.camera_id);
    if (!IsPinhole(camera)) {
      Fail(model_folder,
           "has a " + std::string(GetCameraModelInfo(camera.model).name) + " camera",
           "PINHOLE cameras, or the undistorted images beside it",
           "run `colmap image_undistorter` and give its folder");
    }
    jobs.push_back({image.name, camera, camera});
  }
  return jobs;
}

}  // namespace

std::vector<UndistortedImage> FindUndistortedImages(const Reconstruction& model,
                                                    const fs::path& model_folder,
                                                    const fs::path& undistorted_folder) {
  return undistorted_folder.empty() ? PlanIdentity(model, model_folder)
                                    : PlanUndistortion(model, model_folder, undistorted_folder);
}

}  // namespace vgtw
