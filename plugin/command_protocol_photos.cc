// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/protocol.h"
#include "plugin/commands.h"
#include "plugin/subprocess.h"
#include "scene/error.h"
#include "scene/files.h"

#include <memory>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct ProtocolPhotosCommand {
  fs::path protocol_path;
  fs::path output_path;
  bool copy = false;
  bool overwrite = false;
  Usability usability;

  void Run() const {
    Apply(usability);
    const Protocol protocol = ReadProtocol(protocol_path);
    AtomicFolder folder(output_path, overwrite);
    for (const ProtocolScene& scene : protocol.scenes) {
      Put(scene, scene.test_images, folder.path() / scene.name / "test");
      Put(scene, scene.clean_images, folder.path() / scene.name / "clean");
    }
    folder.Commit();
    const std::vector<std::string> commands = Commands(protocol);
    std::string text = "written: photos of " + std::to_string(protocol.scenes.size()) +
                       " scenes in " + output_path.string() + (copy ? "" : " (links)") +
                       "\nNext, per scene, the pseudo ground truth and each system "
                       "(vgtw import for those that run elsewhere):\n";
    for (const std::string& command : commands) text += "  " + command + "\n";
    Finish(usability, text, {{"commands", commands}, {"output_path", output_path.string()}});
  }

  void Put(const ProtocolScene& scene,
           const std::vector<std::string>& names,
           const fs::path& target) const {
    for (const std::string& name : names) {
      const fs::path photo = scene.image_path / name;
      if (!fs::is_regular_file(photo)) {
        Fail(photo, "is missing", "a photo of scene " + scene.name, "mend dataset_path");
      }
      std::error_code error;
      fs::create_directories((target / name).parent_path(), error);
      if (!error && copy) fs::copy_file(photo, target / name, error);
      if (!error && !copy) fs::create_symlink(fs::absolute(photo), target / name, error);
      if (error)
        Fail(target / name, "cannot be made: " + error.message(), "room for it", "--copy 1");
    }
  }

  std::vector<std::string> Commands(const Protocol& protocol) const {
    const auto predict = [&](const ProtocolScene& scene,
                             const char* photos,
                             const char* weights,
                             const std::string& folder) {
      return ShellLine("vgtw",
                       {"predict",
                        "--image_path",
                        (output_path / scene.name / photos).string(),
                        "--weights_path",
                        weights,
                        "--output_path",
                        folder + "/" + scene.name});
    };
    std::vector<std::string> commands;
    for (const ProtocolScene& scene : protocol.scenes) {
      if (scene.reference_path.empty() && !scene.clean_images.empty()) {
        commands.push_back(predict(scene, "clean", "pi3.safetensors", "reference"));
      }
      commands.push_back(predict(scene, "test", "vgtw.safetensors", "vgtw"));
    }
    commands.push_back(ShellLine("vgtw",
                                 {"protocol",
                                  "tables",
                                  "--protocol_path",
                                  protocol_path.string(),
                                  "--reference_path",
                                  "reference",
                                  "--system",
                                  "VGTW=vgtw",
                                  "--output_path",
                                  "tables"}));
    return commands;
  }
};

}  // namespace

std::function<void()> DeclareProtocolPhotos(Flags& flags) {
  const auto command = std::make_shared<ProtocolPhotosCommand>();
  flags.Group("Input").Require(
      "protocol_path", &command->protocol_path, "What vgtw protocol make wrote");
  flags.Group("Output")
      .Require("output_path",
               &command->output_path,
               "Folder to write: <scene>/test/ and <scene>/clean/ with the drawn photos")
      .Add("copy", &command->copy, "Copies in place of symbolic links")
      .Add("overwrite", &command->overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
