// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_lint.h"

#include "bridge/import_photos.h"
#include "bridge/mask_files.h"
#include "bridge/mask_lint_content.h"
#include "bridge/mask_lint_database.h"
#include "bridge/mask_lint_names.h"
#include "bridge/mask_lint_rules.h"
#include "scene/error.h"
#include "scene/image_io.h"
#include "scene/parallel.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// A typical photo of which more is excluded leaves little to reconstruct from.
constexpr double kSuspectShare = 0.5;

std::string OfHowMany(size_t part, size_t all) {
  return std::to_string(part) + " of " + std::to_string(all);
}

// What judgements of the whole folder need of one mask.
struct JudgedMask {
  double share = std::numeric_limits<double>::quiet_NaN();  // excluded, of masks of photo's size
  size_t fingerprint = 0;
};

class Linter {
 public:
  Linter(const fs::path& image_folder, const fs::path& mask_folder, const LintMasksOptions& options)
      : image_folder_(image_folder),
        mask_folder_(mask_folder),
        options_(options),
        behaviour_(BehaviourOf(options.colmap_version)) {
    if (options.database_path.empty()) return;
    database_.emplace(options.database_path, ColmapDatabase::Mode::kReadOnly);
    keypoints_by_name_ = ReadLintKeypoints(*database_);
  }

  LintReport Run(const ProgressCallback& progress) {
    ListPhotos();
    MatchMaskNames(mask_folder_, behaviour_, report_.images, report_.findings);
    InspectAll(progress);
    FindSameMasks();
    if (database_) JudgeDatabase();
    JudgeCoverage();
    std::stable_sort(report_.findings.begin(),
                     report_.findings.end(),
                     [](const LintFinding& a, const LintFinding& b) { return a.rule < b.rule; });
    return std::move(report_);
  }

 private:
  void Add(LintCode code, const std::string& name, const std::string& detail = {}) {
    report_.findings.push_back(MakeFinding(code, name, detail));
  }

  void ListPhotos() {
    const std::vector<std::string> names = ListImages(image_folder_);
    std::error_code code;
    if (fs::equivalent(image_folder_, mask_folder_, code) && !code) {
      Fail(mask_folder_,
           "is also the folder of photos: COLMAP takes every mask in it for a photo",
           "a folder of masks alone",
           "use vgtw mask convert");
    }
    const bool is_below = IsInFolder(image_folder_, mask_folder_);
    size_t num_masks = 0;
    for (const std::string& name : names) {
      if (is_below && IsInFolder(mask_folder_, image_folder_ / name)) {
        ++num_masks;
        continue;
      }
      report_.images.emplace_back().name = name;
    }
    if (report_.images.empty()) Fail(image_folder_, "holds masks only", "photos");
    if (num_masks > 0) {
      Add(LintCode::kMasksAmongPhotos,
          "",
          OfHowMany(num_masks, names.size()) + " \"photos\" are masks");
    }
  }

  void InspectAll(const ProgressCallback& progress) {
    const size_t num_images = report_.images.size();
    judged_.resize(num_images);
    std::vector<std::vector<LintFinding>> findings(num_images);
    const auto inspect = [&](int64_t i) {
      const auto idx = static_cast<size_t>(i);
      Inspect(report_.images[idx], judged_[idx], findings[idx]);
    };
    ParallelFor(static_cast<int64_t>(num_images), options_.num_threads, inspect, progress);
    for (const auto& of_image : findings) {
      report_.findings.insert(report_.findings.end(), of_image.begin(), of_image.end());
    }
    for (LintImage& image : report_.images) {
      if (image.effect == MaskEffect::kPhotoDropped) {
        image.excluded_share = std::numeric_limits<double>::quiet_NaN();
      }
    }
  }

  // Runs in several threads at once, for different images.
  void Inspect(LintImage& image, JudgedMask& judged, std::vector<LintFinding>& findings) {
    const fs::path photo_path = image_folder_ / image.name;
    ImageSize size;
    try {
      size = ReadImageSize(photo_path);
    } catch (const Error& error) {
      findings.push_back(MakeFinding(LintCode::kUnreadablePhoto, image.name, error.what()));
      image.effect = MaskEffect::kPhotoDropped;
      return;
    }
    const auto keypoints = keypoints_by_name_.find(image.name);
    image.is_in_database = keypoints != keypoints_by_name_.end();
    if (image.is_in_database) image.num_keypoints = keypoints->second.keypoints.rows;
    if (image.mask_names.empty() || image.convention != nullptr) return;
    const MaskInspection inspection = InspectMask(
        photo_path, size, mask_folder_ / image.mask_names.front(), behaviour_, image, findings);
    judged.fingerprint = inspection.fingerprint;
    if (inspection.has_photo_size) judged.share = ExcludedShare(inspection.static_mask);
    if (image.is_in_database && !inspection.static_mask.empty()) {
      TestKeypoints(inspection, keypoints->second);
      if (image.effect != MaskEffect::kApplied) return;
      const auto& is_excluded = keypoints->second.is_excluded;
      image.num_excluded_keypoints =
          static_cast<uint64_t>(std::count(is_excluded.begin(), is_excluded.end(), true));
    }
  }

