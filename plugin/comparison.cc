// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/comparison.h"

#include "bridge/colmap_database.h"
#include "bridge/mask_files.h"
#include "evaluation/histogram.h"
#include "evaluation/model_quality.h"
#include "evaluation/pose_error.h"
#include "evaluation/scale_drift.h"
#include "plugin/comparison_findings.h"
#include "plugin/database_tracks.h"
#include "plugin/json_number.h"
#include "plugin/version.h"
#include "refine/held_out.h"
#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace vgtw {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

json OrNull(const std::optional<double>& value) { return NumberOrNull(value.value_or(NAN)); }

json OrNull(const std::map<ImageId, double>& values, ImageId id) {
  const auto found = values.find(id);
  return found == values.end() ? json(nullptr) : NumberOrNull(found->second);
}

json AsJson(const std::optional<PoseComparison>& error) {
  if (!error) return nullptr;
  return {{"centre_rmse_percent", error->centre_rmse_percent},
          {"rotation_median_deg", NumberOrNull(error->relative_rotation_median_deg)},
          {"direction_median_deg", NumberOrNull(error->relative_direction_median_deg)},
          {"num_views", error->views.size()}};
}

json AsJson(const Histogram& histogram) {
  return {{"first", histogram.first}, {"step", histogram.step}, {"counts", histogram.counts}};
}

// Errors of the database's tracks under each model.
struct HeldOut {
  std::vector<double> mean_px;
  std::vector<std::map<ImageId, double>> mean_px_by_image;
};

struct Judgement {
  const ComparedModel& compared;
  ModelQuality quality;
  std::optional<PoseComparison> change;  // against the first model
  std::optional<PoseComparison> error;   // against the reference
  std::optional<double> scale_drift_percent;
  std::map<std::string, const ViewPoseError*> change_by_name;
  std::map<std::string, const ViewPoseError*> error_by_name;
  std::map<std::string, ImageId> ids;
};

std::map<std::string, const ViewPoseError*> ByName(const std::optional<PoseComparison>& poses) {
  std::map<std::string, const ViewPoseError*> by_name;
  if (!poses) return by_name;
  for (const ViewPoseError& view : poses->views) by_name[view.name] = &view;
  return by_name;
}

class Comparison {
 public:
  explicit Comparison(const ComparisonInputs& inputs) : inputs_(inputs) {
    VGTW_CHECK(!inputs.models.empty(), "no model to compare");
  }

  json Run(const ProgressCallback& progress) {
    const auto num_steps = static_cast<int64_t>(inputs_.models.size()) + 1;
    judgements_.reserve(inputs_.models.size());
    for (const ComparedModel& model : inputs_.models) {
      judgements_.push_back(Judge(model));
      if (progress) progress(static_cast<int64_t>(judgements_.size()), num_steps);
    }
    MeasureHeldOut();
    if (progress) progress(num_steps, num_steps);
    json result = {{"title", inputs_.title},
                   {"producer", std::string("vgtw ") + kVersion},
                   {"command", inputs_.command},
                   {"alignment", AlignmentNote()},
                   {"models", json::array()},
                   {"views", Views()}};
    for (size_t i = 0; i < judgements_.size(); ++i) result["models"].push_back(ModelAsJson(i));
    AddHistograms(result["models"]);
    result["guilty"] = FindGuiltyViews(result);
    result["summary"] = Summarise(result);
    result["notes"] = notes_;
    return result;
  }

 private:
  Judgement Judge(const ComparedModel& compared) {
    Judgement judgement{compared, {}, {}, {}, {}, {}, {}, {}};
    for (const auto& [id, image] : compared.model.images) judgement.ids[image.name] = id;
    std::function<StaticMask(const std::string&)> mask;
    if (!inputs_.mask_path.empty()) {
      mask = [&](const std::string& name) {
        const Image& image = compared.model.images.at(judgement.ids.at(name));
        return MaskOf(compared.model.cameras.at(image.camera_id), name);
      };
    }
    judgement.quality = MeasureQuality(compared.model, mask);
    const auto poses = CamFromWorldByName(compared.model);
    const auto first = CamFromWorldByName(inputs_.models.front().model);
    const auto& target = inputs_.reference.empty() ? first : inputs_.reference;
    judgement.change = ComparePoses(poses, first);
    judgement.scale_drift_percent = ScaleDriftPercent(poses, target);
    if (!inputs_.reference.empty()) {
      judgement.error = ComparePoses(poses, inputs_.reference);
      if (!judgement.error) {
        notes_.push_back("'" + compared.name +
                         "' and the reference share fewer than 3 photos in general position");
      }
    }
    judgement.change_by_name = ByName(judgement.change);
    judgement.error_by_name = ByName(judgement.error);
    return judgement;
  }

