// SPDX-License-Identifier: BSD-3-Clause
// prior_effect_benchmark DATABASE PREDICTIONS REFERENCE [KEEP_EVERY [LEFT_OUT ...]]
// What each prior does to refinement from predicted poses: errors of the poses against a reference
// (a COLMAP model or predictions; views named in LEFT_OUT do not count), with every KEEP_EVERY-th
// track only, so that views are weak, and for several --min_num_observations. Means over up to five
// choices of these tracks.
#include "bridge/colmap_database.h"
#include "bridge/pose_files.h"
#include "bridge/predictions.h"
#include "bridge/seed.h"
#include "evaluation/pose_error.h"
#include "plugin/database_tracks.h"
#include "plugin/refine_priors.h"
#include "plugin/report.h"
#include "refine/refine_model.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace {

using namespace vgtw;  // NOLINT(google-build-using-namespace): a program

constexpr int kMinNumObservations[] = {30, 15, 8};

struct PriorSet {
  const char* name;
  bool poses, focal_lengths, depths;
};
constexpr PriorSet kPriorSets[] = {{"none", false, false, false},
                                   {"poses", true, false, false},
                                   {"focal", false, true, false},
                                   {"depths", false, false, true},
                                   {"poses focal", true, true, false},
                                   {"poses depths", true, false, true},
                                   {"all", true, true, true}};

BundlePriors Choose(const PriorSet& set, BundlePriors priors) {
  if (!set.poses) priors.poses = {};
  if (!set.focal_lengths) priors.focal_lengths.clear();
  if (!set.depths) priors.depths = {};
  return priors;
}

// Over the views.
struct Errors {
  double median_deg = 0.0, worst_deg = 0.0;
  double rmse_percent = 0.0, worst_percent = 0.0;  // of the extent
  double num_refined = 0.0;
  double held_out_px = 0.0;

  void Add(const Errors& other, double weight) {
    median_deg += weight * other.median_deg;
    worst_deg += weight * other.worst_deg;
    rmse_percent += weight * other.rmse_percent;
    worst_percent += weight * other.worst_percent;
    num_refined += weight * other.num_refined;
    held_out_px += weight * other.held_out_px;
  }
};

using Poses = std::map<std::string, Rigid3d>;

Errors Compare(const Poses& poses, const Poses& reference) {
  const PoseComparison error = ComparePoses(poses, reference).value();
  std::vector<double> rotations, centres;
  for (const ViewPoseError& view : error.views) {
    rotations.push_back(view.relative_rotation_deg);
    centres.push_back(100.0 * view.centre / error.extent);
  }
  return {Median(rotations),
          Percentile(rotations, 100.0),
          error.centre_rmse_percent,
          Percentile(centres, 100.0)};
}

Errors Refine(const RefineModelOptions& options,
              const Reconstruction& seed,
              const std::vector<Track>& tracks,
              const Poses& reference) {
  const RefineModelResult result = RefineModel(options, seed, tracks);
  Errors errors = Compare(CamFromWorldByName(result.refined), reference);
  for (const auto& [id, view] : result.views) {
    if (view.outcome == ViewOutcome::kRefined) ++errors.num_refined;
  }
  errors.held_out_px = result.held_out_after_px;
  return errors;
}

void Print(const char* name, const Errors& errors) {
  std::printf("%-12s %7.3f %7.3f %8.3f %8.3f %7.1f %8.3f\n",
              name,
              errors.median_deg,
              errors.worst_deg,
              errors.rmse_percent,
              errors.worst_percent,
              errors.num_refined,
              errors.held_out_px);
  std::fflush(stdout);
}

std::vector<Track> EveryNth(const std::vector<Track>& all, size_t n, size_t first) {
  std::vector<Track> tracks;
  for (size_t i = first; i < all.size(); i += n) tracks.push_back(all[i]);
  return tracks;
}

void Run(const PredictionReader& predictions,
         const Reconstruction& seed,
         const std::vector<Track>& all,
         size_t keep_every,
         const Poses& reference) {
  const size_t num_choices = std::min<size_t>(keep_every, 5);
  PriorOptions prior_options;
  prior_options.poses = prior_options.focal_lengths = prior_options.depths = true;
  for (const int min_num_observations : kMinNumObservations) {
    std::printf("-- min_num_observations %d\n", min_num_observations);
    std::map<const char*, Errors> means;
    for (size_t choice = 0; choice < num_choices; ++choice) {
      const std::vector<Track> tracks = EveryNth(all, keep_every, choice);
      const BundlePriors priors = PredictionPriors(prior_options, predictions, seed, tracks);
      for (const PriorSet& set : kPriorSets) {
        RefineModelOptions options;
        options.min_num_observations = min_num_observations;
        options.priors = Choose(set, priors);
        means[set.name].Add(Refine(options, seed, tracks, reference),
                            1.0 / static_cast<double>(num_choices));
      }
    }
    for (const PriorSet& set : kPriorSets) Print(set.name, means[set.name]);
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc < 4) {
      std::fprintf(stderr,
                   "prior_effect_benchmark DATABASE PREDICTIONS REFERENCE [KEEP_EVERY [LEFT_OUT "
                   "...]]\n");
      return 2;
    }
    const ColmapDatabase database(argv[1], ColmapDatabase::Mode::kReadOnly);
    const PredictionReader predictions(argv[2]);
    Poses reference = ReadPoses(argv[3]);
    const size_t keep_every = argc > 4 ? std::strtoul(argv[4], nullptr, 10) : 1;
    for (int i = 5; i < argc; ++i) reference.erase(argv[i]);
    SeedOptions seed_options;
    seed_options.with_points = false;
    Reconstruction seed = MakeSeed(predictions, database, seed_options).reconstruction;
    const std::vector<Track> all = ReadTracks(database, seed);
    std::printf(
        "%zu images, every %zu-th of %zu tracks\n", seed.images.size(), keep_every, all.size());
    std::printf(
        "priors       rotation deg: median, worst; centre %% of extent: RMSE, worst; views "
        "refined; held out px\n");
    Print("seed", Compare(CamFromWorldByName(seed), reference));
    Run(predictions, seed, all, keep_every, reference);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
