// SPDX-License-Identifier: BSD-3-Clause
#include "refine/refine_model.h"

#include "refine/align.h"
#include "refine/held_out.h"
#include "refine/refine_round.h"
#include "refine/seed_error.h"
#include "scene/error.h"
#include "scene/reprojection.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

namespace vgtw {
namespace {

// A difference of the means by so many standard errors is not believed to be chance.
constexpr double kWorseSigmas = 2.0;
// Views turn alike if they turn by less than so many medians.
constexpr double kMaxMedianTurns = 4.0;
// So often is a round repeated without views that it left worse.
constexpr int kMaxRepeats = 3;
// A round that lowers the mean error held out by less than this share is the last one.
constexpr double kMinGain = 0.01;

std::string Count(size_t num, const std::string& what) { return std::to_string(num) + " " + what; }

std::string Tenths(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f", value);
  return text;
}

// Poses and intrinsics with the errors of what is held out under them.
struct Judged {
  Reconstruction model;
  HeldOutJudge::Errors errors;
  double mean_px = 0.0;
};

class Refinement {
 public:
  Refinement(const RefineModelOptions& options,
             const Reconstruction& seed,
             const std::vector<Track>& tracks)
      : options_(options),
        seed_(seed),
        tracks_(tracks),
        split_(HoldOutTracks(tracks, options.held_out_percent, options.seed)),
        first_limit_px_(
            std::max(MeasureSeedError(seed, split_.adjusted, options.num_threads).max_px,
                     options.max_error_px)),
        judge_(split_.held_out, kLossScalePx, kLossLimits * first_limit_px_, options.num_threads),
        good_(Judge(seed)) {}

  RefineModelResult Run();

 private:
  static constexpr double kLossScalePx = 1.0;
  // Larger errors held out count alike: a wrong match is wrong, however far off.
  static constexpr double kLossLimits = 2.0;

  Judged Judge(Reconstruction model) const {
    HeldOutJudge::Errors errors = judge_.Measure(model);
    const double mean_px = judge_.MeanPx(errors);
    return {std::move(model), std::move(errors), mean_px};
  }

  // One round from the last good poses; whether it was accepted.
  bool RunRound(RoundLimits& limits);
  std::set<ImageId> FindBadViews(const Judged& candidate, const RoundOutcome& outcome);
  std::string FindTurn(const std::map<ImageId, double>& turns_deg, ImageId image_id) const;
  std::map<ImageId, double> TurnsDeg(const Reconstruction& model) const;
  void PutBack(const std::set<ImageId>& image_ids, Reconstruction& model) const;
  void DescribeViews(RefineModelResult& result) const;
  Reconstruction TriangulateAll(const Reconstruction& poses, double max_error_px) const;

