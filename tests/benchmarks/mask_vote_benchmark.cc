// SPDX-License-Identifier: BSD-3-Clause
// mask_vote_benchmark [NUM_SEEDS [--options]]
// What `vgtw mask vote` does to damaged masks of the synthetic scene: every kind of camera path,
// depth that follows the movers or the static scene behind them, exact or with the errors of a
// feed-forward network. Ratios are means over all images of all seeds. With --options instead: the
// F1 after the vote where one option differs from its default, which is how defaults were chosen.
#include "evaluation/mask_score.h"
#include "scene/mask_vote.h"
#include "scene/perturb.h"
#include "scene/random.h"
#include "scene/synthetic.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <map>
#include <numbers>
#include <string_view>
#include <vector>

namespace vgtw {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;

enum class Depth { kOfMovers, kBehindMovers };

struct Scenario {
  const char* name;
  Depth depth = Depth::kOfMovers;
  double noise = 0.0;  // of poses, intrinsics and depth, in multiples of PerturbOptions' defaults
  double mask_flip_percent = 0.0;
  bool stripes = false;  // masks are lost in stripes that cover 40 % of the image
  bool no_masks = false;
};

std::map<Depth, Prediction> Render(CameraPath path, uint64_t seed) {
  const SyntheticScene scene(
      {.path = path, .width = kWidth, .height = kHeight, .num_threads = 1, .seed = seed});
  std::map<Depth, Prediction> predictions;
  for (size_t i = 0; i < scene.views().size(); ++i) {
    const SyntheticView rendered = scene.Render(i);
    for (const Depth depth : {Depth::kOfMovers, Depth::kBehindMovers}) {
      ViewPrediction view;
      view.view = scene.views()[i];
      view.depth = depth == Depth::kOfMovers ? rendered.depth : rendered.static_depth;
      view.distractor = rendered.distractor;
      predictions[depth].views.push_back(std::move(view));
    }
  }
  return predictions;
}

Prediction Damage(const Prediction& truth, const Scenario& scenario, uint64_t seed) {
  PerturbOptions options;
  for (double* sigma : {&options.rotation_deg,
                        &options.centre_percent,
                        &options.focal_percent,
                        &options.depth_scale_percent,
                        &options.depth_noise_percent}) {
    *sigma *= scenario.noise;
  }
  options.mask_flip_percent = scenario.mask_flip_percent;
  options.seed = seed;
  Prediction damaged = Perturb(truth, options);
  for (size_t i = 0; i < damaged.views.size(); ++i) {
    DistractorMask& distractor = damaged.views[i].distractor;
    if (scenario.no_masks) distractor = {};
    if (!scenario.stripes) continue;
    RandomStream random(HashKey({seed, i}));
    const double angle_rad = random.Uniform(0.0, 2.0 * std::numbers::pi);
    for (int y = 0; y < distractor.height(); ++y) {
      for (int x = 0; x < distractor.width(); ++x) {
        const double phase = 0.08 * (x * std::cos(angle_rad) + y * std::sin(angle_rad));
        if (std::sin(phase) > 0.3) distractor(x, y) = 0.0f;
      }
    }
  }
  return damaged;
}

StaticMask ToMask(const DistractorMask& distractor) {
  StaticMask mask(kWidth, kHeight, 255);
  for (size_t i = 0; i < distractor.size(); ++i) {
    if (distractor.data()[i] >= 0.5f) mask.data()[i] = 0;
  }
  return mask;
}

// The masks after the vote, as `vgtw mask vote` decides, but for its coarse first pass.
std::vector<DistractorMask> Vote(const Prediction& prediction, const MaskVoteOptions& options) {
  std::vector<View> views;
  std::vector<VoteView> vote_views;
  for (const ViewPrediction& view : prediction.views) {
    views.push_back(view.view);
    vote_views.emplace_back(view, options);
  }
  std::vector<Votes> votes;
  MaskedVerdicts verdicts;
  for (size_t i = 0; i < views.size(); ++i) {
    std::vector<const VoteView*> others;
    const double depth = MedianDepth(vote_views[i].depth()).value();
    for (const size_t idx : SelectVoters(views, i, depth, options.max_views)) {
      others.push_back(&vote_views[idx]);
    }
    votes.push_back(CountVotes(vote_views[i], others, options));
    verdicts += JudgeMasked(vote_views[i], votes.back(), options);
  }
  std::vector<DistractorMask> masks;
  for (size_t i = 0; i < views.size(); ++i) {
    masks.push_back(prediction.views[i].distractor);
    ApplyVotes(votes[i], options, MayRelease(verdicts, options), masks.back());
  }
  return masks;
}

struct Case {
  CameraPath path;
  const Scenario* scenario;
  std::vector<StaticMask> truth;
  Prediction damaged;
};

constexpr Scenario kScenarios[] = {
    {.name = "true masks"},
    {.name = "true masks, noise", .noise = 1.0},
    {.name = "blobs flipped 30 %", .mask_flip_percent = 30.0},
    {.name = "blobs flipped 30 %, noise", .noise = 1.0, .mask_flip_percent = 30.0},
    {.name = "blobs flipped 30 %, 2x noise", .noise = 2.0, .mask_flip_percent = 30.0},
    {.name = "parts missing", .stripes = true},
    {.name = "parts missing, noise", .noise = 1.0, .stripes = true},
    {.name = "no masks, noise", .noise = 1.0, .no_masks = true},
    {.name = "behind, true masks, noise", .depth = Depth::kBehindMovers, .noise = 1.0},
    {.name = "behind, flipped 30 %, noise",
     .depth = Depth::kBehindMovers,
     .noise = 1.0,
     .mask_flip_percent = 30.0},
};

std::vector<Case> MakeCases(CameraPath path, uint64_t seed) {
  const std::map<Depth, Prediction> predictions = Render(path, seed);
  std::vector<Case> cases;
  for (const Scenario& scenario : kScenarios) {
    const Prediction& exact = predictions.at(scenario.depth);
    Case& added = cases.emplace_back(Case{path, &scenario, {}, Damage(exact, scenario, seed)});
    for (const ViewPrediction& view : exact.views) added.truth.push_back(ToMask(view.distractor));
  }
  return cases;
}

std::vector<MaskScore> Score(const std::vector<DistractorMask>& masks,
                             const std::vector<StaticMask>& truth) {
  std::vector<MaskScore> scores;
  for (size_t i = 0; i < masks.size(); ++i) {
    scores.push_back(ScoreMask(ToMask(masks[i]), truth[i], 2.0));
  }
  return scores;
}

std::vector<MaskScore> ScoreBefore(const Case& damaged) {
  std::vector<DistractorMask> masks;
  for (const ViewPrediction& view : damaged.damaged.views) masks.push_back(view.distractor);
  return Score(masks, damaged.truth);
}

void Append(const std::vector<MaskScore>& from, std::vector<MaskScore>& to) {
  to.insert(to.end(), from.begin(), from.end());
}

const char* NameOf(CameraPath path) {
  return path == CameraPath::kOrbit ? "orbit" : path == CameraPath::kForward ? "forward" : "grid";
}

void PrintEffect(int num_seeds) {
  std::printf("%-39s     before                  after\n", "");
  std::printf("%-8s %-30s     P     R    F1   IoU     P     R    F1   IoU\n", "path", "masks");
  for (const CameraPath path : {CameraPath::kOrbit, CameraPath::kForward, CameraPath::kGrid}) {
    std::array<std::vector<MaskScore>, std::size(kScenarios)> before;
    std::array<std::vector<MaskScore>, std::size(kScenarios)> after;
    for (int seed = 0; seed < num_seeds; ++seed) {
      for (const Case& damaged : MakeCases(path, static_cast<uint64_t>(seed))) {
        const auto k = static_cast<size_t>(damaged.scenario - kScenarios);
        Append(ScoreBefore(damaged), before[k]);
        Append(Score(Vote(damaged.damaged, {}), damaged.truth), after[k]);
      }
    }
    for (size_t k = 0; k < std::size(kScenarios); ++k) {
      std::printf("%-8s %-30s", NameOf(path), kScenarios[k].name);
      for (const auto& scores : {before[k], after[k]}) {
        const MaskRatios mean = MeanRatios(scores);
        std::printf(" %5.3f %5.3f %5.3f %5.3f", mean.precision, mean.recall, mean.f1, mean.iou);
      }
      std::printf("\n");
    }
    std::fflush(stdout);
  }
}

struct Variant {
  const char* name;
  MaskVoteOptions options;
};

// One column per scenario with noise and depth of movers, one row per option.
void PrintOptions(int num_seeds) {
  static const Variant kVariants[] = {
      {"defaults", {}},
      {"max_relative_depth_difference 0.03", {.max_relative_depth_difference = 0.03}},
      {"max_relative_depth_difference 0.08", {.max_relative_depth_difference = 0.08}},
      {"noise_factor 0", {.noise_factor = 0.0}},
      {"noise_factor 1", {.noise_factor = 1.0}},
      {"noise_factor 3", {.noise_factor = 3.0}},
      {"max_relative_step 0.05", {.max_relative_step = 0.05}},
      {"max_relative_step 0.2", {.max_relative_step = 0.2}},
      {"position_error_px 0", {.position_error_px = 0}},
      {"position_error_px 2", {.position_error_px = 2}},
      {"position_error_px 8", {.position_error_px = 8}},
      {"min_consistent 1", {.min_consistent = 1}},
      {"min_consistent 3", {.min_consistent = 3}},
      {"max_see_through_share 0", {.max_see_through_share = 0.0}},
      {"max_see_through_share 0.3", {.max_see_through_share = 0.3}},
      {"min_see_through 1", {.min_see_through = 1}},
      {"min_see_through 3", {.min_see_through = 3}},
      {"window_px 1", {.window_px = 1}},
      {"window_px 3", {.window_px = 3}},
      {"window_px 9", {.window_px = 9}},
      {"max_views 4", {.max_views = 4}},
      {"max_views 11", {.max_views = 11}},
  };
  std::vector<Case> cases;
  for (const CameraPath path : {CameraPath::kOrbit, CameraPath::kForward, CameraPath::kGrid}) {
    for (int seed = 0; seed < num_seeds; ++seed) {
      for (Case& damaged : MakeCases(path, static_cast<uint64_t>(seed))) {
        if (damaged.scenario->depth == Depth::kBehindMovers) continue;
        if (damaged.scenario->noise == 1.0) cases.push_back(std::move(damaged));
      }
    }
  }
  std::printf("%-26s  true flips parts none (F1)\n", "");
  for (const Variant& variant : kVariants) {
    std::map<const Scenario*, std::vector<MaskScore>> scores;
    for (const Case& damaged : cases) {
      Append(Score(Vote(damaged.damaged, variant.options), damaged.truth),
             scores[damaged.scenario]);
    }
    std::printf("%-26s", variant.name);
    for (const auto& [scenario, of_scenario] : scores) {
      std::printf(" %5.3f", MeanRatios(of_scenario).f1);
    }
    std::printf("\n");
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  const int num_seeds = argc > 1 ? std::atoi(argv[1]) : 3;
  if (argc > 2 && std::string_view(argv[2]) == "--options") {
    vgtw::PrintOptions(num_seeds);
  } else {
    vgtw::PrintEffect(num_seeds);
  }
}
