// SPDX-License-Identifier: BSD-3-Clause
#include "refine/refinement.h"

#include "refine/align.h"
#include "refine/seed_error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <utility>

namespace vgtw {
namespace {

// Scale of the loss of errors held out, pixels.
constexpr double kLossScalePx = 1.0;
// Errors held out beyond so many first limits count alike: a wrong match is wrong, however far off.
constexpr double kLossLimits = 2.0;
// A difference of the means by so many standard errors is not believed to be chance.
constexpr double kWorseSigmas = 2.0;
// Between rounds a view's error may grow by this factor: rounds trade small errors between views.
constexpr double kMaxGrowth = 1.25;
// Views turn alike if they turn by less than so many medians.
constexpr double kMaxMedianTurns = 4.0;
// However far a view turns, it is believed if so many observations held out, of tracks of three
// views, are explained as well as those of the others, by their mean errors.
constexpr size_t kMinConfirming = 20;
constexpr double kMaxConfirmedRatio = 2.0;
constexpr int kIterationsPerRound = 100;  // at most, two adjustments of 50; repeats are not counted
// So often is a round repeated without views that it left worse.
constexpr int kMaxRepeats = 3;
// Mean errors held out are alike if they differ by less than the first share, or by less than the
// second and so many standard errors; the later round, which had tighter limits, is taken.
constexpr double kTie = 0.002;
constexpr double kMaxTie = 0.02;
constexpr double kTieSigmas = 1.0;
// Focal lengths that are known no better (relative) may be any that fits.
constexpr double kWeakFocalSigma = 0.01;
// So many poses and intrinsics are never weak in all; their uncertainty would take long.
constexpr int kMaxParametersOfWeak = 1500;
// A round that lowers the mean error held out by less than this share is the last one.
constexpr double kMinGain = 0.01;

std::string Tenths(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f", value);
  return text;
}

std::vector<double> Values(const std::map<ImageId, double>& by_image) {
  std::vector<double> values;
  for (const auto& [id, value] : by_image) values.push_back(value);
  return values;
}

double LargestPx(const RoundLimits& limits) {
  double largest_px = limits.final_px;
  for (const auto& [id, limit_px] : limits.max_error_px) {
    largest_px = std::max(largest_px, limit_px);
  }
  return largest_px;
}

// Poses of these images as in `other`, and with them cameras that only such images have.
void PutBack(const std::set<ImageId>& image_ids,
             const Reconstruction& other,
             Reconstruction& model) {
  std::set<CameraId> cameras_of_others;
  for (auto& [id, image] : model.images) {
    if (image_ids.contains(id)) {
      image.cam_from_world = other.images.at(id).cam_from_world;
    } else {
      cameras_of_others.insert(image.camera_id);
    }
  }
  for (auto& [id, camera] : model.cameras) {
    if (!cameras_of_others.contains(id)) camera = other.cameras.at(id);
  }
  UpdateFrames(model);
}

}  // namespace

Refinement::Refinement(const RefineModelOptions& options,
                       const Reconstruction& seed,
                       const std::vector<Track>& tracks)
    : options_(options),
      seed_(seed),
      tracks_(tracks),
      split_(HoldOutTracks(tracks, options.held_out_percent, options.seed)),
      first_limits_(FirstLimits()),
      judge_(split_.held_out,
             kLossScalePx,
             kLossLimits * LargestPx(first_limits_),
             options.num_threads),
      priors_(options.priors),
      good_(Judge(seed)),
      seed_errors_(good_.errors),
      start_px_(good_.mean_px) {}

Judged Refinement::Judge(Reconstruction model) const {
  HeldOutJudge::Errors errors = judge_.Measure(model);
  const double mean_px = judge_.MeanPx(errors);
  return {std::move(model), std::move(errors), mean_px};
}

std::map<ImageId, double> Refinement::TurnsDeg(const Reconstruction& model) const {
  std::map<ImageId, double> turns_deg;
  for (const auto& [id, image] : model.images) {
    turns_deg[id] =
        AngleBetweenDeg(seed_.images.at(id).cam_from_world.rotation, image.cam_from_world.rotation);
  }
  return turns_deg;
}

// A view may turn by what its observations say that it is off.
double Refinement::MaxTurnDeg(ImageId image_id) const {
  const Camera& camera = seed_.cameras.at(seed_.images.at(image_id).camera_id);
  const double off_rad =
      std::atan2(first_limits_.max_error_px.at(image_id), camera.MeanFocalLength());
  return std::max(options_.max_turn_deg, off_rad * 180.0 / std::numbers::pi);
}

std::set<ImageId> Refinement::FindConfirmedViews(const Judged& candidate) const {
  std::set<ImageId> confirmed;
  const auto error_px = judge_.MeanPxByImage(candidate.errors);
  const double max_error_px =
      std::min(kMaxConfirmedRatio * Median(Values(error_px)), options_.max_error_px);
  for (const auto& [id, num] : judge_.NumObservations(/*min_track_length=*/3)) {
    if (num >= kMinConfirming && error_px.at(id) <= max_error_px) confirmed.insert(id);
  }
  return confirmed;
}

std::map<ImageId, std::string> Refinement::FindTurnedViews(const Judged& candidate,
                                                           const RoundOutcome& outcome) const {
  std::map<ImageId, std::string> turned;
  const std::map<ImageId, double> turns_deg = TurnsDeg(candidate.model);
  const double usual_deg = kMaxMedianTurns * Median(Values(turns_deg));
  const std::set<ImageId> confirmed = FindConfirmedViews(candidate);
  for (const ImageId id : outcome.adjusted) {
    const double limit_deg = std::max(MaxTurnDeg(id), usual_deg);
    if (turns_deg.at(id) <= limit_deg || confirmed.contains(id)) continue;
    turned[id] = "refinement would turn it by " + Tenths(turns_deg.at(id)) + " deg, at most " +
                 Tenths(limit_deg) + " are believed";
  }
  return turned;
}

std::set<ImageId> Refinement::FindWorseViews(const Judged& candidate,
                                             const RoundOutcome& outcome) const {
  std::set<ImageId> worse;
  const auto before_px = judge_.MeanPxByImage(good_.errors);
  const auto after_px = judge_.MeanPxByImage(candidate.errors);
  for (const ImageId id : judge_.FindWorse(seed_errors_, candidate.errors, kWorseSigmas)) {
    worse.insert(id);
  }
  for (const ImageId id : judge_.FindWorse(good_.errors, candidate.errors, kWorseSigmas)) {
    if (after_px.at(id) >= kMaxGrowth * before_px.at(id)) worse.insert(id);
  }
  std::erase_if(worse, [&](ImageId id) { return !outcome.adjusted.contains(id); });
  return worse;
}

bool Refinement::Exclude(const Judged& candidate,
                         const RoundOutcome& outcome,
                         ExcludedViews& excluded) {
  const auto error_px = judge_.MeanPxByImage(candidate.errors);
  // Where a seed is far off, robust points follow some of its views and leave others: the errors of
  // the former are small, and better poses raise them. Held among better poses they are larger yet.
  size_t num_changed = std::erase_if(excluded.held, [&](ImageId id) {
    const auto refined = excluded.refined_px.find(id);
    return refined != excluded.refined_px.end() && error_px.at(id) > refined->second &&
           excluded.trusted.insert(id).second;
  });
  for (const ImageId id : FindWorseViews(candidate, outcome)) {
    if (excluded.trusted.contains(id)) continue;
    excluded.refined_px[id] = error_px.at(id);
    rejected_[id] = "refinement would raise the error of its tracks held out";
    num_changed += excluded.held.insert(id).second;
  }
  for (const auto& [id, reason] : FindTurnedViews(candidate, outcome)) {
    excluded.refined_px.erase(id);
    rejected_[id] = reason;
    num_changed += excluded.held.insert(id).second;
  }
  return num_changed > 0;
}

std::optional<Judged> Refinement::Attempt(const RefineModelOptions& options,
                                          Reconstruction model,
                                          const RoundLimits& limits,
                                          const std::set<ImageId>& held,
                                          BundlePriors& priors,
                                          RoundOutcome& outcome) {
  outcome = RunRefineRound(
      options, split_.adjusted, held, limits, priors, model, [this] { return GoesOn(); });
  if (outcome.adjusted.empty()) return std::nullopt;
  std::set<ImageId> still;
  for (const auto& [id, image] : model.images) {
    if (!outcome.adjusted.contains(id)) still.insert(id);
  }
  Transform(AlignPoses(model, good_.model, still), model);
  PutBack(still, good_.model, model);
  return Judge(std::move(model));
}

bool Refinement::IsLate() const {
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start_time_;
  return seconds.count() >= options_.max_seconds;
}

bool Refinement::GoesOn() {
  if (options_.progress) {
    num_iterations_of_round_ = std::min(num_iterations_of_round_ + 1, kIterationsPerRound - 1);
    const int64_t total = int64_t{options_.max_num_rounds} * kIterationsPerRound;
    const int64_t done = static_cast<int64_t>(rounds_.size()) * kIterationsPerRound;
    options_.progress(std::min(done + num_iterations_of_round_, total - 1), total);
  }
  return !IsLate();
}

bool Refinement::IsAsGood(const Judged& candidate) const {
  if (candidate.mean_px < (1.0 + kTie) * good_.mean_px) return true;
  return candidate.mean_px < (1.0 + kMaxTie) * good_.mean_px &&
         !judge_.IsWorse(good_.errors, candidate.errors, kTieSigmas);
}

bool Refinement::RunRound(RoundLimits& limits) {
  RefineRound round;
  round.max_error_px = limits.MedianPx();
  ExcludedViews excluded;
  RoundOutcome outcome;
  BundlePriors priors;
  std::optional<Judged> candidate;
  num_iterations_of_round_ = 0;
  for (int i = 0;; ++i) {
    priors = priors_;
    candidate = Attempt(options_, good_.model, limits, excluded.held, priors, outcome);
    if (!candidate || !Exclude(*candidate, outcome, excluded)) break;
    if (2 * excluded.held.size() > outcome.adjusted.size()) {
      candidate.reset();  // no round that a minority could save
      break;
    }
    if (i < kMaxRepeats && !IsLate()) continue;
    PutBack(excluded.held, good_.model, candidate->model);
    candidate = Judge(std::move(candidate->model));
    break;
  }
  for (const ImageId id : excluded.held) round.put_back.push_back(seed_.images.at(id).name);
  if (candidate) {
    limits.Tighten(outcome.median_px);
    round.num_points3D = candidate->model.points3D.size();
    round.median_px = Median(Values(outcome.median_px));
    round.held_out_px = candidate->mean_px;
    round.is_accepted = candidate->mean_px <= start_px_ && IsAsGood(*candidate);
    round.adjustment = outcome.adjustment;
    for (const ImageId id : outcome.adjusted) {
      if (round.is_accepted && !excluded.held.contains(id)) rejected_.erase(id);
    }
  }
  rounds_.push_back(round);
  if (!round.is_accepted) return false;
  const bool has_gained = candidate->mean_px < (1.0 - kMinGain) * good_.mean_px;
  good_ = std::move(*candidate);
  priors_ = std::move(priors);
  return has_gained;
}

// Robust points may follow two of three views and hide what the third is off: limits are too tight
// then for points of three views.
bool Refinement::HasFoundNothing() const {
  return std::all_of(rounds_.begin(), rounds_.end(), [](const RefineRound& round) {
    return round.num_points3D == 0;
  });
}

bool Refinement::AreIntrinsicsWeak() const {
  const Reconstruction model = TriangulateAll(good_.model);
  const Uncertainty uncertainty =
      EstimateUncertainty(AdjustmentOf(options_, model, priors_), model, {kMaxParametersOfWeak});
  if (!uncertainty.success) return false;
  return std::any_of(
      uncertainty.camera_sigmas.begin(), uncertainty.camera_sigmas.end(), [&](const auto& entry) {
        const double sigma = entry.second.front() / model.cameras.at(entry.first).MeanFocalLength();
        return !(sigma < kWeakFocalSigma);
      });
}

void Refinement::TryFewerIntrinsics(const RoundLimits& limits) {
  if (!options_.refine_focal_length || !AreIntrinsicsWeak()) return;
  for (const bool refine_focal_length : {false, true}) {
    RefineModelOptions fewer = options_;
    fewer.refine_focal_length = refine_focal_length;
    fewer.refine_principal_point = false;
    fewer.refine_extra_params = false;
    Reconstruction model = good_.model;
    for (auto& [id, camera] : model.cameras) {
      const Camera refined = camera;
      camera = seed_.cameras.at(id);
      if (!refine_focal_length) continue;
      camera.SetFocalLength(refined.FocalLengthX(), refined.FocalLengthY());
    }
    RoundOutcome outcome;
    BundlePriors priors = priors_;
    std::optional<Judged> candidate = Attempt(fewer, std::move(model), limits, {}, priors, outcome);
    if (!candidate || candidate->mean_px > start_px_ ||
        judge_.IsWorse(good_.errors, candidate->errors, kWorseSigmas) ||
        !FindWorseViews(*candidate, outcome).empty() ||
        !FindTurnedViews(*candidate, outcome).empty()) {
      continue;
    }
    good_ = std::move(*candidate);
    priors_ = std::move(priors);
    return;
  }
}

// Views that moved and yet are not tied down by what reprojects well: their observations are wrong.
Reconstruction Refinement::PutBackUnsupported() {
  for (;;) {
    Reconstruction triangulated = TriangulateAll(good_.model);
    Reconstruction model = good_.model;
    std::set<ImageId> as_in_seed;
    bool is_done = true;
    for (const auto& [id, num] : NumSupportingObservations(triangulated)) {
      if (!HasMoved(seed_.images.at(id).cam_from_world, model.images.at(id).cam_from_world)) {
        as_in_seed.insert(id);
      } else if (num < static_cast<size_t>(options_.min_num_observations)) {
        as_in_seed.insert(id);
        rejected_[id] = "its new pose is supported by " + TooFewSupporting(num);
        is_done = false;
      }
    }
    if (is_done) return triangulated;
    PutBack(as_in_seed, seed_, model);
    good_ = Judge(std::move(model));
  }
}

RoundLimits Refinement::FirstLimits() const {
  const SeedError error = MeasureSeedError(seed_, split_.adjusted, options_.num_threads);
  RoundLimits limits;
  limits.final_px = options_.max_error_px;
  limits.worst_px = error.worst_px;
  for (const auto& [id, max_px] : error.max_px_by_image) {
    limits.max_error_px[id] = std::max(max_px, limits.final_px);
  }
  return limits;
}

Reconstruction Refinement::TriangulateAll(const Reconstruction& poses,
                                          const std::map<ImageId, double>& max_error_px) const {
  Reconstruction model = poses;
  TriangulateTracks(
      {options_.max_error_px, options_.min_angle_deg, options_.num_threads, max_error_px},
      tracks_,
      model);
  return model;
}

RefineModelResult Refinement::Run() {
  RefineModelResult result;
  result.num_held_out_tracks = split_.held_out.size();
  result.held_out_max_px = judge_.max_error_px();
  result.held_out_before_px = start_px_;
  RoundLimits limits = first_limits_;
  for (int i = 0; i < options_.max_num_rounds && !IsLate(); ++i) {
    const RoundLimits before_round = limits;
    const bool has_gained = RunRound(limits);
    // The same again would come of the same limits and poses.
    if (!has_gained && !limits.IsTighterThan(before_round) &&
        !(HasFoundNothing() && limits.Widen())) {
      break;
    }
  }
  if (!IsLate()) TryFewerIntrinsics(limits);
  result.is_out_of_time = IsLate();
  result.feedforward = TriangulateAll(seed_, first_limits_.max_error_px);
  result.refined = PutBackUnsupported();
  if (good_.mean_px > start_px_) {
    good_ = Judge(seed_);
    result.refined = TriangulateAll(seed_);
  }
  result.rounds = rounds_;
  result.held_out_after_px = good_.mean_px;
  DescribeViews(result);
  if (result.IsRefined()) AddUncertainty(result);
  if (options_.progress) options_.progress(1, 1);
  return result;
}

}  // namespace vgtw
