// SPDX-License-Identifier: BSD-3-Clause
// prior_effect_benchmark DATABASE PREDICTIONS REFERENCE [KEEP_EVERY [LEFT_OUT ...]]
// What each prior does to refinement from predicted poses: errors of the poses against a reference
// (a COLMAP model or predictions; views named in LEFT_OUT do not count), with every KEEP_EVERY-th
// track only, so that views are weak, and for several --min_num_observations.
#include "bridge/colmap_database.h"
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
                                   {"all", true, true, true}};

BundlePriors Choose(const PriorSet& set, BundlePriors priors) {
  if (!set.poses) priors.poses = {};
  if (!set.focal_lengths) priors.focal_lengths.clear();
  if (!set.depths) priors.depths = {};
  return priors;
}

void Print(const char* name,
           const std::map<std::string, Rigid3d>& poses,
           const std::map<std::string, Rigid3d>& reference) {
  const auto error = ComparePoses(poses, reference);
  if (!error) {
    std::printf("%-12s not comparable\n", name);
    return;
  }
  std::vector<double> centres, rotations;
  for (const ViewPoseError& view : error->views) {
    centres.push_back(100.0 * view.centre / error->extent);
    rotations.push_back(view.relative_rotation_deg);
  }
  std::printf("%-12s %7.3f %7.3f %8.3f %8.3f",
              name,
              Median(rotations),
              Percentile(rotations, 100.0),
              error->centre_rmse_percent,
              Percentile(centres, 100.0));
}

void Run(const Reconstruction& seed,
         const std::vector<Track>& tracks,
         const BundlePriors& priors,
         const std::map<std::string, Rigid3d>& reference) {
  for (const int min_num_observations : kMinNumObservations) {
    std::printf(
        "-- min_num_observations %d\n"
        "priors       rot deg: median, worst; centre %% of extent: RMSE, worst; views refined; "
        "held out px\n",
        min_num_observations);
    for (const PriorSet& set : kPriorSets) {
      RefineModelOptions options;
      options.min_num_observations = min_num_observations;
      options.priors = Choose(set, priors);
      const RefineModelResult result = RefineModel(options, seed, tracks);
      Print(set.name, CamFromWorldByName(result.refined), reference);
      const auto num_refined =
          std::count_if(result.views.begin(), result.views.end(), [](const auto& view) {
            return view.second.outcome == ViewOutcome::kRefined;
          });
      std::printf(
          " %4td of %zu %8.3f\n", num_refined, result.views.size(), result.held_out_after_px);
      std::fflush(stdout);
    }
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
    auto reference = ReadPoses(argv[3]);
    const size_t keep_every = argc > 4 ? std::strtoul(argv[4], nullptr, 10) : 1;
    for (int i = 5; i < argc; ++i) reference.erase(argv[i]);
    SeedOptions seed_options;
    seed_options.with_points = false;
    Reconstruction seed = MakeSeed(predictions, database, seed_options).reconstruction;
    const std::vector<Track> all = ReadTracks(database, seed);
    std::vector<Track> tracks;
    for (size_t i = 0; i < all.size(); i += keep_every) tracks.push_back(all[i]);
    PriorOptions options;
    options.poses = options.focal_lengths = options.depths = true;
    const BundlePriors priors = PredictionPriors(options, predictions, seed, tracks);
    std::printf("%zu images, %zu of %zu tracks\n", seed.images.size(), tracks.size(), all.size());
    Print("seed", CamFromWorldByName(seed), reference);
    std::printf("\n");
    Run(seed, tracks, priors, reference);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