  StaticMask MaskOf(const Camera& camera, const std::string& name) {
    const fs::path path = MaskPath(inputs_.mask_path, name);
    StaticMask mask(static_cast<int>(camera.width), static_cast<int>(camera.height), 255);
    if (fs::exists(path)) mask = ReadMaskOfSize(path, {camera.width, camera.height});
    excluded_percent_[name] = 100.0 * ExcludedShare(mask);
    return mask;
  }

  // Ids and names must be the database's.
  bool IsOfDatabase(const ColmapDatabase& database, const Reconstruction& model) const {
    std::map<ImageId, std::string> names;
    for (const DatabaseImage& image : database.ReadImages()) names[image.image_id] = image.name;
    return std::all_of(model.images.begin(), model.images.end(), [&](const auto& entry) {
      const auto found = names.find(entry.first);
      return found != names.end() && found->second == entry.second.name;
    });
  }

  void MeasureHeldOut() {
    if (inputs_.database_path.empty()) return;
    const ColmapDatabase database(inputs_.database_path, ColmapDatabase::Mode::kReadOnly);
    std::set<ImageId> common;
    for (const auto& [id, image] : inputs_.models.front().model.images) common.insert(id);
    for (const ComparedModel& compared : inputs_.models) {
      if (!IsOfDatabase(database, compared.model)) {
        notes_.push_back("'" + compared.name + "' has other image ids than " +
                         inputs_.database_path.string() + ": tracks held out are left out");
        return;
      }
      std::erase_if(common, [&](ImageId id) { return !compared.model.images.contains(id); });
    }
    Reconstruction first = inputs_.models.front().model;
    std::vector<Track> tracks = ReadTracks(database, first);
    for (Track& track : tracks) {
      std::erase_if(
          track, [&](const TrackElement& element) { return !common.contains(element.image_id); });
    }
    std::erase_if(tracks, [](const Track& track) { return track.size() < 2; });
    const HeldOutJudge judge(
        HoldOutTracks(tracks, inputs_.held_out_percent, inputs_.held_out_seed).held_out,
        1.0,
        inputs_.held_out_max_px,
        inputs_.num_threads);
    for (const ComparedModel& compared : inputs_.models) {
      // The judge wants poses, cameras and the keypoints that tracks name.
      Reconstruction model;
      model.cameras = compared.model.cameras;
      for (const ImageId id : common) {
        Image& image = model.images[id] = compared.model.images.at(id);
        image.points2D = first.images.at(id).points2D;
      }
      const HeldOutJudge::Errors errors = judge.Measure(model);
      held_out_.mean_px.push_back(judge.MeanPx(errors));
      held_out_.mean_px_by_image.push_back(judge.MeanPxByImage(errors));
    }
  }

  std::string AlignmentNote() const {
    return inputs_.reference.empty()
               ? "changes: Sim3-aligned to '" + inputs_.models.front().name + "' on camera centres"
               : "errors: Sim3-aligned to the reference on camera centres; changes: likewise to '" +
                     inputs_.models.front().name + "'";
  }

  json ModelAsJson(size_t i) const {
    const Judgement& judgement = judgements_[i];
    const ModelQuality& quality = judgement.quality;
    const ReprojectionStats& stats = quality.reprojection;
    const bool is_last = i + 1 == judgements_.size();
    return {{"name", judgement.compared.name},
            {"path", judgement.compared.path.string()},
            {"role",
             i == 0    ? "before"
             : is_last ? "after"
                       : "other"},
            {"num_images", stats.num_images},
            {"num_points3D", stats.num_points3D},
            {"num_observations", stats.num_observations},
            {"mean_track_length", stats.mean_track_length},
            {"median_px", stats.median_px},
            {"p90_px", stats.p90_px},
            {"median_angle_deg", NumberOrNull(quality.median_angle_deg)},
            {"coverage_percent", quality.coverage_percent},
            {"held_out_px",
             held_out_.mean_px.empty() ? json(nullptr) : NumberOrNull(held_out_.mean_px[i])},
            {"points_on_distractors",
             quality.num_points_on_distractors ? json(*quality.num_points_on_distractors)
                                               : json(nullptr)},
            {"scale_drift_percent", OrNull(judgement.scale_drift_percent)},
            {"pose_error", AsJson(judgement.error)}};
  }