  const RefineModelOptions& options_;
  const Reconstruction& seed_;
  const std::vector<Track>& tracks_;
  const SplitTracks split_;
  const double first_limit_px_;
  const HeldOutJudge judge_;
  Judged good_;
  std::map<ImageId, std::string> rejected_;  // and why
  std::map<ImageId, size_t> num_supporting_;
  std::vector<RefineRound> rounds_;
};

std::map<ImageId, double> Refinement::TurnsDeg(const Reconstruction& model) const {
  std::map<ImageId, double> turns_deg;
  for (const auto& [id, image] : model.images) {
    turns_deg[id] =
        AngleBetweenDeg(seed_.images.at(id).cam_from_world.rotation, image.cam_from_world.rotation);
  }
  return turns_deg;
}

// Why a view's turn is not believed; "" if it is.
std::string Refinement::FindTurn(const std::map<ImageId, double>& turns_deg,
                                 ImageId image_id) const {
  std::vector<double> turns;
  for (const auto& [id, turn_deg] : turns_deg) turns.push_back(turn_deg);
  const double limit_deg = std::max(options_.max_turn_deg, kMaxMedianTurns * Median(turns));
  const double turn_deg = turns_deg.at(image_id);
  if (turn_deg <= limit_deg) return "";
  return "refinement would turn it by " + Tenths(turn_deg) + " deg, at most " + Tenths(limit_deg) +
         " are believed";
}

void Refinement::PutBack(const std::set<ImageId>& image_ids, Reconstruction& model) const {
  for (const ImageId id : image_ids) {
    model.images.at(id).cam_from_world = good_.model.images.at(id).cam_from_world;
  }
  UpdateFrames(model);
}

// Views of an adjusted model that are worse than before, or not believed.
std::set<ImageId> Refinement::FindBadViews(const Judged& candidate, const RoundOutcome& outcome) {
  std::set<ImageId> bad;
  const std::map<ImageId, double> turns_deg = TurnsDeg(candidate.model);
  for (const ImageId id : judge_.FindWorse(good_.errors, candidate.errors, kWorseSigmas)) {
    if (!outcome.adjusted.contains(id)) continue;
    bad.insert(id);
    rejected_[id] = "refinement would raise the error of its tracks held out";
  }
  for (const ImageId id : outcome.adjusted) {
    const std::string reason = FindTurn(turns_deg, id);
    if (reason.empty()) continue;
    bad.insert(id);
    rejected_[id] = reason;
  }
  return bad;
}

bool Refinement::RunRound(RoundLimits& limits) {
  RefineRound round;
  round.max_error_px = limits.max_error_px;
  std::set<ImageId> held;
  std::optional<Judged> candidate;
  RoundOutcome outcome;
  for (int i = 0; i <= kMaxRepeats; ++i) {
    Reconstruction model = good_.model;
    outcome = RunRefineRound(options_, split_.adjusted, held, limits, model);
    if (outcome.adjusted.empty()) break;
    std::set<ImageId> still;
    for (const auto& [id, image] : model.images) {
      if (!outcome.adjusted.contains(id)) still.insert(id);
    }
    Transform(AlignPoses(model, good_.model, still), model);
    PutBack(still, model);
    candidate = Judge(std::move(model));
    const std::set<ImageId> bad = FindBadViews(*candidate, outcome);
    if (bad.empty()) break;
    held.insert(bad.begin(), bad.end());
  }
  for (const ImageId id : held) round.put_back.push_back(seed_.images.at(id).name);
  if (candidate) {
    round.num_points3D = candidate->model.points3D.size();
    round.median_px = outcome.median_px;
    round.held_out_px = candidate->mean_px;
    round.is_accepted = candidate->mean_px < good_.mean_px;
    round.adjustment = outcome.adjustment;
    for (const ImageId id : outcome.adjusted) {
      if (round.is_accepted && !held.contains(id)) rejected_.erase(id);
    }
  }
  rounds_.push_back(round);
  num_supporting_ = outcome.num_supporting;
  if (!outcome.adjusted.empty()) limits.Tighten(outcome.median_px);
  if (!round.is_accepted) return false;
  const bool has_gained = candidate->mean_px < (1.0 - kMinGain) * good_.mean_px;
  good_ = std::move(*candidate);
  return has_gained;
}

Reconstruction Refinement::TriangulateAll(const Reconstruction& poses, double max_error_px) const {
  Reconstruction model = poses;
  TriangulateTracks({max_error_px, options_.min_angle_deg, options_.num_threads}, tracks_, model);
  return model;
}

RefineModelResult Refinement::Run() {
  RefineModelResult result;
  result.num_held_out_tracks = split_.held_out.size();
  result.held_out_before_px = good_.mean_px;
  RoundLimits limits = {first_limit_px_, options_.max_error_px};
  for (int i = 0; i < options_.max_num_rounds; ++i) {
    const RoundLimits before_round = limits;
    const bool has_gained = RunRound(limits);
    if (options_.progress) options_.progress(i + 1, options_.max_num_rounds);
    // The same again would come of the same limits and poses.
    if (!has_gained && limits.max_error_px == before_round.max_error_px) break;
  }
  result.feedforward = TriangulateAll(seed_, first_limit_px_);
  result.refined = TriangulateAll(good_.model, options_.max_error_px);
  result.rounds = rounds_;
  result.held_out_after_px = good_.mean_px;
  DescribeViews(result);
  return result;
}

void Refinement::DescribeViews(RefineModelResult& result) const {
  const auto supporting = NumSupportingObservations(result.refined);
  const auto num_held_out = judge_.NumObservations();
  const auto before = judge_.MeanPxByImage(judge_.Measure(seed_));
  const auto after = judge_.MeanPxByImage(good_.errors);
  for (const auto& [id, image] : result.refined.images) {
    const Rigid3d& seed_pose = seed_.images.at(id).cam_from_world;
    RefinedView& view = result.views[id];
    view.name = image.name;
    view.num_supporting = supporting.at(id);
    view.num_observations = static_cast<size_t>(
        std::count_if(image.points2D.begin(), image.points2D.end(), [](const Point2D& point2D) {
          return point2D.HasPoint3D();
        }));
    if (num_held_out.contains(id)) {
      view.num_held_out = num_held_out.at(id);
      view.held_out_before_px = before.at(id);
      view.held_out_after_px = after.at(id);
    }
    view.turn_deg = AngleBetweenDeg(seed_pose.rotation, image.cam_from_world.rotation);
    view.move = (OriginInSource(seed_pose) - OriginInSource(image.cam_from_world)).norm();
    const bool has_moved = seed_pose.translation != image.cam_from_world.translation ||
                           seed_pose.rotation.coeffs() != image.cam_from_world.rotation.coeffs();
    const auto rejected = rejected_.find(id);
    if (has_moved) {
      view.outcome = ViewOutcome::kRefined;
    } else if (rejected != rejected_.end()) {
      view.outcome = ViewOutcome::kRejected;
      view.reason = rejected->second;
    } else if (view.num_supporting < static_cast<size_t>(options_.min_num_observations)) {
      view.reason = Count(view.num_supporting, "observations of points that three photos see, ") +
                    "at least " + std::to_string(options_.min_num_observations) + " are needed";
    } else {
      view.reason = "no round lowered the error of tracks held out";
    }
  }
}

// The views that can be used.
Reconstruction UsableViews(const Reconstruction& seed) {
  Reconstruction usable = seed;
  for (const auto& [id, image] : seed.images) {
    if (FindFault(image.cam_from_world).empty() &&
        FindFault(seed.cameras.at(image.camera_id)).empty()) {
      continue;
    }
    for (uint32_t idx = 0; idx < image.points2D.size(); ++idx) {
      if (usable.images.at(id).points2D[idx].HasPoint3D()) RemoveObservation(usable, {id, idx});
    }
    usable.images.erase(id);
    usable.rigs.clear();
    usable.frames.clear();
  }
  return usable;
}

}  // namespace

void RefineModelOptions::Check() const {
  VGTW_CHECK(max_num_rounds >= 1, "RefineModelOptions::max_num_rounds");
  VGTW_CHECK(held_out_percent > 0.0 && held_out_percent <= 50.0,
             "RefineModelOptions::held_out_percent = " + std::to_string(held_out_percent) +
                 ", must be in (0, 50]");
  VGTW_CHECK(max_turn_deg > 0.0 && max_turn_deg <= 180.0,
             "RefineModelOptions::max_turn_deg = " + std::to_string(max_turn_deg) +
                 ", must be in (0, 180]");
  TriangulationOptions{max_error_px, min_angle_deg, num_threads}.Check();
}

std::string_view Name(ViewOutcome outcome) {
  switch (outcome) {
    case ViewOutcome::kRefined:
      return "refined";
    case ViewOutcome::kRejected:
      return "rejected";
    case ViewOutcome::kKept:
      break;
  }
  return "kept";
}

bool RefineModelResult::IsRefined() const {
  return std::any_of(views.begin(), views.end(), [](const auto& entry) {
    return entry.second.outcome == ViewOutcome::kRefined;
  });
}

RefineModelResult RefineModel(const RefineModelOptions& options,
                              const Reconstruction& seed,
                              const std::vector<Track>& tracks) {
  options.Check();
  const Reconstruction usable = UsableViews(seed);
  std::vector<Track> usable_tracks;
  for (const Track& track : tracks) {
    Track& elements = usable_tracks.emplace_back();
    for (const TrackElement& element : track) {
      if (usable.images.contains(element.image_id)) elements.push_back(element);
    }
    if (elements.size() < 2) usable_tracks.pop_back();
  }
  return Refinement(options, usable, usable_tracks).Run();
}

}  // namespace vgtw
