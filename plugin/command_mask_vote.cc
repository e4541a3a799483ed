// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_vote_folder.h"
#include "plugin/commands.h"
#include "plugin/progress.h"
#include "plugin/table.h"

#include <memory>

namespace vgtw {
namespace {

std::string Percent(double share) { return FormatNumber(100.0 * share, 2); }

struct MaskVoteCommand {
  std::filesystem::path predictions_path;
  std::filesystem::path output_path;
  VoteOnMasksOptions options;
  Usability usability;

  void Run() {
    Apply(usability);
    options.num_threads = usability.num_threads;
    const PredictionReader predictions(predictions_path);
    ProgressDisplay display("votes");
    const VoteOnMasksSummary summary =
        VoteOnMasks(predictions, output_path, options, display.Callback());
    Finish(usability, Text(summary), Json(summary));
  }

  std::string Text(const VoteOnMasksSummary& summary) const {
    std::vector<std::vector<std::string>> rows = {
        {"photo", "voters", "masked %", "released %", "added %"}};
    for (const ViewVoteSummary& view : summary.views) {
      rows.push_back({view.image_name,
                      std::to_string(view.num_voters),
                      Percent(view.masked_share_before),
                      Percent(view.released_share),
                      Percent(view.added_share)});
    }
    std::string text = FormatTable(rows);
    if (!summary.may_release) {
      text +=
          "nothing was released: too few views look through what is masked, so the depth may be "
          "that of the scene behind it (--min_see_through_masked_share)\n";
    }
    return text + "written: predictions of " + std::to_string(summary.views.size()) +
           " photos in " + output_path.string() + "\n";
  }

  nlohmann::json Json(const VoteOnMasksSummary& summary) const {
    nlohmann::json images = nlohmann::json::array();
    for (const ViewVoteSummary& view : summary.views) {
      images.push_back({{"name", view.image_name},
                        {"num_voters", view.num_voters},
                        {"masked_share_before", view.masked_share_before},
                        {"released_share", view.released_share},
                        {"added_share", view.added_share}});
    }
    return {
        {"images", images},
        {"may_release", summary.may_release},
        {"masked_verdicts",
         {{"static", summary.masked.num_static}, {"distractor", summary.masked.num_distractor}}},
        {"num_loads", summary.num_loads},
        {"output_path", output_path.string()}};
  }
};

void DeclareRules(MaskVoteOptions& vote, Flags& flags) {
  flags.Group("Algorithm")
      .Add("mask_threshold",
           &vote.distractor_threshold,
           "A pixel is masked from this distractor probability on, in (0, 1]")
      .Add("max_relative_depth_difference",
           &vote.max_relative_depth_difference,
           "Depths agree up to this, relative, or up to noise_factor times their noise")
      .Add("noise_factor",
           &vote.noise_factor,
           "See above, in sigma of the noise that static pixels of the two views show; 0: not used")
      .Add("max_relative_step",
           &vote.max_relative_step,
           "No vote where depths of neighbouring pixels differ by more, relative")
      .Add("position_error_px",
           &vote.position_error_px,
           "Error of poses and intrinsics, network pixels: a view must look through everywhere "
           "within it")
      .Add("min_consistent", &vote.min_consistent, "Views that must agree to release a pixel")
      .Add("max_see_through_share",
           &vote.max_see_through_share,
           "Share of the votes that may look through a released pixel, in [0, 1)")
      .Add("min_see_through",
           &vote.min_see_through,
           "Views that must look through an added pixel, besides being more than those that agree")
      .Add("window_px",
           &vote.window_px,
           "A mask changes where the square of this odd edge length, network pixels, is mostly for "
           "it")
      .Add("min_see_through_masked_share",
           &vote.min_see_through_masked_share,
           "Release nothing unless this share of the judged masked pixels of all photos is seen "
           "through, in [0, 1]; 0: release in any case");
}

}  // namespace

std::function<void()> DeclareMaskVote(Flags& flags) {
  const auto command = std::make_shared<MaskVoteCommand>();
  VoteOnMasksOptions& options = command->options;
  flags.Group("Input").Require(
      "predictions_path", &command->predictions_path, "Predictions folder with depth");
  DeclareRules(options.vote, flags);
  flags.Add("max_views", &options.vote.max_views, "Photos that vote on a photo: the nearest ones")
      .Add("max_cached_views",
           &options.max_cached_views,
           "Photos in memory at once (17 bytes per network pixel each), more than max_views");
  flags.Group("Output")
      .Require("output_path",
               &command->output_path,
               "Predictions folder to write: equal but for its distractor maps")
      .Add("overwrite", &options.overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
