// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/predictions.h"
#include "scene/mask_vote.h"
#include "scene/progress.h"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

struct VoteOnMasksOptions {
  MaskVoteOptions vote;
  // Views kept in memory at once, 17 bytes per network pixel each; > vote.max_views. More of them
  // are read less often.
  int max_cached_views = 32;
  int num_threads = 0;  // 0 = all cores
  bool overwrite = false;

  void Check() const;
};

struct ViewVoteSummary {
  std::string image_name;
  size_t num_voters = 0;  // views with depth that were asked; 0 if the view itself has none
  // Shares of the network's pixels, in [0,1].
  double masked_share_before = 0.0;
  double released_share = 0.0;
  double added_share = 0.0;
};

struct VoteOnMasksSummary {
  std::vector<ViewVoteSummary> views;
  MaskedVerdicts masked;     // on every fourth row and column
  bool may_release = false;  // see MayRelease
  size_t num_loads = 0;      // of views from the folder, those that are written included
  size_t max_views_held = 0;
};

// Writes a predictions folder whose distractor maps are those of `predictions` after the vote (see
// scene/mask_vote.h), all other values equal. Every view is asked twice: on every fourth row and
// column, whether anything may be released, then on every pixel. A view without depth is copied.
// Throws Error if no view has depth or `output_folder` holds the predictions or exists.
VoteOnMasksSummary VoteOnMasks(const PredictionReader& predictions,
                               const std::filesystem::path& output_folder,
                               const VoteOnMasksOptions& options,
                               const ProgressCallback& progress = {});

}  // namespace vgtw
