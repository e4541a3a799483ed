// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_lint_rules.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace vgtw {
namespace {

constexpr auto kNote = LintSeverity::kNote;
constexpr auto kWarning = LintSeverity::kWarning;
constexpr auto kError = LintSeverity::kError;

constexpr LintRule kRules[] = {
    {"unreadable-photo", kError, "the photo cannot be read", "copy it again, or remove it"},
    {"masks-among-photos",
     kError,
     "the masks lie below the folder of photos: COLMAP takes each of them for a photo",
     "move them beside that folder"},
    {"missing-mask",
     kWarning,
     "there is no mask: COLMAP before 3.12 uses the whole photo and does not say so, from 3.12 on "
     "it drops the photo",
     "add an all-white mask (--fix), or a true one"},
    {"missing-mask-drops",
     kError,
     "there is no mask: COLMAP from 3.12 on drops the photo",
     "add an all-white mask (--fix), or a true one"},
    {"name-without-extension",
     kError,
     "the mask's name lacks the photo's extension, which only newer versions of COLMAP accept",
     "name masks <photo name with extension>.png (--fix)"},
    {"name-needs-newer",
     kNote,
     "the mask's name lacks the photo's extension: this version of COLMAP finds it, 3.8 does not",
     "name masks <photo name with extension>.png (--fix)"},
    {"misnamed-mask",
     kError,
     "a mask that could be the photo's has another case, sub-folder or extension: COLMAP does not "
     "find it",
     "name masks <photo name with extension>.png (--fix)"},
    {"other-convention",
     kError,
     "the mask is named for another tool: COLMAP does not find it",
     "vgtw mask convert, or --fix"},
    {"orphan-mask",
     kWarning,
     "the file belongs to no photo: COLMAP never reads it",
     "check its name, or remove it"},
    {"unused-mask",
     kNote,
     "the photo has another mask, which COLMAP takes instead",
     "remove one of the two"},
    {"unreadable-mask",
     kError,
     "the mask cannot be decoded: COLMAP drops the photo",
     "make it again"},
    {"truncated-mask",
     kError,
     "the mask breaks off: COLMAP 3 drops the photo, COLMAP 4 takes the pixels that are there",
     "copy it again"},
    {"sixteen-bit-colour",
     kError,
     "the mask has colours of 16 bits: COLMAP 3 drops the photo, COLMAP 4 reads it",
     "write 8-bit gray (--fix)"},
    {"sixteen-bit-gray",
     kWarning,
     "the mask has gray values of 16 bits: COLMAP 3 looks at the upper byte alone, so that values "
     "below 256 exclude",
     "write 8-bit gray (--fix)"},
    {"alpha-only",
     kError,
     "the mask is in the alpha channel, which COLMAP does not read",
     "write 8-bit gray, 0 = excluded (--fix takes transparent pixels as excluded)"},
    {"alpha-ignored",
     kWarning,
     "the mask has an alpha channel that says something else than its colours; COLMAP reads the "
     "colours",
     "write 8-bit gray (--fix keeps what the colours say)"},
    {"colour-mask",
     kNote,
     "the mask has colours: COLMAP reads their brightness, which is 0 also for the darkest blue",
     "write 8-bit gray (--fix)"},
    {"soft-mask",
     kWarning,
     "the mask has values between 0 and 255: COLMAP keeps every pixel that is not exactly 0",
     "cut it at a threshold (--fix: 128)"},
    {"rotated-mask",
     kError,
     "width and height are exchanged, as by a tool that turns photos upright; COLMAP never does: "
     "the mask lies across, and what it does not cover is excluded",
     "turn it back as the photo is stored (--fix, if the photo's EXIF says how)"},
    {"scaled-mask",
     kError,
     "the mask has another size than the photo: COLMAP never resizes, the mask covers the upper "
     "left corner and all else is excluded",
     "write it at the photo's size (--fix resizes it)"},
    {"wrong-size",
     kError,
     "the mask has neither the photo's size nor its shape: COLMAP lays it over the upper left "
     "corner and excludes what it does not cover",
     "make it again from this photo"},
    {"turned-photo",
     kNote,
     "the photo's EXIF turns or mirrors it without changing its size, so that a mask made for the "
     "upright photo cannot be told by its size; COLMAP needs it as the photo is stored",
     "look at it (vgtw mask preview)"},
    {"all-excluded",
     kWarning,
     "the mask excludes the whole photo: COLMAP finds no feature in it",
     "check the mask, or remove the photo"},
    {"nothing-excluded", kNote, "the mask excludes nothing", "nothing, if so meant"},
    {"no-mask-excludes",
     kWarning,
     "no mask excludes anything: COLMAP works as without masks",
     "check how they were made (COLMAP excludes 0 only)"},
    {"mostly-excluded",
     kWarning,
     "the mask excludes more than half of the photo, unlike most others",
     "check its polarity: 0 is excluded"},
    {"maybe-inverted",
     kWarning,
     "the masks exclude more than half of the typical photo: right for a cut-out object, inverted "
     "for distractors",
     "check the polarity: 0 is excluded; --fix --invert exchanges it. A --database_path with "
     "matches, extracted without masks, can prove it"},
    {"inverted-masks",
     kError,
     "the masks are inverted: they exclude most pixels, and what they exclude fits the scene's "
     "geometry better than what they keep",
     "exchange kept and excluded (--fix)"},
    {"same-mask",
     kWarning,
     "photos share one and the same mask: right for what is fixed in the frame, else it is a copy "
     "of another photo's",
     "check it; for a fixed one there is --ImageReader.camera_mask_path"},
    {"unknown-database-image",
     kError,
     "the database names an image that is not among the photos: its mask is looked for under that "
     "name",
     "use the --image_path that the database was made with"},
    {"photo-not-in-database",
     kNote,
     "photos are not in the database; COLMAP extracts them with masks when it runs next",
     "nothing, if so meant"},
    {"masks-too-late",
     kError,
     "the database already has features on excluded pixels: COLMAP does not extract photos again, "
     "the masks do nothing",
     "use vgtw mask apply, or extract into a new database"},
    {"excluded-unmatched",
     kNote,
     "the database has features on excluded pixels, but no match touches them (as after vgtw mask "
     "apply)",
     "nothing; matching again would need vgtw mask apply again"},
};
static_assert(std::size(kRules) == static_cast<size_t>(LintCode::kCount));

}  // namespace

std::span<const LintRule> LintRules() { return kRules; }

const LintRule& RuleOf(LintCode code) { return kRules[static_cast<size_t>(code)]; }

LintFinding MakeFinding(LintCode code, std::string name, std::string detail) {
  return {&RuleOf(code), std::move(name), std::move(detail)};
}

size_t LintReport::Count(LintSeverity severity) const {
  return static_cast<size_t>(
      std::count_if(findings.begin(), findings.end(), [&](const LintFinding& finding) {
        return finding.rule->severity == severity;
      }));
}

}  // namespace vgtw
