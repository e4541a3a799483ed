// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_restore.h"
#include "plugin/commands.h"
#include "plugin/progress.h"
#include "scene/error.h"

#include <memory>

namespace vgtw {
namespace {

struct MaskRestoreCommand {
  std::filesystem::path database_path;
  std::filesystem::path output_path;
  RestoreMasksOptions options;
  Usability usability;

  void Run() const {
    Apply(usability);
    if (output_path.empty() == !options.in_place) {
      throw Error("no target or two, expected one of --output_path NEW.db and --in_place");
    }
    ProgressDisplay display("mask restore");
    const RestoreMasksSummary summary =
        RestoreMasks(database_path, output_path, options, display.Callback());
    const std::string target = (options.in_place ? database_path : output_path).string();
    std::string text = "restored: keypoints of " + std::to_string(summary.num_images) +
                       " images, matches of " + std::to_string(summary.num_matches) +
                       " pairs, geometries of " + std::to_string(summary.num_geometries) +
                       " pairs\n";
    if (options.force) {
      text += "given up: " + std::to_string(summary.num_given_up) +
              " rows written since; not there any more: " + std::to_string(summary.num_missing) +
              " rows\n";
    }
    Finish(usability,
           text + "written: " + target + "\n",
           {{"num_images", summary.num_images},
            {"num_matches", summary.num_matches},
            {"num_geometries", summary.num_geometries},
            {"num_given_up", summary.num_given_up},
            {"num_missing", summary.num_missing}});
  }
};

}  // namespace

std::function<void()> DeclareMaskRestore(Flags& flags) {
  const auto command = std::make_shared<MaskRestoreCommand>();
  flags.Group("Input").Require(
      "database_path", &command->database_path, "Database that mask apply changed");
  flags.Group("Output")
      .Add("output_path", &command->output_path, "Database to write")
      .Add("in_place", &command->options.in_place, "Change --database_path itself")
      .Add("force",
           &command->options.force,
           "Give up what was written to changed rows since masks were applied")
      .Add("overwrite", &command->options.overwrite, "Replace an existing output database");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
