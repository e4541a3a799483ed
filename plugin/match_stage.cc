// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/match_stage.h"

#include "bridge/seed.h"
#include "plugin/progress.h"
#include "plugin/static_views.h"
#include "scene/error.h"
#include "scene/parallel.h"
#include "scene/statistics.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <utility>

namespace vgtw {
namespace {

// An image of the database with its prediction.
struct StageImage {
  ImageId image_id = 0;
  size_t prediction_idx = 0;
  View view;  // the database's camera, the predicted pose
};

// Images that have a prediction, in the order of their names.
std::vector<StageImage> ListStageImages(const PredictionReader& predictions,
                                        const ColmapDatabase& database,
                                        MatchStageSummary& summary) {
  const std::map<std::string, size_t> idx_by_name = IndexByName(predictions);
  SeedOptions seed_options;
  seed_options.with_points = false;
  const Reconstruction seed = MakeSeed(predictions, database, seed_options).reconstruction;
  std::vector<StageImage> images;
  for (const auto& [image_id, image] : seed.images) {
    const size_t idx = idx_by_name.at(image.name);
    View view = predictions.views()[idx];
    view.camera = seed.cameras.at(image.camera_id);
    images.push_back({image_id, idx, std::move(view)});
  }
  std::sort(images.begin(), images.end(), [](const StageImage& a, const StageImage& b) {
    return a.view.name < b.view.name;
  });
  for (const DatabaseImage& image : database.ReadImages()) {
    if (!idx_by_name.contains(image.name)) summary.without_predictions.push_back(image.name);
  }
  return images;
}

class MatchStage {
 public:
  MatchStage(const PredictionReader& predictions,
             const MatchStageOptions& options,
             ColmapDatabase& database)
      : predictions_(predictions), options_(options), database_(database) {}

  MatchStageSummary Run() {
    images_ = ListStageImages(predictions_, database_, summary_);
    for (const StageImage& image : images_) {
      summary_.images.emplace_back().name = image.view.name;
    }
    rotation_errors_.resize(images_.size());
    const std::vector<ViewPair> pairs = ChoosePairs();
    ColmapDatabase::Transaction transaction(database_);
    database_.ClearMatches();
    Match(pairs);
    if (summary_.num_inlier_matches == 0) {
      Fail(database_.path(),
           "none of " + std::to_string(pairs.size()) + " co-visible pairs has verified matches",
           "at least one",
           "the photos may not overlap, or the predictions are of other photos");
    }
    transaction.Commit();
    for (size_t i = 0; i < images_.size(); ++i) {
      if (!rotation_errors_[i].empty()) {
        summary_.images[i].prediction_error_deg = Median(rotation_errors_[i]);
      }
    }
    return std::move(summary_);
  }

 private:
  StaticView LoadStaticView(size_t idx) const {
    return StaticView(predictions_.Load(images_[idx].prediction_idx),
                      options_.distractor_threshold);
  }
  std::vector<ViewPair> ChoosePairs();
  MatchViewsOptions ViewOptions() const;
  ViewFeatures LoadFeatures(size_t idx);
  void Match(const std::vector<ViewPair>& pairs);
  void Take(const ViewPair& views, const MatchedPair& pair);

