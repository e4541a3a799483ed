// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_lint_database.h"

#include "scene/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace vgtw {
namespace {

class EvidenceCollector {
 public:
  EvidenceCollector(const ColmapDatabase& database, const LintKeypointsByName& keypoints_by_name)
      : database_(database) {
    for (const auto& [name, keypoints] : keypoints_by_name) {
      images_.emplace(
          keypoints.image_id,
          Image{&keypoints, std::vector<bool>(keypoints.keypoints.rows), MinMotion(keypoints)});
    }
  }

  MatchEvidence Run() {
    for (const auto& [id1, id2] : database_.ReadMatchPairs()) {
      CountMatches(id1, id2, database_.ReadMatches(id1, id2), /*is_verified=*/false);
    }
    for (const auto& [id1, id2] : database_.ReadTwoViewPairs()) {
      const auto geometry = database_.ReadTwoViewGeometry(id1, id2);
      if (geometry) CountMatches(id1, id2, geometry->inlier_matches, /*is_verified=*/true);
    }
    for (const auto& [id, image] : images_) {
      const MatchEvidence::Image summary = Summarise(image);
      if (image.keypoints->is_evidence && IsEvidence(summary)) evidence_.images.push_back(summary);
    }
    return evidence_;
  }

 private:
  struct Image {
    const LintKeypoints* keypoints;
    std::vector<bool> is_verified;
    double min_motion_px;
  };

  // The extent of the keypoints stands for the photo's size, which a database need not know.
  static double MinMotion(const LintKeypoints& image) {
    constexpr double kMinMotion = 0.005;
    float extent = 0.0f;
    for (size_t i = 0; i < image.keypoints.rows; ++i) {
      extent = std::max({extent, image.keypoints.x(i), image.keypoints.y(i)});
    }
    return kMinMotion * static_cast<double>(extent);
  }

  Image& Get(ImageId id) {
    const auto image = images_.find(id);
    if (image == images_.end()) {
      Fail(database_.path(),
           "has matches of image " + std::to_string(id) + ", which is not there",
           "matches of its own images");
    }
    return image->second;
  }

  void CountMatches(ImageId id1, ImageId id2, const FeatureMatches& matches, bool is_verified) {
    if (matches.empty()) return;
    evidence_.has_matches = true;
    Image& image1 = Get(id1);
    Image& image2 = Get(id2);
    for (const auto& [idx1, idx2] : matches) {
      if (idx1 >= image1.is_verified.size() || idx2 >= image2.is_verified.size()) {
        Fail(database_.path(),
             "has a match of a keypoint that does not exist, between the images " +
                 std::to_string(id1) + " and " + std::to_string(id2),
             "matches of its own keypoints");
      }
      const bool is_excluded =
          image1.keypoints->is_excluded[idx1] || image2.keypoints->is_excluded[idx2];
      evidence_.num_matches_of_excluded += is_excluded ? 1 : 0;
      if (!is_verified) continue;
      const Keypoints& points1 = image1.keypoints->keypoints;
      const Keypoints& points2 = image2.keypoints->keypoints;
      const double motion_px =
          std::hypot(points1.x(idx1) - points2.x(idx2), points1.y(idx1) - points2.y(idx2));
      if (motion_px <= std::max(image1.min_motion_px, image2.min_motion_px)) continue;
      image1.is_verified[idx1] = true;
      image2.is_verified[idx2] = true;
    }
  }

  static MatchEvidence::Image Summarise(const Image& image) {
    MatchEvidence::Image summary;
    for (size_t i = 0; i < image.is_verified.size(); ++i) {
      VerifiedKeypoints& side = image.keypoints->is_excluded[i] ? summary.excluded : summary.kept;
      ++side.num_keypoints;
      side.num_verified += image.is_verified[i] ? 1 : 0;
    }
    return summary;
  }

  static bool IsEvidence(const MatchEvidence::Image& image) {
    constexpr uint64_t kMinKeypoints = 20;  // on either side
    constexpr uint64_t kMinVerified = 10;   // on both
    return std::min(image.kept.num_keypoints, image.excluded.num_keypoints) >= kMinKeypoints &&
           image.kept.num_verified + image.excluded.num_verified >= kMinVerified;
  }

  const ColmapDatabase& database_;
  std::map<ImageId, Image> images_;
  MatchEvidence evidence_;
};

// Scale and orientation, up to two thirds of the bytes, say nothing of masks.
Keypoints PositionsOf(const Keypoints& keypoints) {
  Keypoints positions{.rows = keypoints.rows, .cols = 2, .data = {}};
  positions.data.reserve(size_t{2} * keypoints.rows);
  for (size_t i = 0; i < keypoints.rows; ++i) {
    positions.data.push_back(keypoints.x(i));
    positions.data.push_back(keypoints.y(i));
  }
  return positions;
}

// Over all images.
MatchEvidence::Image Sum(const MatchEvidence& evidence) {
  MatchEvidence::Image sum;
  for (const MatchEvidence::Image& image : evidence.images) {
    sum.kept.num_keypoints += image.kept.num_keypoints;
    sum.kept.num_verified += image.kept.num_verified;
    sum.excluded.num_keypoints += image.excluded.num_keypoints;
    sum.excluded.num_verified += image.excluded.num_verified;
  }
  return sum;
}

}  // namespace

double VerifiedKeypoints::Rate() const {
  return num_keypoints == 0
             ? 0.0
             : static_cast<double>(num_verified) / static_cast<double>(num_keypoints);
}

LintKeypointsByName ReadLintKeypoints(const ColmapDatabase& database) {
  LintKeypointsByName keypoints_by_name;
  for (const DatabaseImage& image : database.ReadImages()) {
    LintKeypoints keypoints{.image_id = image.image_id};
    if (const auto read = database.ReadKeypoints(image.image_id)) {
      keypoints.keypoints = PositionsOf(*read);
    }
    keypoints.is_excluded.assign(keypoints.keypoints.rows, false);
    keypoints_by_name.emplace(image.name, std::move(keypoints));
  }
  return keypoints_by_name;
}

MatchEvidence CollectMatchEvidence(const ColmapDatabase& database,
                                   const LintKeypointsByName& keypoints_by_name) {
  return EvidenceCollector(database, keypoints_by_name).Run();
}

std::string Describe(const MatchEvidence& evidence) {
  const auto [kept, excluded] = Sum(evidence);
  std::array<char, 128> text = {};
  std::snprintf(text.data(),
                text.size(),
                "%.1f %% of kept and %.1f %% of excluded features are verified",
                100.0 * kept.Rate(),
                100.0 * excluded.Rate());
  return text.data();
}

bool ProvesInversion(const MatchEvidence& evidence) {
  constexpr uint64_t kMinVerified = 100;
  constexpr size_t kMinImages = 3;
  constexpr double kMinRatio = 2.0;
  const auto num_inverted = static_cast<size_t>(std::count_if(
      evidence.images.begin(), evidence.images.end(), [](const MatchEvidence::Image& image) {
        return image.excluded.Rate() > image.kept.Rate();
      }));
  const auto [kept, excluded] = Sum(evidence);
  return evidence.images.size() >= kMinImages && 4 * num_inverted >= 3 * evidence.images.size() &&
         excluded.num_verified >= kMinVerified && excluded.Rate() >= kMinRatio * kept.Rate();
}

}  // namespace vgtw
