// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/protocol_make.h"
#include "plugin/commands.h"
#include "plugin/protocol_flags.h"
#include "plugin/subprocess.h"
#include "plugin/table.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <memory>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

size_t NumShared(const ProtocolScene& scene) {
  return static_cast<size_t>(std::count_if(
      scene.test_images.begin(), scene.test_images.end(), [&](const std::string& name) {
        return std::binary_search(scene.clean_images.begin(), scene.clean_images.end(), name);
      }));
}

struct ProtocolMakeCommand {
  fs::path input_path;
  fs::path mask_path;
  fs::path output_path;
  std::string image_folder;
  Protocol protocol;
  bool overwrite = false;
  Usability usability;

  void Run() {
    Apply(usability);
    if (fs::exists(output_path) && !overwrite) {
      Fail(output_path, "exists", "a new file", "name another or add --overwrite");
    }
    const DatasetScan scan = ScanDataset(DatasetKindOf(protocol.dataset), input_path, image_folder);
    protocol.dataset_path = fs::absolute(input_path).lexically_normal();
    protocol.scenes = MakeProtocolScenes(scan.scenes, protocol.sampling);
    if (!mask_path.empty()) TakeMasks();
    // What is written can be read: the reader knows every bound.
    const std::string text = FormatProtocol(protocol);
    ParseProtocol(text, output_path);
    WriteFileAtomically(output_path, text);
    Finish(usability, Text(scan), Json(scan));
  }

  void TakeMasks() {
    for (ProtocolScene& scene : protocol.scenes) {
      const fs::path masks = mask_path / scene.name;
      if (!fs::is_directory(masks)) continue;
      scene.mask_path = fs::absolute(masks).lexically_normal();
      scene.mask_convention = "colmap";
    }
  }

  std::string Text(const DatasetScan& scan) const {
    std::vector<std::vector<std::string>> rows = {
        {"scene", "test images", "of them clean", "clean images", "true masks", "poses"}};
    for (const ProtocolScene& scene : protocol.scenes) {
      rows.push_back({scene.name,
                      std::to_string(scene.test_images.size()),
                      std::to_string(NumShared(scene)),
                      std::to_string(scene.clean_images.size()),
                      scene.mask_path.empty() ? "no" : "yes",
                      scene.pose_reference_path.empty() ? "of the reference" : "of the data set"});
    }
    std::string text = FormatTable(rows) + "drawn by seed " +
                       std::to_string(protocol.sampling.seed) + " from " +
                       (protocol.sampling.test_images == "mixed" ? "clean and cluttered"
                                                                 : protocol.sampling.test_images) +
                       " photos\n";
    for (const std::string& name : scan.missing) {
      text += "warning: scene " + name + " of the paper is not in " + input_path.string() + "\n";
    }
    for (const std::string& name : scan.left_out) {
      text += "note: folder " + Printable(name) + " is none of the scenes\n";
    }
    for (const ProtocolScene& scene : protocol.scenes) {
      if (protocol.sampling.num_images > scene.test_images.size()) {
        text += "warning: scene " + scene.name + " has only " +
                std::to_string(scene.test_images.size()) + " such photos\n";
      }
    }
    for (const ProtocolScene& scene : protocol.scenes) text += AlignmentWarning(scene);
    return text + "written: " + output_path.string() + "\nNext: " +
           ShellLine("vgtw",
                     {"protocol",
                      "photos",
                      "--protocol_path",
                      output_path.string(),
                      "--output_path",
                      "photos/"}) +
           "\n";
  }

  // What will be a dash in tables for want of something to align on.
  std::string AlignmentWarning(const ProtocolScene& scene) const {
    const std::string& alignment = protocol.conditions.alignment;
    const std::string warning = "warning: scene " + scene.name + " has ";
    if (scene.clean_images.empty()) {
      return warning + "no clean photos: points and depth need another reference\n";
    }
    if (alignment == "dataset_cameras" && scene.pose_reference_path.empty()) {
      return warning + "no poses of the data set for --alignment dataset_cameras\n";
    }
    if (alignment != "dataset_cameras" && alignment != "none" && NumShared(scene) == 0) {
      return warning + "no test image among its clean ones: --alignment " + alignment +
             " finds nothing in common, dataset_cameras needs nothing; depth cannot be measured\n";
    }
    return "";
  }

  json Json(const DatasetScan& scan) const {
    json scenes = json::array();
    for (const ProtocolScene& scene : protocol.scenes) {
      scenes.push_back({{"name", scene.name},
                        {"num_test_images", scene.test_images.size()},
                        {"num_shared_images", NumShared(scene)},
                        {"num_clean_images", scene.clean_images.size()}});
    }
    return {{"scenes", scenes},
            {"missing", scan.missing},
            {"left_out", scan.left_out},
            {"output_path", output_path.string()}};
  }
};

void AddSamplingFlags(Flags& flags, ProtocolSampling& sampling) {
  flags.Group("Photos")
      .Add("seed", &sampling.seed, "The same seed draws the same photos")
      .Add("num_images", &sampling.num_images, "Test images of a scene")
      .AddChoice("test_images",
                 &sampling.test_images,
                 {"mixed", "clean", "clutter"},
                 "Of which photos they are drawn")
      .Add("min_shared_images",
           &sampling.min_shared_images,
           "Of mixed ones at least so many are clean: these align a prediction with the pseudo "
           "ground truth, cameras need 3")
      .Add("num_clean_images",
           &sampling.num_clean_images,
           "Clean photos for the pseudo ground truth; 0 = all");
}

}  // namespace

std::function<void()> DeclareProtocolMake(Flags& flags) {
  const auto command = std::make_shared<ProtocolMakeCommand>();
  const auto words = DatasetWords();
  command->protocol.dataset = "folder";
  flags.Group("Input")
      .AddChoice("dataset",
                 &command->protocol.dataset,
                 {words.begin(), words.end()},
                 "How the folder is laid out")
      .Require("input_path", &command->input_path, "The data set's folder")
      .Add("image_folder",
           &command->image_folder,
           "Photos' folder in a scene of robustnerf or on_the_go, such as images_8; default "
           "images, else its smaller copies")
      .Add(
          "mask_path",
          &command->mask_path,
          "Folder with a folder of true masks per scene, <scene>/<photo name>.png, 0 = distractor; "
          "default masks/ beside a scene's images/");
  AddSamplingFlags(flags, command->protocol.sampling);
  AddConditionFlags(flags, command->protocol.conditions);
  flags.Group("Output")
      .Require("output_path", &command->output_path, "Protocol file to write (.json)")
      .Add("overwrite", &command->overwrite, "Replace an existing file");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
