// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_depth.h"
#include "bridge/colmap_model.h"
#include "bridge/export_glb.h"
#include "bridge/export_points.h"
#include "bridge/export_poses.h"
#include "bridge/predictions.h"
#include "plugin/commands.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/point_colors.h"

#include <algorithm>
#include <memory>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

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
  fs::path image_path;
  fs::path model_path;
  std::string format = "ply";
  std::string label = "line";
  std::string image_folder = "images";
  ExportPointsOptions points;
  ColmapDepthOptions depth;
  Usability usability;

  void Run() {
    Apply(usability);
    depth.num_threads = points.num_threads = usability.num_threads;
    depth.filter = points.filter;
    const bool is_model = IsModelFolder(input_path);
    if (!is_model && !fs::exists(input_path / "predictions.json")) {
      Fail(input_path, "holds neither", "a COLMAP model or a predictions folder");
    }
    if (format == "colmap_depth") return WriteDepths(is_model);
    if (fs::exists(output_path) && !depth.overwrite) {
      Fail(output_path, "exists", "a new file", "name another or add --overwrite");
    }
    const bool has_points = format == "ply" || format == "pcd" || format == "glb";
    const std::string written = has_points ? WritePoints(is_model) : WriteCameras(is_model);
    Finish(usability,
           "written: " + output_path.string() + " (" + written + ")\n",
           {{"output_path", output_path.string()}, {"written", written}});
  }

  std::string WritePoints(bool is_model) const {
    const SurfaceCloud cloud = is_model ? ModelCloud() : PredictedCloud();
    const std::string num_points = std::to_string(cloud.points.size()) + " points with colours";
    if (format == "glb") {
      const std::vector<View> views = Views(is_model);
      WriteGlb(output_path, cloud, views);
      return num_points + ", " + std::to_string(views.size()) + " cameras";
    }
    if (format == "ply") {
      WritePly(output_path, cloud);
    } else {
      WritePcd(output_path, cloud);
    }
    std::string with = cloud.normals.empty() ? "" : ", normals";
    for (const CloudScalar& scalar : cloud.scalars) with += ", " + scalar.name;
    return num_points + with;
  }

  SurfaceCloud ModelCloud() const {
    Reconstruction model = ReadModel(input_path);
    if (!image_path.empty()) ColorPoints(image_path, model, usability.num_threads);
    return PointsOfModel(model, points.voxel_size);
  }

  SurfaceCloud PredictedCloud() const {
    ExportPointsOptions options = points;
    options.image_folder = image_path;
    ProgressDisplay display("photos");
    return PointsOfPredictions(PredictionReader(input_path), options, display.Callback());
  }

  std::vector<View> Views(bool is_model) const {
    return is_model ? ViewsOf(ReadModel(input_path)) : PredictionReader(input_path).views();
  }

  std::string WriteCameras(bool is_model) const {
    const std::vector<View> views = Views(is_model);
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

  void WriteDepths(bool is_model) const {
    if (is_model) {
      Fail(input_path,
           "is a COLMAP model",
           "a predictions folder for --format colmap_depth",
           "the model goes to --model_path");
    }
    if (model_path.empty()) {
      throw Error(
          "--format colmap_depth needs the cameras of the photos, expected --model_path with the "
          "sparse model before undistortion");
    }
    ProgressDisplay display("depth maps");
    const std::vector<DepthMapSummary> summaries = WriteColmapDepthMaps(
        PredictionReader(input_path), model_path, output_path, depth, display.Callback());
    std::vector<std::vector<std::string>> rows = {{"image", "known %", "scale", "from points"}};
    json images = json::array();
    size_t num_written = 0;
    for (const DepthMapSummary& summary : summaries) {
      num_written += summary.has_map ? 1 : 0;
      rows.push_back({summary.image_name,
                      summary.has_map ? FormatNumber(100.0 * summary.known_share, 2) : "no map",
                      FormatNumber(summary.scale, 5),
                      std::to_string(summary.num_scale_points)});
      images.push_back({{"name", summary.image_name},
                        {"has_map", summary.has_map},
                        {"known_share", summary.known_share},
                        {"scale", summary.scale},
                        {"num_scale_points", summary.num_scale_points}});
    }
    Finish(usability,
           FormatTable(rows) + "written: " + std::to_string(num_written) + " depth maps in " +
               (output_path / "stereo").string() + "\n",
           {{"images", images}, {"output_path", output_path.string()}});
  }
};

void AddInputFlags(Flags& flags, ExportCommand& command) {
  flags.Group("Input")
      .Require("input_path", &command.input_path, "COLMAP model or predictions folder")
      .Add("image_path", &command.image_path, "The photos, for the colours of points")
      .Add("model_path",
           &command.model_path,
           "For colmap_depth: the sparse model of the photos, before undistortion");
  flags.Group("Algorithm")
      .Add("keep_percent",
           &command.points.filter.keep_percent,
           "Of predictions: share of the depths kept, by confidence over all views, percent")
      .Add("mask_threshold",
           &command.points.filter.distractor_threshold,
           "Of predictions: distractor probability from which a pixel is left out, in (0,1]")
      .Add("voxel_size",
           &command.points.voxel_size,
           "Thin points: means in cubes of this edge, as a share of the camera extent; 0 = all")
      .Add("rescale",
           &command.depth.rescale,
           "For colmap_depth: bring each photo's depths to the scale of the model's points");
}

void AddOutputFlags(Flags& flags, ExportCommand& command) {
  flags.Group("Output")
      .Require("output_path",
               &command.output_path,
               "The file to write; for colmap_depth a folder, that of `colmap image_undistorter` "
               "or, where every camera is a pinhole, any")
      .AddChoice("format",
                 &command.format,
                 {"ply", "pcd", "glb", "transforms", "tum", "kitti", "colmap_depth"},
                 "ply, pcd: points, of predictions with normals and confidence, of a model with "
                 "error (pixels) and track_length; glb: points and cameras as glTF; transforms: "
                 "nerfstudio's transforms.json; "
                 "tum, kitti: trajectories of world_from_cam, in the order of names; colmap_depth: "
                 "stereo/depth_maps and stereo/normal_maps for stereo_fusion and splatting "
                 "trainers, in scene units of the model")
      .Add("normal_maps", &command.depth.with_normals, "For colmap_depth: write these, too")
      .AddChoice("label",
                 &command.label,
                 {"line", "name"},
                 "What a TUM trajectory has in place of timestamps")
      .Add("image_folder",
           &command.image_folder,
           "Where transforms.json finds the photos, relative to itself")
      .Add("overwrite", &command.depth.overwrite, "Replace what is there");
}

}  // namespace

std::function<void()> DeclareExport(Flags& flags) {
  const auto command = std::make_shared<ExportCommand>();
  AddInputFlags(flags, *command);
  AddOutputFlags(flags, *command);
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
