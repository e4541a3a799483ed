// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_undistort_folder.h"

#include "bridge/colmap_model.h"
#include "bridge/undistorted_images.h"
#include "scene/mask_undistort.h"

#include <string>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> NamesOf(const std::vector<UndistortedImage>& jobs) {
  std::vector<std::string> names;
  for (const UndistortedImage& job : jobs) names.push_back(job.name);
  return names;
}

}  // namespace

std::vector<MaskSummary> UndistortMasks(const fs::path& mask_folder,
                                        const fs::path& model_folder,
                                        const fs::path& undistorted_folder,
                                        const fs::path& output_folder,
                                        const UndistortMasksOptions& options,
                                        const ProgressCallback& progress) {
  const Reconstruction model = ReadModel(model_folder);
  const std::vector<UndistortedImage> jobs =
      FindUndistortedImages(model, model_folder, undistorted_folder);
  CheckMasksExist(mask_folder, NamesOf(jobs), options.allow_missing_masks);

  const auto make = [&](size_t idx, StaticMask& static_mask) {
    const UndistortedImage& job = jobs[idx];
    const fs::path path = MaskPath(mask_folder, job.name);
    const bool was_missing = !fs::exists(path);
    const ImageSize size = {job.distorted.width, job.distorted.height};
    const StaticMask of_photo =
        was_missing ? StaticMask(static_cast<int>(size.width), static_cast<int>(size.height), 255)
                    : ReadMaskOfSize(path, size);
    static_mask = UndistortMask(of_photo, job.distorted, job.undistorted);
    return MaskSummary{.image_name = job.name, .was_missing = was_missing};
  };
  return WriteMaskFolder(
      output_folder, options.overwrite, jobs.size(), options.num_threads, progress, make);
}

}  // namespace vgtw
