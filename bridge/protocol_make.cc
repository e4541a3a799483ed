// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/protocol_make.h"

#include "scene/error.h"
#include "scene/random.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace vgtw {
namespace {

struct RankedImage {
  uint64_t rank = 0;
  std::string name;
  bool is_clean = false;

  bool operator<(const RankedImage& other) const {
    return std::tie(rank, name) < std::tie(other.rank, other.name);
  }
};

uint64_t RankOf(const std::string& name, uint64_t seed) {
  const size_t dot = name.rfind('.');
  uint64_t key = HashKey({seed});
  for (const char c : name.substr(0, dot)) key = HashKey({key, static_cast<unsigned char>(c)});
  return key;
}

std::vector<RankedImage> Ranked(const std::vector<std::string>& names,
                                bool is_clean,
                                uint64_t seed) {
  std::vector<RankedImage> images;
  for (const std::string& name : names) images.push_back({RankOf(name, seed), name, is_clean});
  std::sort(images.begin(), images.end());
  return images;
}

void Truncate(std::vector<RankedImage>& images, size_t size) {
  images.resize(std::min(images.size(), size));
}

std::vector<std::string> SortedNames(const std::vector<RankedImage>& images) {
  std::vector<std::string> names;
  for (const RankedImage& image : images) names.push_back(image.name);
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<RankedImage> DrawMixed(const std::vector<RankedImage>& clean,
                                   const std::vector<RankedImage>& clutter,
                                   const ProtocolSampling& sampling) {
  std::vector<RankedImage> drawn;
  std::merge(clean.begin(), clean.end(), clutter.begin(), clutter.end(), std::back_inserter(drawn));
  Truncate(drawn, sampling.num_images);
  size_t num_clean = static_cast<size_t>(
      std::count_if(drawn.begin(), drawn.end(), [](const auto& image) { return image.is_clean; }));
  const size_t wanted =
      std::min({clean.size(), drawn.size(), static_cast<size_t>(sampling.min_shared_images)});
  while (num_clean < wanted) {
    // The drawn clean images are the first of `clean`.
    const auto last_clutter = std::find_if(
        drawn.rbegin(), drawn.rend(), [](const auto& image) { return !image.is_clean; });
    *last_clutter = clean[num_clean++];
  }
  return drawn;
}

}  // namespace

DrawnImages DrawImages(const std::vector<std::string>& clean_names,
                       const std::vector<std::string>& clutter_names,
                       const ProtocolSampling& sampling) {
  std::vector<RankedImage> clean = Ranked(clean_names, /*is_clean=*/true, sampling.seed);
  const std::vector<RankedImage> clutter = Ranked(clutter_names, /*is_clean=*/false, sampling.seed);
  std::vector<RankedImage> test = sampling.test_images == "mixed"
                                      ? DrawMixed(clean, clutter, sampling)
                                      : (sampling.test_images == "clean" ? clean : clutter);
  Truncate(test, sampling.num_images);
  if (sampling.num_clean_images > 0) {
    // Test images among the clean ones come first, whatever their rank.
    std::stable_partition(clean.begin(), clean.end(), [&](const RankedImage& image) {
      return std::any_of(
          test.begin(), test.end(), [&](const auto& drawn) { return drawn.name == image.name; });
    });
    const auto num_shared = static_cast<size_t>(
        std::count_if(test.begin(), test.end(), [](const auto& image) { return image.is_clean; }));
    Truncate(clean, std::max<size_t>(num_shared, sampling.num_clean_images));
  }
  return {SortedNames(test), SortedNames(clean)};
}

std::vector<ProtocolScene> MakeProtocolScenes(const std::vector<DatasetScene>& scenes,
                                              const ProtocolSampling& sampling) {
  std::vector<ProtocolScene> made;
  for (const DatasetScene& scene : scenes) {
    DrawnImages drawn = DrawImages(scene.clean, scene.clutter, sampling);
    if (drawn.test.size() < 2) {
      Fail(scene.image_path,
           "has " + std::to_string(drawn.test.size()) + " photos to draw from for --test_images " +
               sampling.test_images,
           "at least 2",
           "give another --test_images");
    }
    ProtocolScene scene_made;
    scene_made.name = scene.name;
    scene_made.title = scene.title;
    scene_made.group = scene.group;
    scene_made.image_path = scene.image_path;
    scene_made.test_images = std::move(drawn.test);
    scene_made.clean_images = std::move(drawn.clean);
    scene_made.mask_path = scene.mask_path;
    scene_made.mask_convention = scene.mask_convention;
    scene_made.pose_reference_path = scene.pose_path;
    made.push_back(std::move(scene_made));
  }
  return made;
}

}  // namespace vgtw
