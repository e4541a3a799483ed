// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_files.h"

#include "bridge/mask_resample.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "scene/parallel.h"

namespace vgtw {
namespace {

StaticMask AllWhite(uint64_t width, uint64_t height) {
  return {static_cast<int>(width), static_cast<int>(height), 255};
}

GrayImage WithCheckedSize(GrayImage mask,
                          const std::filesystem::path& path,
                          const ImageSize& size) {
  CheckSize(path,
            SizeOf(mask),
            size,
            "the size of its image",
            "write masks at full size: COLMAP does not resize them");
  return mask;
}

}  // namespace

std::filesystem::path MaskPath(const std::filesystem::path& mask_folder,
                               const std::string& image_name) {
  return mask_folder / (image_name + ".png");
}

void CheckSize(const std::filesystem::path& path,
               const ImageSize& size,
               const ImageSize& expected,
               std::string_view whose,
               std::string_view hint) {
  if (size == expected) return;
  const auto text = [](const ImageSize& value) {
    return std::to_string(value.width) + " x " + std::to_string(value.height) + " pixels";
  };
  Fail(path, "has " + text(size), text(expected) + ", " + std::string(whose), hint);
}

StaticMask ReadMaskOfSize(const std::filesystem::path& path, const ImageSize& size) {
  return WithCheckedSize(ReadStaticMask(path), path, size);
}

GrayImage ReadMaskValuesOfSize(const std::filesystem::path& path, const ImageSize& size) {
  return WithCheckedSize(ReadMaskValues(path), path, size);
}

void CheckMasksExist(const std::filesystem::path& mask_folder,
                     const std::vector<std::string>& image_names,
                     bool allow_missing) {
  if (!std::filesystem::is_directory(mask_folder)) {
    Fail(mask_folder, "is not a folder", "masks named <image name>.png");
  }
  std::filesystem::path first_missing;
  size_t num_missing = 0;
  for (const std::string& name : image_names) {
    const std::filesystem::path path = MaskPath(mask_folder, name);
    if (!std::filesystem::exists(path) && num_missing++ == 0) first_missing = path;
  }
  if (num_missing == 0 || allow_missing) return;
  Fail(first_missing,
       "is missing (" + std::to_string(num_missing) + " of " + std::to_string(image_names.size()) +
           " images have no mask)",
       "one mask per image",
       "write all-white ones, or allow missing masks");
}

bool IsInFolder(const std::filesystem::path& folder, const std::filesystem::path& path) {
  const std::filesystem::path relative = std::filesystem::weakly_canonical(path).lexically_relative(
      std::filesystem::weakly_canonical(folder));
  return !relative.empty() && *relative.begin() != "..";
}

void CheckNotInput(const std::filesystem::path& output_folder,
                   const std::filesystem::path& input_folder) {
  if (!IsInFolder(output_folder, input_folder)) return;
  Fail(output_folder,
       "holds " + Printable(input_folder.string()) + ", which is read",
       "another folder to write",
       "copy the files afterwards");
}

std::vector<MaskSummary> WriteMaskFolder(const std::filesystem::path& mask_folder,
                                         bool overwrite,
                                         size_t num_masks,
                                         int num_threads,
                                         const ProgressCallback& progress,
                                         const MaskMaker& make) {
  AtomicFolder folder(mask_folder, overwrite);
  std::vector<MaskSummary> summaries(num_masks);
  const auto write_mask = [&](int64_t i) {
    MaskSummary& summary = summaries[static_cast<size_t>(i)];
    StaticMask static_mask;
    summary = make(static_cast<size_t>(i), static_mask);
    summary.excluded_share = ExcludedShare(static_mask);
    WriteImage(MaskPath(folder.path(), summary.image_name), static_mask);
  };
  ParallelFor(static_cast<int64_t>(num_masks), num_threads, write_mask, progress);
  folder.Commit();
  return summaries;
}

std::vector<MaskSummary> WriteMasks(const PredictionReader& predictions,
                                    const std::filesystem::path& mask_folder,
                                    const StaticMaskOptions& options,
                                    bool overwrite,
                                    int num_threads,
                                    const ProgressCallback& progress) {
  options.Check();
  const auto make = [&](size_t view_idx, StaticMask& static_mask) {
    const ViewPrediction prediction = predictions.Load(view_idx);
    const View& view = prediction.view;
    const bool was_missing = prediction.distractor.empty();
    static_mask = was_missing ? AllWhite(view.camera.width, view.camera.height)
                              : MakeStaticMask(view, prediction.distractor, options);
    return MaskSummary{.image_name = view.name, .was_missing = was_missing};
  };
  return WriteMaskFolder(
      mask_folder, overwrite, predictions.views().size(), num_threads, progress, make);
}

std::vector<MaskSummary> CopyMasks(const std::filesystem::path& from_folder,
                                   const std::filesystem::path& image_folder,
                                   const std::vector<std::string>& image_names,
                                   const std::filesystem::path& mask_folder,
                                   bool overwrite,
                                   int num_threads,
                                   const ProgressCallback& progress) {
  CheckMasksExist(from_folder, image_names, /*allow_missing=*/true);
  const auto make = [&](size_t idx, StaticMask& static_mask) {
    const std::string& name = image_names[idx];
    VGTW_CHECK(IsSafeRelativeName(name), "image name '" + Printable(name) + "'");
    const ImageSize size = ReadImageSize(image_folder / name);
    const std::filesystem::path path = MaskPath(from_folder, name);
    const bool was_missing = !std::filesystem::exists(path);
    static_mask = was_missing ? AllWhite(size.width, size.height) : ReadMaskOfSize(path, size);
    return MaskSummary{.image_name = name, .was_missing = was_missing};
  };
  return WriteMaskFolder(mask_folder, overwrite, image_names.size(), num_threads, progress, make);
}

}  // namespace vgtw
