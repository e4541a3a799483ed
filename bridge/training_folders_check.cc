// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/training_folders.h"
#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

namespace vgtw {
namespace {

constexpr auto kNote = LintSeverity::kNote;
constexpr auto kWarning = LintSeverity::kWarning;
constexpr auto kError = LintSeverity::kError;

// A scene of which more is distractor has next to nothing static to hold views together.
constexpr double kNearlyAll = 0.95;

// Codes that LintMasks has, too, mean what they mean there; rules that it has and this table has
// not, do not matter for training.
constexpr LintRule kRules[] = {
    {"unusable-scene",
     kError,
     "the folder of its photos or of its masks cannot be used",
     "a folder of photos and one of masks of the same name for each scene"},
    {"few-photos",
     kError,
     "the scene has a single photo, while a sample is two or more views",
     "add photos, or remove the scene"},
    {"unreadable-photo", kError, "the photo cannot be read", "copy it again, or remove it"},
    {"masks-among-photos",
     kError,
     "the masks lie below the folder of photos and are taken for photos",
     "move them beside that folder"},
    {"missing-mask",
     kError,
     "the photo has no mask",
     "add a true one, or an all-white one if nothing moves (vgtw mask lint --fix)"},
    {"name-without-extension",
     kError,
     "the mask's name lacks the photo's extension",
     "name masks <photo name with extension>.png (vgtw mask lint --fix)"},
    {"misnamed-mask",
     kError,
     "a mask that could be the photo's has another case, sub-folder or extension",
     "name masks <photo name with extension>.png (vgtw mask lint --fix)"},
    {"other-convention", kError, "the mask is named for another tool", "vgtw mask convert"},
    {"unreadable-mask", kError, "the mask cannot be decoded", "make it again"},
    {"truncated-mask", kError, "the mask breaks off", "copy it again"},
    {"sixteen-bit-colour",
     kError,
     "the mask has colours of 16 bits",
     "write 8-bit gray (vgtw mask lint --fix)"},
    {"sixteen-bit-gray",
     kError,
     "the mask has gray values of 16 bits",
     "write 8-bit gray (vgtw mask lint --fix)"},
    {"rotated-mask",
     kError,
     "width and height are exchanged, as by a tool that turns photos upright",
     "turn the mask back as the photo is stored (vgtw mask lint --fix)"},
    {"scaled-mask",
     kError,
     "the mask has another size than the photo",
     "write it at the photo's size (vgtw mask lint --fix)"},
    {"wrong-size",
     kError,
     "the mask has neither the photo's size nor its shape",
     "make it again from this photo"},
    {"alpha-only",
     kWarning,
     "the mask is in the alpha channel, which is not read: the photo is learnt as all static or "
     "all "
     "distractor",
     "write 8-bit gray, 0 = distractor (vgtw mask lint --fix)"},
    {"alpha-ignored",
     kWarning,
     "the mask has an alpha channel that says something else than its colours, which are read",
     "write 8-bit gray, 0 = distractor"},
    {"colour-mask",
     kWarning,
     "the mask has colours: only those that are black are distractors",
     "write 8-bit gray, 0 = distractor"},
    {"soft-mask",
     kWarning,
     "the mask is not binary: every value but 0 is learnt as static",
     "cut it at a threshold (vgtw mask lint --fix: 128)"},
    {"maybe-inverted",
     kWarning,
     "the masks mark more than half of the typical photo as distractor: are they inverted?",
     "look at them (vgtw mask preview); vgtw mask lint --fix --invert exchanges 0 and 255"},
    {"nearly-all-distractor",
     kWarning,
     "more than 95 % of the scene is distractor: hardly anything static is left to learn from",
     "check the polarity: 0 is distractor; else remove the scene"},
    {"all-excluded",
     kWarning,
     "the whole photo is distractor",
     "check the mask, or remove the photo"},
    {"mostly-excluded",
     kWarning,
     "more than half of the photo is distractor, unlike most others",
     "check its polarity: 0 is distractor"},
    {"no-mask-excludes",
     kWarning,
     "no mask of the scene marks a distractor: that there are none is learnt",
     "nothing, if so meant; else check how they were made (0 is distractor)"},
    {"same-mask",
     kWarning,
     "photos share one and the same mask, which fits only what is fixed in the frame",
     "check whether it is a copy of another photo's"},
    {"orphan-mask", kWarning, "the mask belongs to no photo", "check its name, or remove it"},
    {"small-photo",
     kWarning,
     "the network sees more pixels than the photo has: it learns from enlarged photos",
     "use larger photos, or a smaller --width and --height"},
    {"unused-mask", kNote, "the photo has another mask, which is read", "remove one of the two"},
    {"turned-photo",
     kNote,
     "the photo's EXIF turns or mirrors it without changing its size; it is read as it is stored, "
     "and its mask must be made so",
     "look at it (vgtw mask preview)"},
};

const LintRule* FindRule(std::string_view code) {
  const auto rule = std::find_if(
      std::begin(kRules), std::end(kRules), [&](const LintRule& row) { return row.code == code; });
  return rule == std::end(kRules) ? nullptr : &*rule;
}

std::string Text(const ImageSize& size) {
  return std::to_string(size.width) + " x " + std::to_string(size.height);
}

class SceneChecker {
 public:
  SceneChecker(const TrainingScene& scene, const TrainingFolderOptions& options)
      : options_(options) {
    check_.scene = scene;
  }

