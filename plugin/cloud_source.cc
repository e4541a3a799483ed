// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/cloud_source.h"

#include "bridge/colmap_model.h"
#include "bridge/point_cloud.h"
#include "evaluation/pose_alignment.h"
#include "plugin/static_views.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <algorithm>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

bool IsPredictionsFolder(const fs::path& path) { return fs::exists(path / "predictions.json"); }

CloudAlignment AlignByPixels(const CloudSource& prediction, const CloudSource& reference) {
  PointPairs pairs;
  const std::vector<std::string> names = CommonViews(prediction, reference);
  for (const std::string& name : names) {
    AddPixelPairs(prediction.Filtered(name), reference.Filtered(name), pairs);
  }
  const auto motion = EstimateSim3d(pairs.in_prediction, pairs.in_reference);
  if (!motion) {
    Fail(prediction.path(),
         "has " + std::to_string(pairs.in_prediction.size()) +
             " pixels of depth in common with the reference",
         "enough for an alignment",
         "raise --keep_percent, or give --alignment cameras");
  }
  return {*motion, "pixels", pairs.in_prediction.size(), names.size()};
}

CloudAlignment AlignByCameras(const CloudSource& prediction, const CloudSource& reference) {
  std::vector<Rigid3d> predicted;
  std::vector<Rigid3d> expected;
  for (const auto& [name, cam_from_world] : prediction.poses()) {
    const auto found = reference.poses().find(name);
    if (found == reference.poses().end()) continue;
    predicted.push_back(cam_from_world);
    expected.push_back(found->second);
  }
  const auto aligned = AlignPoses(predicted, expected);
  if (!aligned) {
    Fail(prediction.path(),
         "has " + std::to_string(predicted.size()) + " cameras in common with the reference",
         "three or more that are not on a line",
         "give --alignment pixels or none");
  }
  return {aligned->reference_from_estimate, "cameras", predicted.size(), predicted.size()};
}

}  // namespace

CloudSource::CloudSource(const fs::path& path, const PredictionFilterOptions& filter)
    : path_(path), options_(filter) {
  if (IsPredictionsFolder(path)) {
    predictions_ = std::make_unique<PredictionReader>(path);
    idx_by_name_ = IndexByName(*predictions_);
    for (const View& view : predictions_->views()) poses_[view.name] = view.cam_from_world;
    const PredictionReader& reader = *predictions_;
    filter_.emplace(
        reader.views().size(), [&reader](size_t i) { return reader.Load(i); }, filter);
  } else if (IsModelFolder(path)) {
    const Reconstruction model = ReadModel(path);
    poses_ = CamFromWorldByName(model);
    for (const auto& [point3D_id, point] : model.points3D) points_.push_back(point.xyz);
  } else if (fs::is_regular_file(path)) {
    for (const ColoredPoint& point : ReadPly(path)) points_.push_back(point.xyz.cast<double>());
  } else {
    Fail(path, "is none of them", "a predictions folder, a COLMAP model or a .ply file");
  }
}

const std::vector<Eigen::Vector3d>& CloudSource::Points() {
  if (filter_ && points_.empty()) points_ = WorldPoints(*filter_, options_.num_threads);
  if (points_.empty()) Fail(path_, "gives no point", "a cloud", "raise the share that is kept");
  return points_;
}

bool CloudSource::HasMaps() const {
  return std::ranges::any_of(
      idx_by_name_, [&](const auto& view) { return ViewOf(view.first).network_width > 0; });
}

const View& CloudSource::ViewOf(const std::string& name) const {
  return predictions_->views()[idx_by_name_.at(name)];
}

ViewPrediction CloudSource::Filtered(const std::string& name) const {
  return filter_->Filtered(idx_by_name_.at(name));
}

std::string CloudSource::FilterText() const {
  if (!filter_) return "as it is";
  std::string text;
  if (options_.keep_percent < 100.0) {
    text = FormatNumber(options_.keep_percent, 1) + " % most confident of " +
           (options_.pool_views
                ? "all views (confidence from " + FormatNumber(filter_->pooled_threshold(), 3) + ")"
                : "each view") +
           " " + (options_.percent_of_all ? "before" : "after") + " the distractor test, ";
  }
  return text + "distractor probability below " + FormatNumber(options_.distractor_threshold, 2);
}

json CloudSource::FilterAsJson() const {
  if (!filter_) return nullptr;
  return {{"keep_percent", options_.keep_percent},
          {"keep_scope", options_.pool_views ? "all" : "view"},
          {"confidence_threshold", filter_->pooled_threshold()},
          {"keep_order", options_.percent_of_all ? "before" : "after"},
          {"mask_threshold", options_.distractor_threshold}};
}

