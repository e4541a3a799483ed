// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_photos.h"

#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>

namespace vgtw {
namespace {

std::string_view BaseName(std::string_view name) {
  const size_t slash = name.rfind('/');
  return slash == std::string_view::npos ? name : name.substr(slash + 1);
}

std::string_view WithoutExtension(std::string_view name) {
  const size_t dot = name.rfind('.');
  const size_t slash = name.rfind('/');
  const bool has_extension =
      dot != std::string_view::npos && (slash == std::string_view::npos || dot > slash);
  return has_extension ? name.substr(0, dot) : name;
}

void AddSpelling(std::map<std::string, std::optional<size_t>, std::less<>>& spellings,
                 std::string_view spelling,
                 size_t photo_idx) {
  const auto [entry, is_new] = spellings.emplace(spelling, photo_idx);
  if (!is_new) entry->second.reset();
}

// "a, b, c, ..." of at most three.
std::string SomeOf(const std::vector<std::string>& names) {
  constexpr size_t kMaxNames = 3;
  std::string text;
  for (size_t i = 0; i < std::min(kMaxNames, names.size()); ++i) {
    text += (i == 0 ? "" : ", ") + Printable(names[i]);
  }
  return names.size() > kMaxNames ? text + ", ..." : text;
}

}  // namespace

std::vector<Photo> ListPhotos(const std::filesystem::path& image_folder, int num_threads) {
  const std::vector<std::string> names = ListImages(image_folder);
  std::vector<Photo> photos(names.size());
  ParallelFor(static_cast<int64_t>(names.size()), num_threads, [&](int64_t i) {
    const std::string& name = names[static_cast<size_t>(i)];
    photos[static_cast<size_t>(i)] = {name, ReadImageSize(image_folder / name)};
  });
  return photos;
}

PhotoIndex::PhotoIndex(const std::vector<Photo>& photos) : photos_(photos) {
  for (size_t i = 0; i < photos.size(); ++i) {
    const std::string_view name = photos[i].name;
    AddSpelling(names_, name, i);
    AddSpelling(base_names_, BaseName(name), i);
    AddSpelling(stems_, WithoutExtension(name), i);
    AddSpelling(base_stems_, WithoutExtension(BaseName(name)), i);
  }
}

std::optional<size_t> PhotoIndex::Find(std::string_view name, bool without_extension) const {
  const auto find = [](const Spellings& spellings, std::string_view spelling) {
    const auto entry = spellings.find(spelling);
    return entry == spellings.end() ? std::nullopt : entry->second;
  };
  if (const auto idx = find(names_, name)) return idx;
  if (const auto idx = find(base_names_, BaseName(name))) return idx;
  if (!without_extension) return std::nullopt;
  if (const auto idx = find(stems_, name)) return idx;
  return find(base_stems_, BaseName(name));
}

std::vector<size_t> PhotoIndex::FindAll(const std::filesystem::path& path,
                                        const std::vector<std::string>& names,
                                        bool without_extension) const {
  std::vector<size_t> photo_indices;
  std::vector<std::string> missing;
  std::map<size_t, std::string> name_by_photo;
  for (const std::string& name : names) {
    const std::optional<size_t> idx = Find(name, without_extension);
    if (!idx) {
      missing.push_back(name);
      continue;
    }
    const auto [entry, is_new] = name_by_photo.emplace(*idx, name);
    if (!is_new) {
      Fail(path,
           "'" + Printable(entry->second) + "' and '" + Printable(name) +
               "' both mean the photo '" + Printable(photos_[*idx].name) + "'",
           "one entry a photo");
    }
    photo_indices.push_back(*idx);
  }
  if (!missing.empty()) {
    Fail(path,
         std::to_string(missing.size()) + " of " + std::to_string(names.size()) +
             " names match no photo or several (" + SomeOf(missing) + ")",
         "names of the photos (" + SomeOf({photos_.front().name, photos_.back().name}) + ")",
         "check --image_path");
  }
  return photo_indices;
}

}  // namespace vgtw
