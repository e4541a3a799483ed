// SPDX-License-Identifier: BSD-3-Clause
// What a database says about masks: which features they leave, and which side of them fits the
// scene. Not a door.
#pragma once

#include "bridge/colmap_database.h"
#include "bridge/mask_lint.h"
#include "scene/distractor_mask.h"

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace vgtw {

// The keypoints of one image of a database.
struct LintKeypoints {
  ImageId image_id = 0;
  Keypoints keypoints = {};            // x and y alone
  std::vector<bool> is_excluded = {};  // as long as them
  bool is_evidence = false;            // the mask has the photo's size, so that it can be judged
};

using LintKeypointsByName = std::map<std::string, LintKeypoints>;

// Nothing is excluded yet.
LintKeypointsByName ReadLintKeypoints(const ColmapDatabase& database);

// Of the keypoints that a mask keeps, or excludes, how many take part in verified matches.
struct VerifiedKeypoints {
  uint64_t num_keypoints = 0;
  uint64_t num_verified = 0;

  double Rate() const;  // 0 without keypoints
};

struct MatchEvidence {
  struct Image {
    VerifiedKeypoints kept;
    VerifiedKeypoints excluded;
  };
  // Those with is_evidence, 20 keypoints on either side and 10 verified ones in all.
  std::vector<Image> images;
  bool has_matches = false;
  uint64_t num_matches_of_excluded = 0;  // rows of matches and of inlier matches
};

// Only inlier matches that move by more than 0.5 % of the photo's longer side count as verified:
// what stands still in the frame fits any geometry of a camera that does. Throws Error if a match
// names a keypoint that does not exist.
MatchEvidence CollectMatchEvidence(const ColmapDatabase& database,
                                   const LintKeypointsByName& keypoints_by_name);

// "12.3 % of kept and 4.5 % of excluded features are verified"
std::string Describe(const MatchEvidence& evidence);

// Whether excluded keypoints are verified at least twice as often as kept ones, over all images
// and, with the same sign, in three of four; false for want of evidence: fewer than 3 images, or
// fewer than 100 verified keypoints.
bool ProvesInversion(const MatchEvidence& evidence);

}  // namespace vgtw
