// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/pipeline.h"

#include "bridge/colmap_database.h"
#include "bridge/colmap_model.h"
#include "bridge/mask_apply.h"
#include "bridge/mask_files.h"
#include "bridge/point_cloud.h"
#include "bridge/predictions.h"
#include "plugin/colmap.h"
#include "plugin/comparison_pictures.h"
#include "plugin/database_tracks.h"
#include "plugin/feature_stage.h"
#include "plugin/hashing.h"
#include "plugin/progress.h"
#include "plugin/refine_report.h"
#include "plugin/report.h"
#include "plugin/workspace.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "scene/point_colors.h"

#include <algorithm>
#include <map>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string JoinLines(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

// The stages of one run, in order; each reads what the ones before left in the workspace.
class Pipeline {
 public:
  explicit Pipeline(const PipelineOptions& options)
      : options_(options),
        colmap_(options.colmap),
        predictions_(options.predictions_path),
        workspace_(options.output_path, options.overwrite, options.force) {}

  PipelineReport Run() {
    RecordInputs();
    if (options_.use_masks) MakeMasks();
    ExtractFeatures();
    MatchFeatures();
    Refine();
    return Report();
  }

 private:
  void RecordInputs();
  void MakeMasks();
  void ExtractFeatures();
  std::string ExtractByColmap(const fs::path& database_path);
  json CheckFeatures(const fs::path& database_path, const std::string& last_words) const;
  void MatchFeatures();
  json MatchByColmap();
  void Refine();
  PipelineReport Report();

  std::string ThreadsOrAll() const {
    return std::to_string(options_.num_threads > 0 ? options_.num_threads : -1);
  }

  PipelineOptions options_;
  Colmap colmap_;
  PredictionReader predictions_;
  Workspace workspace_;
  std::vector<std::string> image_names_;  // photos with a prediction
  std::vector<std::string> notes_;
  json inputs_hash_;
};

void Pipeline::RecordInputs() {
  const std::vector<std::string> photos = ListImages(options_.image_path);
  size_t num_without = 0;
  for (const std::string& name : photos) {
    const auto has_name = [&](const View& view) { return view.name == name; };
    if (std::any_of(predictions_.views().begin(), predictions_.views().end(), has_name)) {
      image_names_.push_back(name);
    } else {
      ++num_without;
    }
  }
  if (image_names_.size() < 2) {
    Fail(options_.image_path,
         std::to_string(image_names_.size()) + " photos have a prediction",
         "at least 2",
         "names in " + (options_.predictions_path / "predictions.json").string() +
             " must equal the photos' names");
  }
  if (num_without > 0) notes_.push_back(std::to_string(num_without) + " photos have no prediction");
  ProgressDisplay display("hashing inputs");
  inputs_hash_ = {
      {"photos",
       HashFiles(options_.image_path, image_names_, options_.num_threads, display.Callback())},
      {"predictions",
       HashFiles(
           options_.predictions_path, ListFiles(options_.predictions_path), options_.num_threads)},
      {"masks",
       options_.mask_path.empty()
           ? ""
           : HashFiles(options_.mask_path, ListFiles(options_.mask_path), options_.num_threads)},
      {"colmap", colmap_.version()}};
  workspace_.Record("inputs", inputs_hash_);
  workspace_.Record("options", OptionsAsJson(options_));
}

void Pipeline::MakeMasks() {
  const json inputs = {{"mask", OptionsAsJson(options_)["mask"]},
                       {"photos", inputs_hash_["photos"]},
                       {"predictions", inputs_hash_["predictions"]},
                       {"masks", inputs_hash_["masks"]}};
  const json result = workspace_.RunStage("masks", inputs, workspace_.masks(), [&] {
    ProgressDisplay display("masks");
    const auto summaries = options_.mask_path.empty() ? WriteMasks(predictions_,
                                                                   workspace_.masks(),
                                                                   options_.mask,
                                                                   /*overwrite=*/true,
                                                                   options_.num_threads,
                                                                   display.Callback())
                                                      : CopyMasks(options_.mask_path,
                                                                  options_.image_path,
                                                                  image_names_,
                                                                  workspace_.masks(),
                                                                  /*overwrite=*/true,
                                                                  options_.num_threads,
                                                                  display.Callback());
    json shares = json::object();
    for (const MaskSummary& summary : summaries) {
      shares[summary.image_name] = summary.excluded_share;
    }
    return json{{"excluded_share", shares}};
  });
  double total = 0.0;
  for (const auto& share : result["excluded_share"]) total += share.get<double>();
  if (total == 0.0) notes_.push_back("masks exclude nothing: no distractor was predicted");
}

