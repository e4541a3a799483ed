// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model.h"
#include "bridge/export_poses.h"
#include "bridge/point_cloud.h"
#include "bridge/predictions.h"
#include "plugin/commands.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <memory>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

std::vector<View> ViewsOf(const Reconstruction& model) {
  std::vector<View> views;
  for (const auto& [id, image] : model.images) {
    View& view = views.emplace_back();
    view.name = image.name;
    view.camera = model.cameras.at(image.camera_id);
    view.cam_from_world = image.cam_from_world;
  }
  std::sort(
      views.begin(), views.end(), [](const View& a, const View& b) { return a.name < b.name; });
  return views;
}

struct ExportCommand {
  fs::path input_path;
  fs::path output_path;
  std::string format = "ply";
  std::string label = "line";
  std::string image_folder = "images";
  bool overwrite = false;
  Usability usability;

  void Run() {
    Apply(usability);
    if (fs::exists(output_path) && !overwrite) {
      Fail(output_path, "exists", "a new file", "name another or add --overwrite");
    }
    const bool is_model = IsModelFolder(input_path);
    if (!is_model && !fs::exists(input_path / "predictions.json")) {
      Fail(input_path, "holds neither", "a COLMAP model or a predictions folder");
    }
    const std::string written =
        format == "ply" || format == "pcd" ? WritePoints(is_model) : WriteCameras(is_model);
    Finish(usability,
           "written: " + output_path.string() + " (" + written + ")\n",
           {{"output_path", output_path.string()}, {"written", written}});
  }

  std::string WritePoints(bool is_model) const {
    if (!is_model) {
      Fail(input_path,
           "is a predictions folder",
           "a COLMAP model for --format " + format,
           "'vgtw seed --ply_path' writes the points of predictions");
    }
    const std::vector<ColoredPoint> points = PointsOf(ReadModel(input_path));
    if (format == "ply") {
      WritePly(output_path, points);
    } else {
      WritePcd(output_path, points);
    }
    return std::to_string(points.size()) + " points";
  }

  std::string WriteCameras(bool is_model) const {
    const std::vector<View> views =
        is_model ? ViewsOf(ReadModel(input_path)) : PredictionReader(input_path).views();
    std::string text;
    if (format == "tum") {
      text = TumTrajectory(views,
                           label == "name" ? TrajectoryLabel::kImageName : TrajectoryLabel::kLine);
    } else if (format == "kitti") {
      text = KittiTrajectory(views);
    } else {
      text = TransformsJson(views, image_folder);
    }
    WriteFileAtomically(output_path, text);
    return std::to_string(views.size()) + " cameras";
  }
};

}  // namespace

std::function<void()> DeclareExport(Flags& flags) {
  const auto command = std::make_shared<ExportCommand>();
  flags.Group("Input").Require(
      "input_path", &command->input_path, "COLMAP model or predictions folder");
  flags.Group("Output")
      .Require("output_path", &command->output_path, "The file to write")
      .AddChoice("format",
                 &command->format,
                 {"ply", "pcd", "transforms", "tum", "kitti"},
                 "ply, pcd: coloured points of a model; transforms: nerfstudio's transforms.json; "
                 "tum, kitti: trajectories of world_from_cam, in the order of names")
      .AddChoice("label",
                 &command->label,
                 {"line", "name"},
                 "What a TUM trajectory has in place of timestamps")
      .Add("image_folder",
           &command->image_folder,
           "Where transforms.json finds the photos, relative to itself")
      .Add("overwrite", &command->overwrite, "Replace an existing file");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
