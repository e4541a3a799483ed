// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_lint_names.h"

#include "bridge/mask_lint_rules.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <set>
#include <tuple>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

std::string Lower(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

// Without the extension of the last component.
std::string Stem(const std::string& name) {
  const size_t dot = name.rfind('.');
  const size_t slash = name.rfind('/');
  const bool has_extension =
      dot != std::string::npos && (slash == std::string::npos || dot > slash + 1);
  return has_extension ? name.substr(0, dot) : name;
}

std::string BaseName(const std::string& name) { return name.substr(name.rfind('/') + 1); }

bool IsImageFile(const std::string& name) {
  static const std::set<std::string> kExtensions = {
      ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".pgm", ".webp", ".gif"};
  return kExtensions.contains(Lower(fs::path(name).extension().string()));
}

// The image files below a folder, relative with '/', sorted; also in hidden folders, where
// RealityCapture looks for them.
std::set<std::string> ListMaskFiles(const fs::path& mask_folder) {
  if (!fs::is_directory(mask_folder)) Fail(mask_folder, "is not a folder", "a folder of masks");
  std::set<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(mask_folder)) {
    const std::string name = entry.path().lexically_relative(mask_folder).generic_string();
    const bool is_hidden = BaseName(name).starts_with(".");
    if (entry.is_regular_file() && !is_hidden && IsImageFile(name)) names.insert(name);
  }
  return names;
}

// The names under which COLMAP looks for a photo's mask, in its order.
std::vector<std::string> ColmapNames(const MaskBehaviour& behaviour, const std::string& name) {
  std::vector<std::string> names = {name + ".png"};
  if (behaviour.reads_own_name && Lower(name).ends_with(".png")) names.push_back(name);
  if (behaviour.replaces_extension) names.push_back(Stem(name) + ".png");
  return names;
}

constexpr MaskBehaviour kNewestBehaviour = {.drops_without_mask = true,
                                            .reads_own_name = true,
                                            .replaces_extension = true,
                                            .reads_with_newer_codec = true};

class NameMatcher {
 public:
  NameMatcher(const fs::path& mask_folder,
              const MaskBehaviour& behaviour,
              std::vector<LintImage>& images,
              std::vector<LintFinding>& findings)
      : mask_folder_(mask_folder),
        behaviour_(behaviour),
        files_(ListMaskFiles(mask_folder)),
        images_(images),
        findings_(findings) {}

  void Run() {
    for (LintImage& image : images_) MatchAsColmap(image);
    MatchOtherConvention();
    MatchNearNames();
    for (LintImage& image : images_) {
      if (image.mask_names.empty()) {
        Add(behaviour_.drops_without_mask ? LintCode::kMissingMaskDrops : LintCode::kMissingMask,
            image.name);
      }
      if (image.effect == MaskEffect::kUnused && behaviour_.drops_without_mask) {
        image.effect = MaskEffect::kPhotoDropped;
      }
    }
    AddLeftFiles();
  }

 private:
  void Add(LintCode code, const std::string& name, const std::string& detail = {}) {
    findings_.push_back(MakeFinding(code, name, detail));
  }

  void Take(LintImage& image, const std::string& file) {
    image.mask_names.push_back(file);
    taken_.insert(file);
  }

  void MatchAsColmap(LintImage& image) {
    for (const std::string& file : ColmapNames(behaviour_, image.name)) {
      if (!files_.contains(file)) continue;
      Take(image, file);
      image.effect = MaskEffect::kApplied;
      if (file != image.name + ".png") Add(LintCode::kNeedsNewerColmap, image.name, file);
      return;
    }
    for (const std::string& file : ColmapNames(kNewestBehaviour, image.name)) {
      if (!files_.contains(file)) continue;
      Take(image, file);
      Add(LintCode::kWithoutExtension, image.name, file);
      return;
    }
  }

  // Only conventions whose names say "mask": others (a.jpg for a.jpg) tell a tool, and with it a
  // polarity, too weakly.
  const MaskConvention* GuessTellingConvention(const std::vector<std::string>& names) const {
    const MaskConvention* best = nullptr;
    size_t max_found = 0;
    for (const auto& [convention, num_found] : CountMasks(mask_folder_, names)) {
      if (num_found <= max_found ||
          convention->patterns[0].find("mask") == std::string_view::npos) {
        continue;
      }
      best = convention;
      max_found = num_found;
    }
    return best;
  }