void Pipeline::ExtractFeatures() {
  const json inputs = {{"options", OptionsAsJson(options_)["features"]},
                       {"inputs", inputs_hash_},
                       {"use_masks", options_.use_masks}};
  workspace_.RunStage("features", inputs, workspace_.database(), [&] {
    const fs::path database_path = workspace_.Scratch("features") / "database.db";
    std::string last_words;
    {
      ColmapDatabase database = ColmapDatabase::Create(database_path);
      SeedOptions seed;
      seed.shared_camera = options_.shared_camera;
      seed.camera_model = options_.camera_model;
      WriteSeedCameras(predictions_, options_.image_path, seed, database);
      if (options_.matcher == Matcher::kGuided) {
        FeatureStageOptions features;
        features.image_path = options_.image_path;
        if (options_.use_masks) features.mask_path = workspace_.masks();
        features.extract.sift = options_.sift;
        features.extract.num_threads = options_.num_threads;
        ExtractDatabaseFeatures(features, database);
      }
    }
    if (options_.matcher != Matcher::kGuided) last_words = ExtractByColmap(database_path);
    const json result = CheckFeatures(database_path, last_words);
    fs::rename(database_path, workspace_.database());
    return result;
  });
}

// Returns what colmap said last.
std::string Pipeline::ExtractByColmap(const fs::path& database_path) {
  ColmapOptions arguments = {
      {"database_path", database_path},
      {"image_path", options_.image_path},
      {"SiftExtraction.use_gpu", options_.use_gpu ? "1" : "0"},
      {"SiftExtraction.num_threads", ThreadsOrAll()},
      {"SiftExtraction.max_num_features", std::to_string(options_.sift.max_num_features)},
      {"SiftExtraction.max_image_size", std::to_string(options_.sift.max_image_size)}};
  const fs::path image_list = workspace_.Scratch("image_list") / "names.txt";
  WriteFileAtomically(image_list, JoinLines(image_names_));
  arguments.emplace_back("image_list_path", image_list);
  if (options_.use_masks) arguments.emplace_back("ImageReader.mask_path", workspace_.masks());
  ProgressDisplay display("features");
  std::string last_words;
  colmap_.Run(
      "feature_extractor", arguments, workspace_.log("features"), display.Callback(), &last_words);
  return last_words;
}

// The extractor's exit code says nothing: count what it left, also inside the masks.
json Pipeline::CheckFeatures(const fs::path& database_path, const std::string& last_words) const {
  const auto counts = CountExcludedKeypoints(
      database_path, options_.use_masks ? workspace_.masks() : fs::path(), options_.num_threads);
  json views = json::object();
  uint64_t num_excluded = 0;
  size_t num_images = 0;
  for (const ApplyMasksImageSummary& image : counts) {
    views[image.image_name] = {{"num_keypoints", image.num_keypoints},
                               {"num_excluded_keypoints", image.num_excluded_keypoints}};
    num_excluded += image.num_excluded_keypoints;
    if (image.num_keypoints > 0) ++num_images;
  }
  if (num_images < 2) {
    Fail(options_.image_path,
         std::to_string(num_images) + " photos have features that masks keep",
         "at least 2",
         last_words.empty()
             ? "a lower --mask_margin_scales keeps more; 'vgtw mask lint' tells specks in masks"
             : "colmap said: " + last_words);
  }
  if (num_excluded > 0) {
    Fail(workspace_.log("features"),
         std::to_string(num_excluded) + " features lie in excluded pixels",
         "0",
         "this version of colmap did not read the masks: see the log");
  }
  return {{"views", views}};
}

void Pipeline::MatchFeatures() {
  const json inputs = {{"options", OptionsAsJson(options_)["matches"]}};
  workspace_.RunStage("matches", inputs, workspace_.database(), [&] {
    if (options_.matcher != Matcher::kGuided) return MatchByColmap();
    MatchStageOptions match = options_.match;
    match.num_threads = options_.num_threads;
    ColmapDatabase database(workspace_.database(), ColmapDatabase::Mode::kReadWrite);
    return AsJson(MatchDatabase(predictions_, match, database));
  });
}