std::vector<std::string> CommonViews(const CloudSource& prediction, const CloudSource& reference) {
  std::vector<std::string> names;
  for (const auto& [name, idx] : prediction.views()) {
    if (!reference.views().contains(name)) continue;
    const Camera& predicted = prediction.ViewOf(name).camera;
    const Camera& expected = reference.ViewOf(name).camera;
    if (predicted.width != expected.width || predicted.height != expected.height) {
      Fail(prediction.path() / name,
           "is of " + std::to_string(predicted.width) + " x " + std::to_string(predicted.height) +
               " pixels",
           std::to_string(expected.width) + " x " + std::to_string(expected.height) +
               " as in the reference",
           "predict both from the same photos");
    }
    names.push_back(name);
  }
  if (names.empty()) {
    Fail(prediction.path(),
         "and " + reference.path().string() + " have no view in common",
         "predictions of the same photos",
         "points can be compared with --alignment none or --icp similarity");
  }
  return names;
}

CloudAlignment AlignClouds(const CloudSource& prediction,
                           const CloudSource& reference,
                           const std::string& method) {
  const bool have_pixels = prediction.HasMaps() && reference.HasMaps();
  const bool have_cameras = !prediction.poses().empty() && !reference.poses().empty();
  if (method == "pixels" && !have_pixels) {
    Fail(prediction.path(), "or the reference has no depth maps", "predictions folders");
  }
  if (method == "cameras" && !have_cameras) {
    Fail(prediction.path(), "or the reference has no cameras", "predictions or COLMAP models");
  }
  if (method == "none" || (method == "auto" && !have_cameras)) return {};
  if (method == "pixels" || (method == "auto" && have_pixels)) {
    return AlignByPixels(prediction, reference);
  }
  return AlignByCameras(prediction, reference);
}

std::vector<Eigen::Vector3d> Moved(const Sim3d& reference_from_prediction,
                                   std::vector<Eigen::Vector3d> points) {
  for (Eigen::Vector3d& point : points) point = reference_from_prediction * point;
  return points;
}

std::string AlignmentText(const CloudAlignment& alignment) {
  if (alignment.method == "none") return "not aligned";
  return "Sim3-aligned (Umeyama) on " + std::to_string(alignment.num_pairs) +
         (alignment.method == "pixels"
              ? " pixels of " + std::to_string(alignment.num_views) + " views"
              : " cameras");
}

json AsJson(const Sim3d& motion) {
  const Eigen::Quaterniond& q = motion.rotation;
  const Eigen::Vector3d& t = motion.translation;
  return {{"scale", motion.scale},
          {"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
          {"translation", {t.x(), t.y(), t.z()}}};
}

json AsJson(const CloudAlignment& alignment) {
  return {{"method", alignment.method},
          {"num_pairs", alignment.num_pairs},
          {"num_views", alignment.num_views},
          {"reference_from_prediction", AsJson(alignment.reference_from_prediction)}};
}

void CloudSourceFlags::Resolve(int num_threads) {
  for (PredictionFilterOptions* options : {&filter, &reference_filter}) {
    options->pool_views = keep_scope == "all";
    options->percent_of_all = keep_order == "before";
    options->num_threads = num_threads;
    options->Check();
  }
}

void AddFilterFlags(Flags& flags, CloudSourceFlags& sources) {
  flags
      .Add("keep_percent",
           &sources.filter.keep_percent,
           "Share of the prediction's depths kept, the most confident ones, percent")
      .Add("reference_keep_percent",
           &sources.reference_filter.keep_percent,
           "The same of the reference")
      .AddChoice("keep_scope",
                 &sources.keep_scope,
                 {"all", "view"},
                 "These are shares of all views together or of each view")
      .AddChoice("keep_order",
                 &sources.keep_order,
                 {"before", "after"},
                 "They are taken before distractors are left out, or after")
      .Add("mask_threshold",
           &sources.filter.distractor_threshold,
           "Distractor probability from which a pixel is left out of the prediction, in (0,1]");
}

void AddAlignmentFlag(Flags& flags, CloudSourceFlags& sources) {
  flags.AddChoice("alignment",
                  &sources.alignment,
                  {"auto", "pixels", "cameras", "none"},
                  "The prediction is moved by the best similarity (Umeyama) of the pixels or the "
                  "cameras that both have; auto: the first of these that there is");
}

}  // namespace vgtw
