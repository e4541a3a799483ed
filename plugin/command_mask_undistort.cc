// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_undistort_folder.h"
#include "plugin/commands.h"
#include "plugin/progress.h"
#include "plugin/table.h"

#include <memory>

namespace vgtw {
namespace {

struct MaskUndistortCommand {
  std::filesystem::path mask_path;
  std::filesystem::path input_path;
  std::filesystem::path undistorted_path;
  std::filesystem::path output_path;
  UndistortMasksOptions options;
  Usability usability;

  void Run() {
    Apply(usability);
    options.num_threads = usability.num_threads;
    ProgressDisplay display("masks");
    const auto summaries = UndistortMasks(
        mask_path, input_path, undistorted_path, output_path, options, display.Callback());
    std::vector<std::vector<std::string>> rows = {{"image", "excluded %"}};
    nlohmann::json images = nlohmann::json::array();
    for (const MaskSummary& summary : summaries) {
      rows.push_back({summary.image_name, FormatNumber(100.0 * summary.excluded_share, 2)});
      if (summary.was_missing) rows.back().back() += " (no mask)";
      images.push_back({{"name", summary.image_name},
                        {"has_mask", !summary.was_missing},
                        {"excluded_share", summary.excluded_share}});
    }
    Finish(usability,
           FormatTable(rows) + "written: " + std::to_string(summaries.size()) + " masks in " +
               output_path.string() + "\n",
           {{"images", images}, {"output_path", output_path.string()}});
  }
};

}  // namespace

std::function<void()> DeclareMaskUndistort(Flags& flags) {
  const auto command = std::make_shared<MaskUndistortCommand>();
  flags.Group("Input")
      .Require("mask_path", &command->mask_path, "COLMAP masks of the original photos")
      .Require("input_path", &command->input_path, "Sparse model before undistortion")
      .Add("undistorted_path",
           &command->undistorted_path,
           "Folder that `colmap image_undistorter` wrote; not needed where every camera is PINHOLE")
      .Add("allow_missing_masks",
           &command->options.allow_missing_masks,
           "Keep everything in images without a mask instead of stopping");
  flags.Group("Output")
      .Require("output_path",
               &command->output_path,
               "Mask folder to write: <image name>.png each, 0 = excluded or not on the photo")
      .Add("overwrite", &command->options.overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
