// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/comparison_pictures.h"

#include "bridge/mask_files.h"
#include "evaluation/pose_error.h"
#include "plugin/base64.h"
#include "plugin/mask_preview.h"
#include "plugin/progress.h"
#include "plugin/report_page.h"
#include "scene/drawing.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "scene/parallel.h"
#include "scene/sim3d.h"
#include "scene/statistics.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

namespace vgtw {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr int kJpegQuality = 72;
constexpr int kPictureWidth = 360;
// From so many views on pictures shrink, so that the page stays light.
constexpr double kManyViews = 120.0;
constexpr Rgb kUsedFeature = {30, 220, 70};
// Points beyond these percentiles, and half their distance more, are left out of the 3D view.
constexpr double kLowPercent = 2.0;
constexpr double kHighPercent = 98.0;
constexpr double kMargin = 0.5;
// It looks at all cameras and this share of the points.
constexpr double kFocusPercent = 70.0;

std::string DataUrl(const RgbImage& picture) {
  return "data:image/jpeg;base64," + Base64(EncodeJpeg(picture, kJpegQuality));
}

json AsJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

// A model in the world of the scene.
struct PlacedModel {
  std::map<std::string, std::pair<Rigid3d, const Camera*>> cameras;  // by image name
  std::vector<Eigen::Vector3d> points;
  std::vector<Rgb> colors;
};

PlacedModel Place(const Reconstruction& model,
                  const std::map<std::string, Rigid3d>& target,
                  size_t max_num_points) {
  PlacedModel placed;
  const auto poses = ComparePoses(CamFromWorldByName(model), target);
  const Sim3d scene_from_model = poses ? poses->reference_from_estimate : Sim3d();
  for (const auto& [id, image] : model.images) {
    placed.cameras[image.name] = {TransformCamera(scene_from_model, image.cam_from_world),
                                  &model.cameras.at(image.camera_id)};
  }
  const size_t every = 1 + model.points3D.size() / std::max<size_t>(1, max_num_points);
  size_t idx = 0;
  for (const auto& [id, point] : model.points3D) {
    if (idx++ % every != 0) continue;
    placed.points.push_back(scene_from_model * point.xyz);
    placed.colors.push_back(point.rgb);
  }
  return placed;
}

struct Box {
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();
};

// What the camera of the 3D view turns around, and how far most of it reaches.
struct Focus {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0.0;
};

double AxisPercentile(const std::vector<Eigen::Vector3d>& points, int axis, double percent) {
  std::vector<double> values;
  for (const Eigen::Vector3d& point : points) values.push_back(point[axis]);
  return Percentile(std::move(values), percent);
}

// All cameras and most points.
Box BoxOf(const std::vector<Eigen::Vector3d>& centres, const std::vector<Eigen::Vector3d>& points) {
  Box box{centres.front(), centres.front()};
  for (int axis = 0; axis < 3 && !points.empty(); ++axis) {
    const double low = AxisPercentile(points, axis, kLowPercent);
    const double high = AxisPercentile(points, axis, kHighPercent);
    box.min[axis] = low - kMargin * (high - low);
    box.max[axis] = high + kMargin * (high - low);
  }
  for (const Eigen::Vector3d& centre : centres) {
    box.min = box.min.cwiseMin(centre);
    box.max = box.max.cwiseMax(centre);
  }
  return box;
}

Focus FocusOf(const std::vector<Eigen::Vector3d>& centres,
              const std::vector<Eigen::Vector3d>& points) {
  const std::vector<Eigen::Vector3d>& of = points.empty() ? centres : points;
  Focus focus;
  for (int axis = 0; axis < 3; ++axis) focus.centre[axis] = AxisPercentile(of, axis, 50.0);
  std::vector<double> distances;
  for (const Eigen::Vector3d& point : of) distances.push_back((point - focus.centre).norm());
  focus.radius = Percentile(std::move(distances), kFocusPercent);
  for (const Eigen::Vector3d& centre : centres) {
    focus.radius = std::max(focus.radius, (centre - focus.centre).norm());
  }
  return focus;
}

json PackPoints(const PlacedModel& model, const Box& box) {
  if (model.points.empty()) return nullptr;
  constexpr double kMaxValue = 65535.0;
  const Eigen::Vector3d step = ((box.max - box.min) / kMaxValue).cwiseMax(1e-300);
  std::vector<std::byte> xyz;
  std::vector<std::byte> rgb;
  size_t count = 0;
  for (size_t i = 0; i < model.points.size(); ++i) {
    const Eigen::Vector3d& point = model.points[i];
    // Not the other way round: a point may be NaN.
    if (!((point.array() >= box.min.array()).all() && (point.array() <= box.max.array()).all())) {
      continue;
    }
    ++count;
    for (int axis = 0; axis < 3; ++axis) {
      const auto value = static_cast<uint16_t>(
          std::min(kMaxValue, std::round((point[axis] - box.min[axis]) / step[axis])));
      xyz.push_back(std::byte(value & 0xff));
      xyz.push_back(std::byte(value >> 8));
    }
    for (const uint8_t channel : model.colors[i]) rgb.push_back(std::byte(channel));
  }
  return {{"count", count},
          {"min", AsJson(box.min)},
          {"step", AsJson(step)},
          {"xyz", Base64(xyz)},
          {"rgb", Base64(rgb)}};
}

double FieldOfViewDeg(uint64_t size, double focal_length) {
  return 2.0 * std::atan(0.5 * static_cast<double>(size) / focal_length) * 180.0 / std::numbers::pi;
}

json CamerasOf(const PlacedModel& model, const std::map<std::string, size_t>& view_idxs) {
  json cameras = json::array();
  for (const auto& [name, placed] : model.cameras) {
    const auto& [cam_from_world, camera] = placed;
    const Eigen::Quaterniond rotation = cam_from_world.rotation.conjugate();
    const auto view = view_idxs.find(name);
    if (view == view_idxs.end()) continue;
    cameras.push_back({{"view", view->second},
                       {"centre", AsJson(OriginInSource(cam_from_world))},
                       {"rotation_wxyz", {rotation.w(), rotation.x(), rotation.y(), rotation.z()}},
                       {"fov_x_deg", FieldOfViewDeg(camera->width, camera->FocalLengthX())},
                       {"fov_y_deg", FieldOfViewDeg(camera->height, camera->FocalLengthY())}});
  }
  return cameras;
}

// Where most cameras have their upper side.
Eigen::Vector3d UpOf(const PlacedModel& model) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& [name, placed] : model.cameras) {
    sum += placed.first.rotation.conjugate() * Eigen::Vector3d(0.0, -1.0, 0.0);
  }
  return sum.norm() > 1e-6 ? Eigen::Vector3d(sum.normalized()) : Eigen::Vector3d(0.0, -1.0, 0.0);
}

