// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/seed.h"

#include "bridge/seed_points.h"
#include "scene/error.h"
#include "scene/image_io.h"
#include "scene/statistics.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <tuple>

namespace vgtw {
namespace {

// The cameras of views that become one; all of one model and size.
using CameraGroup = std::vector<Camera>;

Camera MedianCamera(const CameraGroup& group) {
  Camera median = group.front();
  for (size_t i = 0; i < median.params.size(); ++i) {
    std::vector<double> values;
    for (const Camera& camera : group) values.push_back(camera.params[i]);
    median.params[i] = Median(std::move(values));
  }
  return median;
}

double FocalSpreadPercent(const CameraGroup& group) {
  std::vector<double> focal_lengths;
  for (const Camera& camera : group) focal_lengths.push_back(camera.MeanFocalLength());
  const auto [min, max] = std::minmax_element(focal_lengths.begin(), focal_lengths.end());
  return 100.0 * (*max - *min) / Median(focal_lengths);
}

// Adds the combined camera of each group; returns the largest spread of focal lengths.
double AddCameras(const std::map<CameraId, CameraGroup>& groups, Reconstruction& reconstruction) {
  double max_spread_percent = 0.0;
  for (const auto& [camera_id, group] : groups) {
    Camera& camera = reconstruction.cameras[camera_id];
    camera = MedianCamera(group);
    camera.camera_id = camera_id;
    camera.has_prior_focal_length = true;
    max_spread_percent = std::max(max_spread_percent, FocalSpreadPercent(group));
  }
  return max_spread_percent;
}

void AddImage(ImageId image_id, CameraId camera_id, const View& view, Reconstruction& model) {
  Image& image = model.images[image_id];
  image.image_id = image_id;
  image.camera_id = camera_id;
  image.name = view.name;
  image.cam_from_world = view.cam_from_world;
}

// Ids 1..n in the order of `views`; shared cameras are numbered by their first view.
double AddViews(const std::vector<View>& views, bool shared_camera, Reconstruction& model) {
  std::map<std::tuple<CameraModel, uint64_t, uint64_t>, CameraId> shared_ids;
  std::map<CameraId, CameraGroup> groups;
  for (const View& view : views) {
    const Camera& camera = view.camera;
    auto camera_id = static_cast<CameraId>(groups.size() + 1);
    if (shared_camera) {
      const auto key = std::tuple(camera.model, camera.width, camera.height);
      camera_id = shared_ids.try_emplace(key, camera_id).first->second;
    }
    groups[camera_id].push_back(camera);
    AddImage(static_cast<ImageId>(model.images.size() + 1), camera_id, view, model);
  }
  return AddCameras(groups, model);
}

// The view's intrinsics in the form of the database's camera.
Camera InModelOf(const ColmapDatabase& database, const Camera& row, const View& view) {
  const std::string owner = "camera " + std::to_string(row.camera_id) + " of " + view.name;
  const auto describe = [](const Camera& camera) {
    return std::string(GetCameraModelInfo(camera.model).name) + " " + std::to_string(camera.width) +
           " x " + std::to_string(camera.height);
  };
  const auto refuse = [&](const char* hint) {
    Fail(database.path(), owner + " is " + describe(row), describe(view.camera), hint);
  };
  if (row.width != view.camera.width || row.height != view.camera.height) {
    refuse("predict from the photos that the database was made from");
  }
  Camera camera = row;
  if (view.camera.model == row.model) {
    camera.params = view.camera.params;
  } else if (view.camera.model == CameraModel::kPinhole ||
             view.camera.model == CameraModel::kSimplePinhole) {
    camera.SetFocalLength(view.camera.FocalLengthX(), view.camera.FocalLengthY());
    camera.SetPrincipalPoint(view.camera.PrincipalPoint());
  } else {
    refuse("make the database with the camera model of the predictions");
  }
  return camera;
}

// Rigs and frames of the images that the model has, if every rig is a single camera.
void AddTrivialRigs(const ColmapDatabase& database, Reconstruction& model) {
  if (!database.schema().has_rigs) return;
  for (const Rig& rig : database.ReadRigs()) {
    if (!rig.sensor_from_rig.empty()) {
      model.rigs.clear();
      return;
    }
    if (rig.reference.type == 0 && model.cameras.contains(rig.reference.id)) {
      model.rigs[rig.rig_id] = rig;
    }
  }
  size_t num_covered = 0;
  for (const Frame& frame : database.ReadFrames()) {
    if (frame.data.size() != 1 || frame.data.front().sensor.type != 0) continue;
    const auto image = model.images.find(static_cast<ImageId>(frame.data.front().data_id));
    if (image == model.images.end() || !model.rigs.contains(frame.rig_id)) continue;
    Frame& added = model.frames[frame.frame_id];
    added = frame;
    added.rig_from_world = image->second.cam_from_world;
    ++num_covered;
  }
  // COLMAP before 3.12 made databases whose later rows have no frames.
  if (num_covered < model.images.size()) {
    model.rigs.clear();
    model.frames.clear();
  }
}

void Finish(const PredictionReader& predictions,
            const std::vector<SeedView>& views,
            const SeedOptions& options,
            Seed& seed) {
  seed.summary.num_images = seed.reconstruction.images.size();
  if (!options.with_points) return;
  AddSeedPoints(predictions, views, options, seed.reconstruction, seed.summary);
}

void CheckRange(const char* field, double value, bool is_inside, const char* range) {
  VGTW_CHECK(
      is_inside,
      "SeedOptions::" + std::string(field) + " = " + std::to_string(value) + ", must be " + range);
}

}  // namespace

void SeedOptions::Check() const {
  CheckRange(
      "keep_percent", keep_percent, keep_percent > 0.0 && keep_percent <= 100.0, "in (0, 100]");
  CheckRange("distractor_threshold",
             distractor_threshold,
             distractor_threshold > 0.0 && distractor_threshold <= 1.0,
             "in (0, 1]");
  CheckRange("voxel_size", voxel_size, voxel_size >= 0.0, ">= 0");
  CheckRange("max_relative_depth_difference",
             max_relative_depth_difference,
             max_relative_depth_difference > 0.0,
             "> 0");
  CheckRange("min_track_length", min_track_length, min_track_length >= 1, ">= 1");
}

Seed MakeSeed(const PredictionReader& predictions,
              const ColmapDatabase& database,
              const SeedOptions& options) {
  options.Check();
  std::map<std::string, DatabaseImage> rows_by_name;
  for (const DatabaseImage& row : database.ReadImages()) rows_by_name[row.name] = row;
  std::map<CameraId, Camera> camera_rows;
  for (const Camera& row : database.ReadCameras()) camera_rows[row.camera_id] = row;

  Seed seed;
  std::vector<SeedView> seed_views;
  std::map<CameraId, CameraGroup> groups;
  const std::vector<View>& views = predictions.views();
  for (size_t i = 0; i < views.size(); ++i) {
    const auto row = rows_by_name.find(views[i].name);
    if (row == rows_by_name.end()) {
      seed.missing.push_back(views[i].name);
      continue;
    }
    const auto [image_id, name, camera_id] = row->second;
    const auto camera_row = camera_rows.find(camera_id);
    if (camera_row == camera_rows.end()) {
      Fail(database.path(), "no camera " + std::to_string(camera_id), "the camera of " + name);
    }
    groups[camera_id].push_back(InModelOf(database, camera_row->second, views[i]));
    AddImage(image_id, camera_id, views[i], seed.reconstruction);
    seed_views.push_back({i, image_id});
  }
  if (seed_views.empty()) {
    Fail(database.path(),
         "none of the predicted images",
         "names such as " + (views.empty() ? "(no views)" : Printable(views.front().name)),
         "compare the folders that photos and predictions were named from");
  }
  seed.summary.focal_spread_percent = AddCameras(groups, seed.reconstruction);
  AddTrivialRigs(database, seed.reconstruction);
  Finish(predictions, seed_views, options, seed);
  return seed;
}

Seed MakeSeed(const PredictionReader& predictions, const SeedOptions& options) {
  options.Check();
  Seed seed;
  seed.summary.focal_spread_percent =
      AddViews(predictions.views(), options.shared_camera, seed.reconstruction);
  std::vector<SeedView> views;
  for (size_t i = 0; i < predictions.views().size(); ++i) {
    views.push_back({i, static_cast<ImageId>(i + 1)});
  }
  if (!views.empty()) Finish(predictions, views, options, seed);
  return seed;
}

void WriteSeedCameras(const PredictionReader& predictions,
                      const std::filesystem::path& image_folder,
                      const SeedOptions& options,
                      ColmapDatabase& database) {
  options.Check();
  if (!database.ReadImages().empty() || !database.ReadCameras().empty()) {
    Fail(database.path(), "images or cameras", "an empty database", "give a new database_path");
  }
  const std::vector<std::string> names = ListImages(image_folder);
  const std::set<std::string> existing(names.begin(), names.end());
  std::vector<View> views;
  for (const View& view : predictions.views()) {
    if (!existing.contains(view.name)) continue;
    const ImageSize size = ReadImageSize(image_folder / view.name);
    if (size != ImageSize{view.camera.width, view.camera.height}) {
      Fail(image_folder / view.name,
           std::to_string(size.width) + " x " + std::to_string(size.height) + " pixels",
           std::to_string(view.camera.width) + " x " + std::to_string(view.camera.height) +
               " as in the predictions",
           "give the photos that were predicted from");
    }
    views.push_back(view);
    Camera& camera = views.back().camera;
    const bool is_pinhole =
        camera.model == CameraModel::kSimplePinhole || camera.model == CameraModel::kPinhole;
    if (options.camera_model && is_pinhole) camera = PinholeInModel(camera, *options.camera_model);
  }
  if (views.empty()) {
    Fail(image_folder,
         "no image that was predicted",
         "names such as " +
             (predictions.views().empty() ? "(no views)" : Printable(predictions.views()[0].name)));
  }
  Reconstruction model;
  AddViews(views, options.shared_camera, model);
  ColmapDatabase::Transaction transaction(database);
  for (const auto& [camera_id, camera] : model.cameras) database.WriteCamera(camera);
  for (const auto& [image_id, image] : model.images) {
    database.WriteImage({image_id, image.name, image.camera_id});
  }
  database.WriteTrivialRigsAndFrames();
  transaction.Commit();
}

}  // namespace vgtw
