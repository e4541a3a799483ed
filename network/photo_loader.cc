// SPDX-License-Identifier: BSD-3-Clause
#include "network/photo_loader.h"

#include "network/config.h"
#include "network/grid_tensors.h"
#include "scene/error.h"
#include "scene/parallel.h"

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

namespace vgtw {

PhotoLoader::PhotoLoader(const std::filesystem::path& image_folder,
                         const std::vector<std::string>& image_names,
                         const PreprocessOptions& options,
                         int num_threads)
    : image_folder_(image_folder),
      image_names_(image_names),
      options_(options),
      num_threads_(num_threads) {
  std::vector<ImageSize> sizes(image_names.size());
  ParallelFor(num_views(), num_threads, [&](int64_t i) {
    const std::filesystem::path path = image_folder_ / name(static_cast<int>(i));
    const ImageSize size = ReadImageSize(path);
    const std::string fault = FindFault(size, options_);
    if (!fault.empty()) Fail(path, "has " + fault, "a photo", "leave it out");
    sizes[static_cast<size_t>(i)] = size;
  });
  placements_ = PlacePhotos(sizes, options_);
}

at::Tensor PhotoLoader::Load(int begin, int end) const {
  at::Tensor images = at::empty({end - begin, 3, network_height(), network_width()}, at::kFloat);
  ParallelFor(end - begin, num_threads_, [&](int64_t i) {
    const c10::InferenceMode inference;  // a mode is its thread's own
    const int view = begin + static_cast<int>(i);
    const RgbImage photo = ReadRgbImageOnWhite(image_folder_ / name(view));
    images[i].copy_(ToTensor(MakeNetworkImage(photo, placement(view), options_)));
  });
  return images;
}

at::Tensor PhotoLoader::LoadExcluded(int begin,
                                     int end,
                                     const StaticMaskReader& read_static_mask) const {
  at::Tensor excluded = at::zeros({end - begin, network_height(), network_width()}, at::kBool);
  ParallelFor(end - begin, num_threads_, [&](int64_t i) {
    const c10::InferenceMode inference;
    const int view = begin + static_cast<int>(i);
    const StaticMask static_mask = read_static_mask(name(view));
    if (static_mask.empty()) return;
    const ImageSize& size = placement(view).photo_size;
    if (static_mask.width() != static_cast<int>(size.width) ||
        static_mask.height() != static_cast<int>(size.height)) {
      throw Error("mask of " + Printable(name(view)) + ": " + std::to_string(static_mask.width()) +
                  "x" + std::to_string(static_mask.height()) + " pixels, expected the photo's " +
                  std::to_string(size.width) + "x" + std::to_string(size.height));
    }
    excluded[i].copy_(
        ToTensor(MakeNetworkMask(static_mask, placement(view), options_, /*outside=*/255)).eq(0));
  });
  return excluded;
}

at::Tensor ExcludedPatches(const at::Tensor& excluded_pixels) {
  const at::Tensor share = at::avg_pool2d(excluded_pixels.unsqueeze(1).to(at::kFloat), kPatchSize);
  return share.flatten(1).ge(0.5);
}

}  // namespace vgtw
