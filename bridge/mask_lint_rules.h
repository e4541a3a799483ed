// SPDX-License-Identifier: BSD-3-Clause
// The rows of the table of rules by name. Not a door.
#pragma once

#include "bridge/mask_lint.h"

#include <string>

namespace vgtw {

// In the order of the table.
enum class LintCode {
  kUnreadablePhoto,
  kMasksAmongPhotos,
  kMissingMask,
  kMissingMaskDrops,
  kWithoutExtension,
  kNeedsNewerColmap,
  kMisnamedMask,
  kOtherConvention,
  kOrphanMask,
  kUnusedMask,
  kUnreadableMask,
  kTruncatedMask,
  kSixteenBitColour,
  kSixteenBitGray,
  kAlphaOnly,
  kAlphaIgnored,
  kColourMask,
  kSoftMask,
  kRotatedMask,
  kScaledMask,
  kWrongSize,
  kTurnedPhoto,
  kAllExcluded,
  kNothingExcluded,
  kNoMaskExcludes,
  kMostlyExcluded,
  kMaybeInverted,
  kInvertedMasks,
  kSameMask,
  kUnknownDatabaseImage,
  kPhotoNotInDatabase,
  kMasksTooLate,
  kExcludedUnmatched,
  kCount
};

const LintRule& RuleOf(LintCode code);

LintFinding MakeFinding(LintCode code, std::string name, std::string detail = {});

}  // namespace vgtw