  static void TestKeypoints(const MaskInspection& inspection, LintKeypoints& image) {
    for (size_t i = 0; i < image.is_excluded.size(); ++i) {
      image.is_excluded[i] =
          IsExcluded(inspection.static_mask, image.keypoints.x(i), image.keypoints.y(i));
    }
    image.is_evidence = inspection.has_photo_size;
  }

  void FindSameMasks() {
    std::map<size_t, std::vector<const std::string*>> names_by_fingerprint;
    for (size_t i = 0; i < judged_.size(); ++i) {
      if (judged_[i].fingerprint == 0) continue;
      names_by_fingerprint[judged_[i].fingerprint].push_back(&report_.images[i].name);
    }
    for (const auto& [fingerprint, names] : names_by_fingerprint) {
      if (names.size() < 2) continue;
      Add(LintCode::kSameMask,
          *names.front(),
          "and " + *names[1] +
              (names.size() > 2 ? " and " + std::to_string(names.size() - 2) + " more" : ""));
    }
  }

  void JudgeCoverage() {
    std::vector<double> shares;  // of masks that tell their polarity
    bool excludes_any = false;
    bool has_any = false;
    for (const JudgedMask& judged : judged_) {
      if (std::isnan(judged.share)) continue;
      has_any = true;
      excludes_any |= judged.share > 0.0;
      if (judged.share > 0.0 && judged.share < 1.0) shares.push_back(judged.share);
    }
    if (has_any && !excludes_any) Add(LintCode::kNoMaskExcludes, "");
    if (shares.empty()) return;
    const double median = Median(shares);
    const std::string percent = std::to_string(std::lround(100.0 * median)) + " %";
    if (median > kSuspectShare) {
      report_.is_inverted = evidence_ && ProvesInversion(*evidence_);
      Add(report_.is_inverted ? LintCode::kInvertedMasks : LintCode::kMaybeInverted,
          "",
          "the median mask excludes " + percent + (evidence_ ? ", " + Describe(*evidence_) : ""));
      return;
    }
    for (size_t i = 0; i < judged_.size(); ++i) {
      if (judged_[i].share <= kSuspectShare || judged_[i].share == 1.0) continue;
      if (std::isnan(judged_[i].share)) continue;
      Add(LintCode::kMostlyExcluded,
          report_.images[i].name,
          std::to_string(std::lround(100.0 * judged_[i].share)) + " %, the median mask " + percent);
    }
  }

  void JudgeDatabase() {
    std::vector<Photo> photos;
    for (const LintImage& image : report_.images) photos.push_back({image.name, {}});
    const PhotoIndex index(photos);
    size_t num_unknown = 0;
    std::string first_unknown;
    for (const auto& [name, keypoints] : keypoints_by_name_) {
      const auto found = index.Find(name, /*without_extension=*/true);
      if (found && photos[*found].name == name) continue;
      if (num_unknown++ > 0) continue;
      first_unknown = name + (found ? ", while there is a photo " + photos[*found].name : "");
    }
    if (num_unknown > 0) {
      Add(LintCode::kUnknownDatabaseImage,
          "",
          OfHowMany(num_unknown, keypoints_by_name_.size()) + " images, the first " +
              first_unknown);
    }
    const auto num_new = static_cast<size_t>(
        std::count_if(report_.images.begin(), report_.images.end(), [](const LintImage& image) {
          return !image.is_in_database;
        }));
    if (num_new > 0) {
      Add(LintCode::kPhotoNotInDatabase, "", OfHowMany(num_new, report_.images.size()));
    }
    evidence_ = CollectMatchEvidence(*database_, keypoints_by_name_);
    JudgeFeatures();
  }

  void JudgeFeatures() {
    uint64_t num_keypoints = 0;
    uint64_t num_excluded = 0;
    for (const LintImage& image : report_.images) {
      num_keypoints += image.num_keypoints;
      num_excluded += image.num_excluded_keypoints;
    }
    if (num_excluded == 0) return;
    const bool do_harm = !evidence_->has_matches || evidence_->num_matches_of_excluded > 0;
    Add(do_harm ? LintCode::kMasksTooLate : LintCode::kExcludedUnmatched,
        "",
        OfHowMany(num_excluded, num_keypoints) + " features, " +
            std::to_string(evidence_->num_matches_of_excluded) + " rows of matches");
  }

  const fs::path& image_folder_;
  const fs::path& mask_folder_;
  const LintMasksOptions& options_;
  const MaskBehaviour behaviour_;
  std::optional<ColmapDatabase> database_;
  LintKeypointsByName keypoints_by_name_;
  std::vector<JudgedMask> judged_;  // as report_.images
  std::optional<MatchEvidence> evidence_;
  LintReport report_;
};

}  // namespace

LintReport LintMasks(const fs::path& image_folder,
                     const fs::path& mask_folder,
                     const LintMasksOptions& options,
                     const ProgressCallback& progress) {
  return Linter(image_folder, mask_folder, options).Run(progress);
}

}  // namespace vgtw