  const PredictionReader& predictions_;
  const MatchStageOptions& options_;
  ColmapDatabase& database_;
  std::mutex database_mutex_;
  std::vector<StageImage> images_;
  std::vector<double> middle_depths_;
  std::vector<std::vector<double>> rotation_errors_;  // degrees, per image
  MatchStageSummary summary_;
};

std::vector<ViewPair> MatchStage::ChoosePairs() {
  ProgressDisplay display("pairs");
  std::vector<ViewSketch> sketches(images_.size());
  ParallelFor(
      static_cast<int64_t>(images_.size()),
      options_.num_threads,
      [&](int64_t i) {
        const auto idx = static_cast<size_t>(i);
        const StaticView view = LoadStaticView(idx);
        sketches[idx] = MakeViewSketch(view, ConfidenceThreshold(view, options_.keep_percent));
      },
      display.Callback());
  for (const ViewSketch& sketch : sketches) {
    std::vector<double> depths;
    for (const Eigen::Vector3d& point : sketch.points) {
      depths.push_back((sketch.view.cam_from_world * point).z());
    }
    if (!depths.empty()) middle_depths_.push_back(Median(std::move(depths)));
  }
  PairSelectionOptions options = options_.pairs;
  options.num_threads = options_.num_threads;
  std::vector<ViewPair> pairs = SelectPairs(sketches, options);
  if (pairs.empty()) {
    Fail(predictions_.folder(),
         "no two of " + std::to_string(images_.size()) + " views see the same",
         "co-visible views",
         "wrong poses? 'vgtw import' names suspected convention mistakes");
  }
  summary_.num_pairs = pairs.size();
  return pairs;
}

MatchViewsOptions MatchStage::ViewOptions() const {
  std::vector<Eigen::Vector3d> centres;
  for (const StageImage& image : images_) {
    centres.push_back(OriginInSource(image.view.cam_from_world));
  }
  MatchViewsOptions options = options_.views;
  options.num_threads = options_.num_threads;
  options.pair.uncertainty.centre =
      options_.centre_percent / 100.0 * ErrorUnit(centres, middle_depths_);
  return options;
}

ViewFeatures MatchStage::LoadFeatures(size_t idx) {
  const StaticView static_view = LoadStaticView(idx);
  Features features;
  {
    const std::lock_guard lock(database_mutex_);
    const ImageId image_id = images_[idx].image_id;
    features.keypoints = database_.ReadKeypoints(image_id).value_or(Keypoints());
    features.descriptors = database_.ReadDescriptors(image_id).value_or(Descriptors());
  }
  if (features.keypoints.rows != features.descriptors.rows) {
    Fail(database_.path(),
         images_[idx].view.name + " has " + std::to_string(features.keypoints.rows) +
             " keypoints and " + std::to_string(features.descriptors.rows) + " descriptors",
         "as many of both",
         "features without descriptors cannot be matched");
  }
  summary_.images[idx].num_keypoints = features.keypoints.rows;
  return MakeViewFeatures(images_[idx].view,
                          std::move(features),
                          &static_view,
                          ConfidenceThreshold(static_view, options_.keep_percent));
}

void MatchStage::Take(const ViewPair& views, const MatchedPair& pair) {
  switch (pair.method) {
    case MatchMethod::kGuided:
      ++summary_.num_guided;
      break;
    case MatchMethod::kWidened:
      ++summary_.num_widened;
      break;
    case MatchMethod::kUnguided:
      ++summary_.num_unguided;
      break;
    case MatchMethod::kNone:
      ++summary_.num_unmatched;
      return;
  }
  const size_t num_inliers = pair.geometry.inlier_matches.size();
  summary_.num_inlier_matches += num_inliers;
  for (const size_t idx : {views.view_idx1, views.view_idx2}) {
    ++summary_.images[idx].num_pairs;
    summary_.images[idx].num_inlier_matches += num_inliers;
    if (pair.prediction_error) {
      rotation_errors_[idx].push_back(pair.prediction_error->rotation_deg);
    }
  }
  const std::lock_guard lock(database_mutex_);
  const ImageId image_id1 = images_[views.view_idx1].image_id;
  const ImageId image_id2 = images_[views.view_idx2].image_id;
  database_.WriteMatches(image_id1, image_id2, pair.matches);
  database_.WriteTwoViewGeometry(image_id1, image_id2, pair.geometry);
}

void MatchStage::Match(const std::vector<ViewPair>& pairs) {
  ProgressDisplay display("matches");
  MatchViews(
      pairs,
      images_.size(),
      [&](size_t idx) { return LoadFeatures(idx); },
      [&](size_t pair_idx, const MatchedPair& pair) { Take(pairs[pair_idx], pair); },
      ViewOptions(),
      display.Callback());
}

}  // namespace

nlohmann::json AsJson(const MatchStageSummary& summary) {
  nlohmann::json images = nlohmann::json::object();
  for (const MatchedImage& image : summary.images) {
    nlohmann::json& entry = images[image.name];
    entry = {{"num_keypoints", image.num_keypoints},
             {"num_pairs", image.num_pairs},
             {"num_inlier_matches", image.num_inlier_matches}};
    if (image.prediction_error_deg) entry["prediction_error_deg"] = *image.prediction_error_deg;
  }
  return {{"images", images},
          {"without_predictions", summary.without_predictions},
          {"num_pairs", summary.num_pairs},
          {"num_verified_pairs", summary.num_pairs - summary.num_unmatched},
          {"num_guided", summary.num_guided},
          {"num_widened", summary.num_widened},
          {"num_unguided", summary.num_unguided},
          {"num_inlier_matches", summary.num_inlier_matches}};
}

MatchStageSummary MatchDatabase(const PredictionReader& predictions,
                                const MatchStageOptions& options,
                                ColmapDatabase& database) {
  VGTW_CHECK(options.keep_percent > 0.0 && options.keep_percent <= 100.0,
             "MatchStageOptions::keep_percent");
  VGTW_CHECK(options.centre_percent >= 0.0 && options.centre_percent <= 100.0,
             "MatchStageOptions::centre_percent");
  return MatchStage(predictions, options, database).Run();
}

}  // namespace vgtw
