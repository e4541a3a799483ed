// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_conventions.h"
#include "bridge/mask_convert.h"
#include "plugin/commands.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <memory>

namespace vgtw {
namespace {

std::string Excluded(const MaskConvention& convention) {
  const bool is_marked = convention.polarity == MaskPolarity::kMarkedIsExcluded;
  if (convention.mark == MaskMark::kHalf) return is_marked ? "128..255" : "0..127";
  return is_marked ? "not 0" : "0";
}

std::string SizeRule(const MaskConvention& convention) {
  if (convention.size == MaskSize::kPhoto) return "photo's";
  return convention.size == MaskSize::kScaled ? "any" : "DUSt3R's";
}

struct MaskConvertCommand {
  std::filesystem::path image_path;
  std::filesystem::path mask_path;
  std::filesystem::path output_path;
  ConvertMasksOptions options;
  bool list = false;
  Usability usability;

  void Run() {
    Apply(usability);
    if (list) return List();
    Need(image_path, "image_path", "the photos");
    Need(mask_path, "mask_path", "their masks");
    Need(output_path, "output_path", "a folder to write");
    options.num_threads = usability.num_threads;
    ProgressDisplay display("mask convert");
    const std::vector<MaskSummary> summaries =
        ConvertMasks(image_path, mask_path, output_path, options, display.Callback());
    std::vector<std::vector<std::string>> rows = {{"photo", "excluded %"}};
    nlohmann::json images = nlohmann::json::array();
    for (const MaskSummary& summary : summaries) {
      rows.push_back({summary.image_name,
                      summary.was_missing ? "no mask, all kept"
                                          : FormatNumber(100.0 * summary.excluded_share, 2)});
      images.push_back({{"name", summary.image_name},
                        {"excluded_share", summary.excluded_share},
                        {"was_missing", summary.was_missing}});
    }
    const MaskConvention& to = GetMaskConvention(options.to);
    Finish(usability,
           FormatTable(rows) + "written: " + std::to_string(summaries.size()) + " masks in " +
               output_path.string() + "\nfor " + std::string(to.tool) + ": " +
               std::string(to.setting) + "\n",
           {{"images", images}, {"output_path", output_path.string()}, {"setting", to.setting}});
  }

 private:
  static void Need(const std::filesystem::path& path, const char* flag, const char* what) {
    if (path.empty()) {
      throw Error("no --" + std::string(flag) + ", expected " + what +
                  " (or --list for the known conventions)");
    }
  }

  void List() const {
    std::vector<std::vector<std::string>> rows = {
        {"convention", "mask of sub/a.jpg", "excluded", "size", "no mask", "upright", "use"}};
    nlohmann::json conventions = nlohmann::json::array();
    for (const MaskConvention& convention : MaskConventions()) {
      const std::string name = MaskNames(convention, {"sub/a.jpg"}).front();
      const bool is_upright = convention.frame == MaskFrame::kUpright;
      const bool is_needed = convention.missing == MissingMask::kError;
      rows.push_back({std::string(convention.id),
                      name,
                      Excluded(convention),
                      SizeRule(convention),
                      is_needed ? "error" : "all kept",
                      is_upright ? "yes" : "no",
                      convention.writable ? "from, to" : "from"});
      conventions.push_back({{"id", convention.id},
                             {"tool", convention.tool},
                             {"mask_of_sub/a.jpg", name},
                             {"excluded", Excluded(convention)},
                             {"size", SizeRule(convention)},
                             {"needs_every_mask", is_needed},
                             {"upright", is_upright},
                             {"beside_photos", convention.beside_photos},
                             {"writable", convention.writable},
                             {"setting", convention.setting},
                             {"source", convention.source}});
    }
    Finish(usability, FormatTable(rows), {{"conventions", conventions}});
  }
};

}  // namespace

std::function<void()> DeclareMaskConvert(Flags& flags) {
  const auto command = std::make_shared<MaskConvertCommand>();
  std::vector<std::string> readable;
  std::vector<std::string> writable;
  for (const MaskConvention& convention : MaskConventions()) {
    readable.emplace_back(convention.id);
    if (convention.writable) writable.emplace_back(convention.id);
  }
  flags.Group("Input")
      .Add("image_path", &command->image_path, "Photos")
      .Add("mask_path", &command->mask_path, "Their masks; may be --image_path itself")
      .AddChoice("from", &command->options.from, readable, "Convention of --mask_path")
      .Add("list", &command->list, "Print what each convention means, and do nothing else");
  flags.Group("Output")
      .AddChoice("to", &command->options.to, writable, "Convention to write")
      .Add("output_path", &command->output_path, "Mask folder to write")
      .Add("overwrite", &command->options.overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