class Pictures {
 public:
  Pictures(const ComparisonInputs& inputs, json& comparison)
      : inputs_(inputs), comparison_(comparison) {
    for (size_t i = 0; i < comparison["views"].size(); ++i) {
      view_idxs_[comparison["views"][i]["name"]] = i;
    }
    for (const auto& [id, image] : inputs.models.back().model.images) {
      last_images_[image.name] = &image;
    }
  }

  void Add(const ProgressCallback& progress) {
    AddScene();
    AddPhotos(progress);
    if (!inputs_.reference.empty()) AddReference();
  }

 private:
  void AddScene() {
    const auto first = CamFromWorldByName(inputs_.models.front().model);
    const auto& target = inputs_.reference.empty() ? first : inputs_.reference;
    std::vector<PlacedModel> models;
    for (const ComparedModel& compared : inputs_.models) {
      models.push_back(Place(compared.model, target, inputs_.max_num_points));
    }
    if (!inputs_.reference.empty()) models.push_back(ReferenceAsModel(models.back()));
    std::vector<Eigen::Vector3d> centres;
    std::vector<Eigen::Vector3d> points;
    for (const PlacedModel& model : models) {
      points.insert(points.end(), model.points.begin(), model.points.end());
      for (const auto& [name, camera] : model.cameras) {
        centres.push_back(OriginInSource(camera.first));
      }
    }
    const Box box = BoxOf(centres, points);
    const Focus focus = FocusOf(centres, points);
    json& scene = comparison_["scene"];
    scene = {{"up", AsJson(UpOf(models.front()))},
             {"centre", AsJson(focus.centre)},
             {"radius", focus.radius},
             {"models", json::array()}};
    for (const PlacedModel& model : models) {
      scene["models"].push_back(
          {{"cameras", CamerasOf(model, view_idxs_)}, {"points", PackPoints(model, box)}});
    }
  }

