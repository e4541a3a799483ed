// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// A photo on disk: its name below the image folder and its size as stored.
struct Photo {
  std::string name;
  ImageSize size;
};

// The photos of a folder, sorted by name. Throws Error if there is none or one is damaged.
std::vector<Photo> ListPhotos(const std::filesystem::path& image_folder, int num_threads);

// Finds the photo that a file means by a name.
class PhotoIndex {
 public:
  explicit PhotoIndex(const std::vector<Photo>& photos);

  // Index of the photo with this very name; else of the only one with this base name; else, if
  // `without_extension`, of the only one with this name or base name without its extension.
  std::optional<size_t> Find(std::string_view name, bool without_extension = false) const;

  // The same for all names. Throws Error that names some of those not found, or two that mean the
  // same photo; `path` is the file that gives the names.
  std::vector<size_t> FindAll(const std::filesystem::path& path,
                              const std::vector<std::string>& names,
                              bool without_extension = false) const;

 private:
  // Of each spelling the photo, or nullopt where several photos share it.
  using Spellings = std::map<std::string, std::optional<size_t>, std::less<>>;

  const std::vector<Photo>& photos_;
  Spellings names_;
  Spellings base_names_;
  Spellings stems_;       // name without extension
  Spellings base_stems_;  // base name without extension
};

}  // namespace vgtw