  // Of each model, over bins that hold 9 of 10 observations of every one.
  void AddHistograms(json& models) const {
    constexpr size_t kNumBins = 40;
    constexpr size_t kMaxTrackLength = 30;
    double max_px = 0.0;
    for (const Judgement& judgement : judgements_) {
      max_px = std::max(max_px, judgement.quality.reprojection.p90_px);
    }
    const double step_px = max_px > 0.0 ? max_px / kNumBins : 1.0;
    for (size_t i = 0; i < judgements_.size(); ++i) {
      const ModelQuality& quality = judgements_[i].quality;
      models[i]["error_histogram"] =
          AsJson(MakeHistogram(quality.errors_px, 0.0, step_px, kNumBins));
      models[i]["track_histogram"] =
          AsJson(MakeHistogram(quality.track_lengths, 2.0, 1.0, kMaxTrackLength - 1));
    }
  }

  json Views() const {
    std::map<std::string, const Camera*> cameras;
    for (const Judgement& judgement : judgements_) {
      const Reconstruction& model = judgement.compared.model;
      for (const auto& [id, image] : model.images) {
        cameras[image.name] = &model.cameras.at(image.camera_id);
      }
    }
    json views = json::array();
    for (const auto& [name, camera] : cameras) {
      json by_model = json::array();
      for (size_t i = 0; i < judgements_.size(); ++i) by_model.push_back(ViewOfModel(i, name));
      const auto excluded = excluded_percent_.find(name);
      views.push_back(
          {{"name", name},
           {"width", camera->width},
           {"height", camera->height},
           {"excluded_percent",
            excluded == excluded_percent_.end() ? json(nullptr) : json(excluded->second)},
           {"by_model", by_model}});
    }
    return views;
  }

  json ViewOfModel(size_t i, const std::string& name) const {
    const Judgement& judgement = judgements_[i];
    const auto id = judgement.ids.find(name);
    if (id == judgement.ids.end()) return nullptr;
    const ViewQuality& quality = judgement.quality.views.at(id->second);
    json view = {{"num_observations", quality.num_observations},
                 {"median_px", NumberOrNull(quality.median_px)},
                 {"coverage_percent", quality.coverage_percent},
                 {"mean_track_length", NumberOrNull(quality.mean_track_length)},
                 {"median_angle_deg", NumberOrNull(quality.median_angle_deg)},
                 {"held_out_px", nullptr},
                 {"observations_on_distractors", nullptr},
                 {"status", nullptr},
                 {"reason", nullptr}};
    if (!held_out_.mean_px.empty()) {
      view["held_out_px"] = OrNull(held_out_.mean_px_by_image[i], id->second);
    }
    if (judgement.quality.num_points_on_distractors) {
      view["observations_on_distractors"] = quality.num_on_distractors;
    }
    AddPoses("change", judgement.change, judgement.change_by_name, name, view);
    AddPoses("error", judgement.error, judgement.error_by_name, name, view);
    if (i + 1 == judgements_.size() && inputs_.refinement.is_object()) {
      const json& refined = inputs_.refinement.at("views").value(name, json::object());
      view["status"] = refined.value("outcome", json(nullptr));
      view["reason"] = refined.value("reason", json(nullptr));
    }
    return view;
  }

  static void AddPoses(const std::string& what,
                       const std::optional<PoseComparison>& poses,
                       const std::map<std::string, const ViewPoseError*>& by_name,
                       const std::string& name,
                       json& view) {
    json& rotation_deg = view["rotation_" + what + "_deg"] = nullptr;
    json& centre_percent = view["centre_" + what + "_percent"] = nullptr;
    const auto found = by_name.find(name);
    if (found == by_name.end()) return;
    rotation_deg = NumberOrNull(found->second->relative_rotation_deg);
    centre_percent = NumberOrNull(100.0 * found->second->centre / poses->extent);
  }

  const ComparisonInputs& inputs_;
  std::vector<Judgement> judgements_;
  HeldOut held_out_;
  std::map<std::string, double> excluded_percent_;
  std::vector<std::string> notes_;
};

}  // namespace

void UseRunRecord(const json& record, ComparisonInputs& inputs) {
  const auto value_or = [&record](const char* pointer, auto fallback) {
    const json::json_pointer at(pointer);
    return record.contains(at) && record.at(at).is_number()
               ? record.at(at).get<decltype(fallback)>()
               : fallback;
  };
  const json::json_pointer result("/stages/refine/result");
  if (!record.is_object() || !record.contains(result / "views")) return;
  inputs.refinement = record.at(result);
  inputs.held_out_max_px =
      value_or("/stages/refine/result/held_out_max_px", inputs.held_out_max_px);
  inputs.held_out_percent = value_or("/options/refine/held_out_percent", inputs.held_out_percent);
  inputs.held_out_seed = value_or("/options/refine/seed", inputs.held_out_seed);
}

json CompareModels(const ComparisonInputs& inputs, const ProgressCallback& progress) {
  return Comparison(inputs).Run(progress);
}

}  // namespace vgtw
