// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import.h"
#include "plugin/commands.h"
#include "plugin/progress.h"

#include <map>
#include <memory>

namespace vgtw {
namespace {

const std::map<std::string, ImportFormat> kFormats = {{"auto", ImportFormat::kAuto},
                                                      {"colmap", ImportFormat::kColmap},
                                                      {"cut3r", ImportFormat::kCut3r},
                                                      {"da3_npz", ImportFormat::kDa3Npz},
                                                      {"dust3r", ImportFormat::kDust3r},
                                                      {"fast3r", ImportFormat::kFast3r},
                                                      {"llff", ImportFormat::kLlff},
                                                      {"mapanything", ImportFormat::kMapAnything},
                                                      {"monst3r", ImportFormat::kMonst3r},
                                                      {"npz_folder", ImportFormat::kNpzFolder},
                                                      {"pi3", ImportFormat::kPi3},
                                                      {"tum", ImportFormat::kTum},
                                                      {"vggt_long", ImportFormat::kVggtLong},
                                                      {"vggt_npz", ImportFormat::kVggtNpz}};
const std::map<std::string, ImportResize> kResizes = {{"auto", ImportResize::kAuto},
                                                      {"crop", ImportResize::kCrop},
                                                      {"pad", ImportResize::kPad},
                                                      {"square_pad", ImportResize::kSquarePad},
                                                      {"stretch", ImportResize::kStretch}};

template <typename T>
std::vector<std::string> Keys(const std::map<std::string, T>& values) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : values) keys.push_back(key);
  return keys;
}

template <typename T>
std::string KeyOf(const std::map<std::string, T>& values, T wanted) {
  for (const auto& [key, value] : values) {
    if (value == wanted) return key;
  }
  return "";
}

struct ImportCommand {
  std::filesystem::path input_path;
  std::filesystem::path image_path;
  std::filesystem::path output_path;
  std::string format = "auto";
  std::string resize = "auto";
  ImportOptions options;
  Usability usability;

  void Run() {
    Apply(usability);
    options.format = kFormats.at(format);
    options.resize = kResizes.at(resize);
    options.num_threads = usability.num_threads;
    ProgressDisplay display("import");
    const ImportSummary summary =
        Import(input_path, image_path, output_path, options, display.Callback());
    Finish(usability, Text(summary), Json(summary));
  }

  std::string Text(const ImportSummary& summary) const {
    std::string text =
        "read as " + KeyOf(kFormats, summary.format) + ": " + std::to_string(summary.num_views) +
        " views, " + std::to_string(summary.num_views_with_depth) + " with depth maps, " +
        std::to_string(summary.num_views_with_samples) + " with depth samples, " +
        std::to_string(summary.num_views_with_distractors) + " with distractor masks\n";
    for (const std::string& note : summary.notes) text += "note: " + note + "\n";
    for (const std::string& warning : summary.warnings) text += "warning: " + warning + "\n";
    return text + "written: " + output_path.string() + "\n";
  }

  nlohmann::json Json(const ImportSummary& summary) const {
    return {{"format", KeyOf(kFormats, summary.format)},
            {"resize", KeyOf(kResizes, summary.resize)},
            {"num_views", summary.num_views},
            {"num_views_with_depth", summary.num_views_with_depth},
            {"num_views_with_samples", summary.num_views_with_samples},
            {"num_views_with_distractors", summary.num_views_with_distractors},
            {"notes", summary.notes},
            {"warnings", summary.warnings},
            {"output_path", output_path.string()}};
  }
};

}  // namespace

std::function<void()> DeclareImport(Flags& flags) {
  const auto command = std::make_shared<ImportCommand>();
  flags.Group("Input")
      .Require("input_path",
               &command->input_path,
               "COLMAP model, .npz, folder or trajectory; docs/import.md")
      .Require("image_path", &command->image_path, "The original photos")
      .AddChoice("format", &command->format, Keys(kFormats), "What lies at --input_path")
      .AddChoice("resize",
                 &command->resize,
                 Keys(kResizes),
                 "How the network's loader changed the photos; auto = from the sizes")
      .Add("camera_params",
           &command->options.camera_params,
           "'f' or 'fx,fy,cx,cy' in original pixels, for inputs without intrinsics");
  flags.Group("Repairs of convention mistakes")
      .Add("invert_poses",
           &command->options.repair.invert_poses,
           "The input holds world-from-camera where camera-from-world was due")
      .Add("opengl_axes",
           &command->options.repair.opengl_axes,
           "The input's cameras look along -z with y up")
      .Add("swap_quaternion_order",
           &command->options.repair.swap_quaternion_order,
           "The input's quaternions have their scalar at the other end");
  flags.Group("Output")
      .Require("output_path", &command->output_path, "Predictions folder to write")
      .Add("overwrite", &command->options.overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
