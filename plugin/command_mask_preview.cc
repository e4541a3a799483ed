// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/commands.h"
#include "plugin/mask_preview.h"
#include "plugin/progress.h"
#include "plugin/table.h"

#include <memory>

namespace vgtw {
namespace {

struct MaskPreviewCommand {
  std::filesystem::path image_path;
  std::filesystem::path mask_path;
  std::filesystem::path output_path;
  MaskPreviewOptions options;
  Usability usability;

  void Run() {
    Apply(usability);
    options.num_threads = usability.num_threads;
    ProgressDisplay display("photos");
    const MaskPreview preview =
        WriteMaskPreview(image_path, mask_path, output_path, options, display.Callback());
    std::vector<std::vector<std::string>> rows = {{"photo", "excluded %"}};
    nlohmann::json images = nlohmann::json::array();
    for (const PreviewedMask& image : preview.images) {
      rows.push_back({image.image_name,
                      image.has_mask ? FormatNumber(100.0 * image.excluded_share, 2) : "no mask"});
      images.push_back({{"name", image.image_name},
                        {"has_mask", image.has_mask},
                        {"excluded_share", image.excluded_share}});
    }
    std::string text = FormatTable(rows);
    nlohmann::json pages = nlohmann::json::array();
    for (const std::filesystem::path& page : preview.pages) {
      text += "written: " + page.string() + "\n";
      pages.push_back(page.string());
    }
    Finish(usability, text, {{"images", images}, {"pages", pages}});
  }
};

}  // namespace

std::function<void()> DeclareMaskPreview(Flags& flags) {
  const auto command = std::make_shared<MaskPreviewCommand>();
  MaskPreviewOptions& options = command->options;
  flags.Group("Input")
      .Require("image_path", &command->image_path, "Photos")
      .Require("mask_path", &command->mask_path, "COLMAP masks: <photo name>.png, 0 = excluded");
  flags.Group("Output")
      .Require("output_path",
               &command->output_path,
               "Picture to write, .jpg or .png; several pages are named <stem>_1, <stem>_2, ...")
      .Add("columns", &options.num_columns, "Photos side by side")
      .Add("rows", &options.num_rows, "Rows of photos on a page")
      .Add("tile_width", &options.tile_width_px, "Width of a photo, pixels")
      .Add("overwrite", &options.overwrite, "Replace existing pictures");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
