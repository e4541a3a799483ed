// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_files.h"
#include "bridge/predictions.h"
#include "plugin/commands.h"
#include "plugin/mask_flags.h"
#include "plugin/progress.h"
#include "plugin/table.h"

#include <memory>

namespace vgtw {
namespace {

struct MaskMakeCommand {
  std::filesystem::path predictions_path;
  std::filesystem::path output_path;
  MaskFlags mask;
  bool overwrite = false;
  Usability usability;

  void Run() const {
    Apply(usability);
    const PredictionReader predictions(predictions_path);
    ProgressDisplay display("masks");
    const auto summaries = WriteMasks(predictions,
                                      output_path,
                                      mask.Options(),
                                      overwrite,
                                      usability.num_threads,
                                      display.Callback());
    std::vector<std::vector<std::string>> rows = {{"photo", "excluded %"}};
    nlohmann::json images = nlohmann::json::array();
    for (const MaskSummary& summary : summaries) {
      rows.push_back({summary.image_name, FormatNumber(100.0 * summary.excluded_share, 2)});
      images.push_back({{"name", summary.image_name}, {"excluded_share", summary.excluded_share}});
    }
    Finish(usability,
           FormatTable(rows) + "written: " + std::to_string(summaries.size()) + " masks in " +
               output_path.string() + "\n",
           {{"images", images}, {"output_path", output_path.string()}});
  }
};

}  // namespace

std::function<void()> DeclareMaskMake(Flags& flags) {
  const auto command = std::make_shared<MaskMakeCommand>();
  flags.Group("Input").Require(
      "predictions_path", &command->predictions_path, "Predictions folder");
  command->mask.Declare(flags);
  flags.Group("Output")
      .Require("output_path", &command->output_path, "Mask folder to write: <photo name>.png each")
      .Add("overwrite", &command->overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
