// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/feature_stage.h"

#include "bridge/mask_files.h"
#include "plugin/progress.h"
#include "scene/error.h"

#include <map>

namespace vgtw {
namespace {

std::string Text(const ImageSize& size) {
  return std::to_string(size.width) + " x " + std::to_string(size.height);
}

}  // namespace

void ExtractDatabaseFeatures(const FeatureStageOptions& options, ColmapDatabase& database) {
  const std::vector<DatabaseImage> images = database.ReadImages();
  std::map<CameraId, ImageSize> size_by_camera;
  for (const Camera& camera : database.ReadCameras()) {
    size_by_camera[camera.camera_id] = {camera.width, camera.height};
  }
  const auto load = [&](size_t idx) {
    const DatabaseImage& image = images[idx];
    const ImageSize& size = size_by_camera.at(image.camera_id);
    MaskedPhoto photo;
    photo.image = ReadGrayImage(options.image_path / image.name);
    const ImageSize found = {static_cast<uint64_t>(photo.image.width()),
                             static_cast<uint64_t>(photo.image.height())};
    if (found != size) {
      Fail(options.image_path / image.name,
           Text(found) + " pixels",
           Text(size) + " as its camera in the database",
           "");
    }
    if (!options.mask_path.empty()) {
      photo.static_mask = ReadMaskOfSize(MaskPath(options.mask_path, image.name), size);
    }
    return photo;
  };
  ColmapDatabase::Transaction transaction(database);
  ProgressDisplay display("features");
  ExtractAll(
      images.size(),
      load,
      [&](size_t idx, const Features& features) {
        database.WriteKeypoints(images[idx].image_id, features.keypoints);
        database.WriteDescriptors(images[idx].image_id, features.descriptors);
      },
      options.extract,
      display.Callback());
  transaction.Commit();
}

}  // namespace vgtw
