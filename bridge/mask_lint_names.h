// SPDX-License-Identifier: BSD-3-Clause
// Which mask file is whose. Not a door.
#pragma once

#include "bridge/mask_lint.h"

#include <filesystem>
#include <string_view>
#include <vector>

namespace vgtw {

// What differs between versions of COLMAP when they read masks.
struct MaskBehaviour {
  bool drops_without_mask = false;      // from 3.12: a photo without mask is dropped
  bool reads_own_name = false;          // from 3.12: a.png for the photo a.png
  bool replaces_extension = false;      // from 3.13: a.png for the photo a.jpg
  bool reads_with_newer_codec = false;  // from 4.0: 16-bit colours, files that break off
};

// Of "3.8", "3.12.1", "4.2.1-dev", ... Throws Error for what is no version.
MaskBehaviour BehaviourOf(std::string_view version);

// Fills mask_names, convention and effect of images that have their names, and adds what is wrong
// with names.
void MatchMaskNames(const std::filesystem::path& mask_folder,
                    const MaskBehaviour& behaviour,
                    std::vector<LintImage>& images,
                    std::vector<LintFinding>& findings);

}  // namespace vgtw
