// SPDX-License-Identifier: BSD-3-Clause
#include "network/folder_samples.h"

#include "network/config.h"
#include "network/grid_tensors.h"
#include "scene/error.h"
#include "scene/image_io.h"
#include "scene/random.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr double kSmallestCrop = 0.8;
constexpr double kJitter = 0.3;

fs::path MaskOf(const MaskedFolder& folder, const std::string& name) {
  return folder.mask_path / (name + ".png");
}

void CheckMask(const MaskedFolder& folder, const std::string& name) {
  const fs::path mask = MaskOf(folder, name);
  if (!fs::exists(mask)) {
    Fail(mask,
         "is missing",
         "a mask for every photo below " + folder.image_path.string(),
         "vgtw mask lint tells what a folder of masks lacks");
  }
  const ImageSize size = ReadImageSize(folder.image_path / name);
  const ImageSize mask_size = ReadImageSize(mask);
  if (mask_size != size) {
    const auto text = [](const ImageSize& s) {
      return std::to_string(s.width) + "x" + std::to_string(s.height);
    };
    Fail(mask, "is of " + text(mask_size) + " pixels", "its photo's " + text(size));
  }
}

struct Window {
  int64_t x = 0, y = 0, width = 0, height = 0;
};

// Of the shape width / height.
Window DrawWindow(const at::Tensor& image, double aspect, RandomStream& random) {
  const auto image_height = static_cast<double>(image.size(1));
  const auto image_width = static_cast<double>(image.size(2));
  const double scale = random.Uniform(kSmallestCrop, 1.0);
  const double width = scale * std::min(image_width, image_height * aspect);
  Window window;
  window.width = std::max<int64_t>(1, std::llround(width));
  window.height = std::clamp<int64_t>(std::llround(width / aspect), 1, image.size(1));
  window.x = static_cast<int64_t>(random.Uniform() *
                                  static_cast<double>(image.size(2) - window.width + 1));
  window.y = static_cast<int64_t>(random.Uniform() *
                                  static_cast<double>(image.size(1) - window.height + 1));
  return window;
}

at::Tensor Cut(const at::Tensor& image, const Window& window, int64_t height, int64_t width) {
  const at::Tensor part = image.slice(1, window.y, window.y + window.height)
                              .slice(2, window.x, window.x + window.width)
                              .unsqueeze(0);
  return at::_upsample_bilinear2d_aa(part, {height, width}, /*align_corners=*/false).squeeze(0);
}

// One for all views of a sample.
struct ColourChange {
  double brightness, contrast, saturation;

  explicit ColourChange(RandomStream& random)
      : brightness(random.Uniform(1.0 - kJitter, 1.0 + kJitter)),
        contrast(random.Uniform(1.0 - kJitter, 1.0 + kJitter)),
        saturation(random.Uniform(1.0 - kJitter, 1.0 + kJitter)) {}

  // image [3, H, W] in [0, 1].
  at::Tensor operator()(const at::Tensor& image) const {
    const at::Tensor brighter = image * brightness;
    const at::Tensor mean = brighter.mean();
    const at::Tensor contrasted = mean + (brighter - mean) * contrast;
    const at::Tensor grey = contrasted.mean(0, /*keepdim=*/true);
    return (grey + (contrasted - grey) * saturation).clamp(0.0, 1.0);
  }
};

}  // namespace

FolderSamples::FolderSamples(const FolderSampleOptions& options) : options_(options) {
  VGTW_CHECK(options.width % kPatchSize == 0 && options.height % kPatchSize == 0,
             "size of samples " + std::to_string(options.width) + "x" +
                 std::to_string(options.height) + ", must be multiples of 14");
  VGTW_CHECK(options.min_views >= 2 && options.max_views >= options.min_views, "views of samples");
  for (const MaskedFolder& folder : options.folders) {
    Scene scene{folder, ListImages(folder.image_path)};
    if (scene.names.size() < 2) {
      Fail(folder.image_path,
           "holds " + std::to_string(scene.names.size()) + " photo",
           "two or more of a scene");
    }
    for (const std::string& name : scene.names) CheckMask(folder, name);
    scenes_.push_back(std::move(scene));
  }
}

TrainingSample FolderSamples::Get(uint64_t idx) const {
  RandomStream random(HashKey({options_.seed, idx}));
  const Scene& scene = scenes_[random.Bits() % scenes_.size()];
  const auto max_views =
      std::min<size_t>(static_cast<size_t>(options_.max_views), scene.names.size());
  const auto min_views = std::min<size_t>(static_cast<size_t>(options_.min_views), max_views);
  const size_t num_views = min_views + random.Bits() % (max_views - min_views + 1);
  std::vector<std::string> names = scene.names;
  const ColourChange change_colours(random);
  const double aspect = static_cast<double>(options_.width) / options_.height;
  std::vector<at::Tensor> images, distractor;
  for (size_t view = 0; view < num_views; ++view) {
    std::swap(names[view], names[view + random.Bits() % (names.size() - view)]);
    const at::Tensor photo = ToTensor(ReadRgbImage(scene.folder.image_path / names[view]));
    const at::Tensor kept =
        ToTensor(ReadStaticMask(MaskOf(scene.folder, names[view]))).unsqueeze(0).to(at::kFloat) /
        255.0;
    const Window window = DrawWindow(photo, aspect, random);
    images.push_back(change_colours(Cut(photo, window, options_.height, options_.width)));
    distractor.push_back(1.0 - Cut(kept, window, options_.height, options_.width).squeeze(0));
  }
  TrainingSample sample;
  sample.images = at::stack(images);
  sample.distractor = at::stack(distractor).clamp(0.0, 1.0);
  return sample;
}

}  // namespace vgtw