json Pipeline::MatchByColmap() {
  {
    ColmapDatabase database(workspace_.database(), ColmapDatabase::Mode::kReadWrite);
    ColmapDatabase::Transaction transaction(database);
    database.ClearMatches();
    transaction.Commit();
  }
  ColmapOptions arguments = {{"database_path", workspace_.database()},
                             {"SiftMatching.use_gpu", options_.use_gpu ? "1" : "0"},
                             {"SiftMatching.num_threads", ThreadsOrAll()}};
  const bool is_sequential = options_.matcher == Matcher::kSequential;
  if (is_sequential) {
    arguments.emplace_back("SequentialMatching.overlap",
                           std::to_string(options_.sequential_overlap));
  }
  ProgressDisplay display("matches");
  std::string last_words;
  colmap_.Run(is_sequential ? "sequential_matcher" : "exhaustive_matcher",
              arguments,
              workspace_.log("matches"),
              display.Callback(),
              &last_words);
  const size_t num_pairs = ColmapDatabase(workspace_.database(), ColmapDatabase::Mode::kReadOnly)
                               .ReadTwoViewPairs()
                               .size();
  if (num_pairs == 0) {
    Fail(workspace_.database(),
         "no pair of photos has verified matches",
         "at least one",
         "the photos may not overlap; colmap said: " + last_words);
  }
  return {{"num_verified_pairs", num_pairs}};
}

void Pipeline::Refine() {
  const json all = OptionsAsJson(options_);
  const json inputs = {{"options", all["refine"]}, {"priors", all["priors"]}};
  const json result = workspace_.RunStage("refine", inputs, workspace_.refined(), [&] {
    const ColmapDatabase database(workspace_.database(), ColmapDatabase::Mode::kReadOnly);
    SeedOptions seed_options;
    seed_options.shared_camera = options_.shared_camera;
    seed_options.with_points = false;
    Seed seed = MakeSeed(predictions_, database, seed_options);
    Reconstruction& model = seed.reconstruction;
    const std::vector<Track> tracks = ReadTracks(database, model);
    RefineModelOptions refine = options_.refine;
    refine.num_threads = options_.num_threads;
    PriorOptions priors = options_.priors;
    priors.num_threads = options_.num_threads;
    refine.priors = MakePriors(priors, &predictions_, &database, model, tracks);
    ProgressDisplay display("refine");
    refine.progress = display.Callback();
    RefineModelResult result = RefineModel(refine, model, tracks);
    if (result.feedforward.points3D.empty()) {
      Fail(workspace_.database(),
           "nothing could be triangulated with the predicted poses",
           "points",
           "wrong poses? 'vgtw import' names suspected convention mistakes");
    }
    Reconstruction* const triangulated[] = {&result.feedforward, &result.refined};
    ColorPoints(options_.image_path, triangulated, options_.num_threads);
    WriteModelOptions write;
    write.overwrite = true;
    WriteModel(result.feedforward, workspace_.feedforward(), write);
    WritePly(workspace_.points(), PointsOf(result.refined));
    WriteModel(result.refined, workspace_.refined(), write);
    return AsJson(result);
  });
  for (const std::string& note : UnrefinedNotes(result.at("views"))) notes_.push_back(note);
}

PipelineReport Pipeline::Report() {
  const ComparisonInputs run = ReadRun(workspace_, options_);
  WriteComparisonPage(workspace_.report(), run, CompareModels(run));
  PipelineReport report = MakeReport(workspace_, run);
  report.notes.insert(report.notes.begin(), notes_.begin(), notes_.end());
  workspace_.Record("report", AsJson(report));
  return report;
}

}  // namespace

std::string_view Name(Matcher matcher) {
  switch (matcher) {
    case Matcher::kColmap:
      return "colmap";
    case Matcher::kSequential:
      return "sequential";
    case Matcher::kGuided:
      break;
  }
  return "guided";
}

PipelineReport RunPipeline(const PipelineOptions& options) { return Pipeline(options).Run(); }

}  // namespace vgtw