  void MatchOtherConvention() {
    std::vector<std::string> names;
    bool has_all = true;
    for (const LintImage& image : images_) {
      names.push_back(image.name);
      has_all &= !image.mask_names.empty();
    }
    if (has_all) return;
    const MaskConvention* convention = GuessTellingConvention(names);
    if (convention == nullptr) return;
    std::vector<std::vector<fs::path>> found;
    try {
      found = FindMasks(*convention, mask_folder_, names);
    } catch (const Error&) {  // two photos share a mask: nobody can tell whose it is
      return;
    }
    for (size_t i = 0; i < images_.size(); ++i) {
      if (!images_[i].mask_names.empty() || found[i].empty()) continue;
      images_[i].convention = convention;
      for (const fs::path& path : found[i]) {
        Take(images_[i], path.lexically_relative(mask_folder_).generic_string());
      }
      Add(LintCode::kOtherConvention,
          images_[i].name,
          images_[i].mask_names.front() + ", as for " + std::string(convention->tool) +
              " (--from " + std::string(convention->id) + ")");
    }
  }

  // Files and photos by what is left of their names without folder, case and extension: where both
  // sides are unique, they belong together.
  void MatchNearNames() {
    std::map<std::string, std::vector<const std::string*>> files_by_key;
    for (const std::string& file : files_) {
      if (!taken_.contains(file)) files_by_key[Lower(BaseName(Stem(file)))].push_back(&file);
    }
    std::map<std::string, int> num_photos_by_key;
    for (const LintImage& image : images_) {
      ++num_photos_by_key[Lower(BaseName(image.name))];
      ++num_photos_by_key[Lower(BaseName(Stem(image.name)))];
    }
    for (LintImage& image : images_) {
      if (!image.mask_names.empty()) continue;
      for (const std::string& name : {image.name, Stem(image.name)}) {
        const std::string key = Lower(BaseName(name));
        const auto files = files_by_key.find(key);
        if (files == files_by_key.end() || files->second.size() != 1) continue;
        if (num_photos_by_key[key] != 1) continue;
        Take(image, *files->second.front());
        Add(LintCode::kMisnamedMask, image.name, *files->second.front());
        break;
      }
    }
  }

  void AddLeftFiles() {
    std::map<std::string, const std::string*> owner_by_file;
    for (const LintImage& image : images_) {
      for (const std::string& file : ColmapNames(kNewestBehaviour, image.name)) {
        owner_by_file[file] = &image.name;
      }
    }
    for (const std::string& file : files_) {
      if (taken_.contains(file)) continue;
      const auto owner = owner_by_file.find(file);
      if (owner == owner_by_file.end()) {
        Add(LintCode::kOrphanMask, file);
      } else {
        Add(LintCode::kUnusedMask, file, "of " + *owner->second);
      }
    }
  }

  const fs::path& mask_folder_;
  const MaskBehaviour& behaviour_;
  const std::set<std::string> files_;
  std::vector<LintImage>& images_;
  std::vector<LintFinding>& findings_;
  std::set<std::string> taken_;  // files that are some photo's
};

}  // namespace

MaskBehaviour BehaviourOf(std::string_view version) {
  int major = 0;
  int minor = 0;
  const std::string text(version);
  const int num_read = std::sscanf(text.c_str(), "%d.%d", &major, &minor);
  if (num_read < 1 || major < 3 || (num_read < 2 && major == 3) || (major == 3 && minor < 8)) {
    throw Error("COLMAP version '" + Printable(version) + "', expected 3.8 or newer");
  }
  const auto is_from = [&](int from_major, int from_minor) {
    return std::tie(major, minor) >= std::tie(from_major, from_minor);
  };
  return {.drops_without_mask = is_from(3, 12),
          .reads_own_name = is_from(3, 12),
          .replaces_extension = is_from(3, 13),
          .reads_with_newer_codec = is_from(4, 0)};
}

void MatchMaskNames(const fs::path& mask_folder,
                    const MaskBehaviour& behaviour,
                    std::vector<LintImage>& images,
                    std::vector<LintFinding>& findings) {
  NameMatcher(mask_folder, behaviour, images, findings).Run();
}

}  // namespace vgtw