  // `names` of its photos.
  SceneCheck Run(const std::vector<std::string>& names, const ProgressCallback& progress) {
    check_.num_photos = names.size();
    if (names.size() == 1) Add("few-photos", "");
    Lint();
    ReadPhotos(names, progress);
    std::stable_sort(check_.findings.begin(),
                     check_.findings.end(),
                     [](const LintFinding& a, const LintFinding& b) { return a.rule < b.rule; });
    if (check_.Count(kError) > 0) check_.distractor_share = std::nan("");
    return std::move(check_);
  }

 private:
  void Add(std::string_view code, const std::string& name, const std::string& detail = {}) {
    check_.findings.push_back({FindRule(code), name, detail});
  }

  void Lint() {
    LintReport report;
    try {
      LintMasksOptions options;
      options.num_threads = options_.num_threads;
      report = LintMasks(check_.scene.image_path, check_.scene.mask_path, options);
    } catch (const Error& error) {
      Add("unusable-scene", "", error.what());
      return;
    }
    for (const LintFinding& finding : report.findings) {
      // Photos are decoded below, not only their heads.
      if (finding.rule->code == "unreadable-photo") continue;
      if (FindRule(finding.rule->code) == nullptr) continue;
      Add(finding.rule->code, finding.name, finding.detail);
    }
    double sum = 0.0;
    for (const LintImage& image : report.images) {
      if (image.effect != MaskEffect::kUnused) ++check_.num_masks;
      sum += image.excluded_share;
    }
    check_.distractor_share = sum / static_cast<double>(report.images.size());
    if (check_.Count(kError) > 0 || !(check_.distractor_share > kNearlyAll)) return;
    Add("nearly-all-distractor",
        "",
        std::to_string(std::lround(100.0 * check_.distractor_share)) + " %");
  }

  void ReadPhotos(const std::vector<std::string>& names, const ProgressCallback& progress) {
    std::vector<std::optional<LintFinding>> findings(names.size());
    const auto read = [&](int64_t i) {
      const auto idx = static_cast<size_t>(i);
      findings[idx] = ReadPhoto(names[idx]);
    };
    ParallelFor(static_cast<int64_t>(names.size()), options_.num_threads, read, progress);
    for (const auto& finding : findings) {
      if (finding) check_.findings.push_back(*finding);
    }
  }

  std::optional<LintFinding> ReadPhoto(const std::string& name) const {
    ImageSize size;
    try {
      const RgbImage photo = ReadRgbImage(check_.scene.image_path / name);
      size = {static_cast<uint64_t>(photo.width()), static_cast<uint64_t>(photo.height())};
    } catch (const Error& error) {
      return LintFinding{FindRule("unreadable-photo"), name, error.what()};
    }
    // Then the largest cut of the network's shape has its size at least.
    if (static_cast<int>(size.width) >= options_.width &&
        static_cast<int>(size.height) >= options_.height) {
      return std::nullopt;
    }
    return LintFinding{FindRule("small-photo"),
                       name,
                       Text(size) + ", the network sees " + std::to_string(options_.width) + " x " +
                           std::to_string(options_.height)};
  }

  const TrainingFolderOptions& options_;
  SceneCheck check_;
};

}  // namespace

size_t SceneCheck::Count(LintSeverity severity) const {
  return static_cast<size_t>(
      std::count_if(findings.begin(), findings.end(), [&](const LintFinding& finding) {
        return finding.rule->severity == severity;
      }));
}

std::span<const LintRule> TrainingRules() { return kRules; }

std::vector<SceneCheck> CheckTrainingScenes(const std::vector<TrainingScene>& scenes,
                                            const TrainingFolderOptions& options,
                                            const ProgressCallback& progress) {
  options.Check();
  std::vector<std::vector<std::string>> names(scenes.size());
  int64_t num_photos = 0;
  for (size_t i = 0; i < scenes.size(); ++i) {
    try {
      names[i] = ListImages(scenes[i].image_path);
    } catch (const Error&) {  // LintMasks says why
    }
    num_photos += static_cast<int64_t>(names[i].size());
  }
  std::vector<SceneCheck> checks;
  int64_t num_done = 0;
  const auto report = [&](int64_t done, int64_t) {
    if (progress) progress(num_done + done, num_photos);
  };
  for (size_t i = 0; i < scenes.size(); ++i) {
    checks.push_back(SceneChecker(scenes[i], options).Run(names[i], report));
    num_done += static_cast<int64_t>(names[i].size());
  }
  return checks;
}

}  // namespace vgtw