  // With the lenses of another model, for a reference may have none.
  PlacedModel ReferenceAsModel(const PlacedModel& other) const {
    PlacedModel placed;
    for (const auto& [name, cam_from_world] : inputs_.reference) {
      const auto found = other.cameras.find(name);
      if (found != other.cameras.end())
        placed.cameras[name] = {cam_from_world, found->second.second};
    }
    return placed;
  }

  void AddReference() {
    json model = comparison_["models"].front();
    for (auto& [key, value] : model.items()) value = nullptr;
    model["name"] = "reference";
    model["path"] = inputs_.reference_path.string();
    model["role"] = "reference";
    model["num_images"] = inputs_.reference.size();
    comparison_["models"].push_back(model);
    for (json& view : comparison_["views"]) view["by_model"].push_back(nullptr);
  }

  void AddPhotos(const ProgressCallback& progress) {
    json& views = comparison_["views"];
    const double share = kManyViews / static_cast<double>(std::max<size_t>(1, views.size()));
    const int width = static_cast<int>(kPictureWidth * std::min(1.0, std::sqrt(share)));
    std::vector<std::pair<json, json>> pictures(views.size());
    const auto draw = [&](int64_t idx) {
      const auto i = static_cast<size_t>(idx);
      pictures[i] = DrawPhoto(views[i]["name"], width);
    };
    ParallelFor(static_cast<int64_t>(views.size()), inputs_.num_threads, draw, progress);
    for (size_t i = 0; i < views.size(); ++i) {
      views[i]["thumbnail"] = std::move(pictures[i].first);
      views[i]["overlay"] = std::move(pictures[i].second);
    }
  }

  // The photo, and what is excluded and used of it.
  std::pair<json, json> DrawPhoto(const std::string& name, int width) const {
    if (inputs_.image_path.empty() || !fs::exists(inputs_.image_path / name)) return {};
    const RgbImage photo = ReadRgbImage(inputs_.image_path / name);
    RgbImage overlay = ResizeToWidth(photo, width);
    const std::string thumbnail = DataUrl(overlay);
    const ImageSize size = {static_cast<uint64_t>(photo.width()),
                            static_cast<uint64_t>(photo.height())};
    if (const fs::path mask = MaskPath(inputs_.mask_path, name);
        !inputs_.mask_path.empty() && fs::exists(mask)) {
      overlay = DrawMaskOverlay(photo, ReadMaskOfSize(mask, size), width);
    }
    const double scale = static_cast<double>(width) / photo.width();
    if (const auto image = last_images_.find(name); image != last_images_.end()) {
      for (const Point2D& point2D : image->second->points2D) {
        if (point2D.HasPoint3D()) DrawDisc(point2D.xy * scale, 1.3, kUsedFeature, overlay);
      }
    }
    return {thumbnail, DataUrl(overlay)};
  }

  const ComparisonInputs& inputs_;
  json& comparison_;
  std::map<std::string, size_t> view_idxs_;
  std::map<std::string, const Image*> last_images_;  // of the last model
};

}  // namespace

void AddPictures(const ComparisonInputs& inputs,
                 nlohmann::json& comparison,
                 const ProgressCallback& progress) {
  Pictures(inputs, comparison).Add(progress);
}

void WriteComparisonPage(const std::filesystem::path& path,
                         const ComparisonInputs& inputs,
                         nlohmann::json comparison) {
  ProgressDisplay display("report");
  AddPictures(inputs, comparison, display.Callback());
  WriteFileAtomically(path, MakeReportPage(comparison));
}

}  // namespace vgtw
