// SPDX-License-Identifier: BSD-3-Clause
#include "refine/refine_round.h"

#include "refine/filter.h"
#include "scene/reprojection.h"
#include "scene/statistics.h"

#include <algorithm>
#include <utility>

namespace vgtw {
namespace {

// Relative decrease of the cost per iteration at which an adjustment ends. What lies in the slow
// valley of focal length against depth is left to rounds with final limits.
constexpr double kCoarseTolerance = 1e-4;
constexpr double kFineTolerance = 1e-7;
constexpr double kMaxMedians = 6.0;
constexpr double kMinTightening = 0.1;
// Uncertainties of more parameters take longer than the adjustment; priors keep their sigmas then.
constexpr int kMaxParametersInRounds = 1500;
// Keypoints are not better than that, however few there are.
constexpr double kMinSigmaPx = 0.1;

// Images that too few observations tie down go, until all that stay are tied down.
void DropWeakImages(size_t min_num_observations, Reconstruction& model) {
  for (bool is_done = false; !is_done;) {
    is_done = true;
    for (const auto& [id, num] : NumSupportingObservations(model)) {
      if (num >= min_num_observations) continue;
      if (RemoveObservationsOf(id, model) > 0) is_done = false;
    }
  }
}

// Of images with observations.
std::map<ImageId, double> MedianErrorsPx(const Reconstruction& model) {
  std::map<ImageId, double> medians;
  for (const auto& [id, image] : model.images) {
    std::vector<double> errors;
    for (const Point2D& point2D : image.points2D) {
      if (!point2D.HasPoint3D()) continue;
      if (const auto error = ReprojectionError(model, image, point2D)) errors.push_back(*error);
    }
    if (!errors.empty()) medians[id] = Median(std::move(errors));
  }
  return medians;
}

bool HasEntries(const BundlePriors& priors) {
  return !priors.poses.by_image.empty() || !priors.centres.by_image.empty() ||
         !priors.focal_lengths.empty() || !priors.depths.by_image.empty();
}

// Gives every group the sigma that its residuals show.
void ScaleSigmas(const BundlePriorsSummary& summary,
                 const PriorRedundancies& redundancies,
                 BundlePriors& priors) {
  const auto factor_of = [](const PriorGroupSummary& group, double redundancy) {
    MeasuredSigmaOptions options;
    options.redundancy = std::clamp(redundancy, 0.0, 1.0);
    return MeasuredSigmaFactor(group.residuals, options);
  };
  const double rotations = factor_of(summary.rotations, redundancies.rotations);
  const double pose_centres = factor_of(summary.pose_centres, redundancies.pose_centres);
  const double centres = factor_of(summary.centres, redundancies.centres);
  const double focal_lengths = factor_of(summary.focal_lengths, redundancies.focal_lengths);
  const double depths = factor_of(summary.depths, 1.0);
  for (auto& [id, prior] : priors.poses.by_image) {
    prior.rotation_sigma_deg *= rotations;
    prior.centre_sigma *= pose_centres;
  }
  for (auto& [id, prior] : priors.centres.by_image) prior.sigma *= centres;
  for (auto& [id, prior] : priors.focal_lengths) prior.log_sigma *= focal_lengths;
  for (auto& [id, depths_of_view] : priors.depths.by_image) {
    for (DepthPrior& prior : depths_of_view) prior.log_sigma *= depths;
  }
}

}  // namespace

double RoundLimits::MedianPx() const {
  std::vector<double> limits;
  for (const auto& [id, limit_px] : max_error_px) limits.push_back(limit_px);
  return limits.empty() ? final_px : Median(std::move(limits));
}

void RoundLimits::Tighten(const std::map<ImageId, double>& median_px) {
  for (const auto& [id, image_median_px] : median_px) {
    double& limit_px = max_error_px.at(id);
    limit_px = std::min(limit_px, std::max(kMaxMedians * image_median_px, final_px));
  }
}

bool RoundLimits::IsTighterThan(const RoundLimits& before) const {
  return std::any_of(max_error_px.begin(), max_error_px.end(), [&](const auto& entry) {
    return entry.second < (1.0 - kMinTightening) * before.max_error_px.at(entry.first);
  });
}

bool RoundLimits::Widen() {
  bool has_changed = false;
  for (auto& [id, limit_px] : max_error_px) {
    if (limit_px >= worst_px) continue;
    limit_px = std::min(2.0 * limit_px, worst_px);
    has_changed = true;
  }
  return has_changed;
}

BundleAdjustmentOptions AdjustmentOf(const RefineModelOptions& options,
                                     const Reconstruction& model,
                                     const BundlePriors& priors) {
  BundleAdjustmentOptions adjustment;
  const double median_px = ComputeReprojectionStats(model).median_px;
  adjustment.loss_scale_px = std::max(1.0, median_px);
  adjustment.refine_focal_length = options.refine_focal_length;
  adjustment.refine_principal_point = options.refine_principal_point;
  adjustment.refine_extra_params = options.refine_extra_params;
  adjustment.num_threads = options.num_threads;
  adjustment.priors = priors;
  // The median length of a normal error in the plane is 1.18 sigmas of a coordinate.
  adjustment.priors.sigma_px = std::max(median_px / 1.18, kMinSigmaPx);
  return adjustment;
}

RoundOutcome RunRefineRound(const RefineModelOptions& options,
                            const std::vector<Track>& tracks,
                            const std::set<ImageId>& held,
                            const RoundLimits& limits,
                            BundlePriors& priors,
                            Reconstruction& model,
                            const std::function<bool()>& goes_on) {
  RoundOutcome outcome;
  RoundLimits current = limits;
  // The share that is held out supports a view no less.
  const auto min_num_observations =
      static_cast<size_t>(options.min_num_observations * (1.0 - options.held_out_percent / 100.0));
  TriangulateTracks(
      {options.max_error_px, options.min_angle_deg, options.num_threads, limits.max_error_px},
      TracksIn(tracks, [&](ImageId id) { return !held.contains(id); }),
      model);
  for (int pass = 0; pass < 2; ++pass) {
    DropWeakImages(min_num_observations, model);
    const bool is_fine = limits.IsFinal() && pass == 1;
    BundleAdjustmentOptions adjustment = AdjustmentOf(options, model, priors);
    // Distortion is released once poses are near: before that it would soak up their errors.
    adjustment.refine_extra_params &= limits.IsFinal() || pass == 1;
    adjustment.function_tolerance = is_fine ? kFineTolerance : kCoarseTolerance;
    if (goes_on) adjustment.on_iteration = [&](int, double) { return goes_on(); };
    outcome.adjustment = AdjustBundle(adjustment, model);
    if (!outcome.adjustment.success) return {};
    if (HasEntries(priors)) {
      const Uncertainty uncertainty =
          EstimateUncertainty(adjustment, model, {kMaxParametersInRounds});
      if (uncertainty.success) {
        ScaleSigmas(outcome.adjustment.priors, uncertainty.prior_redundancies, priors);
      }
    }
    outcome.median_px = MedianErrorsPx(model);
    current.Tighten(outcome.median_px);
    FilterObservations({options.max_error_px, options.min_angle_deg, current.max_error_px}, model);
  }
  DropWeakImages(min_num_observations, model);
  outcome.median_px = MedianErrorsPx(model);
  for (const auto& [id, median_px] : outcome.median_px) outcome.adjusted.insert(id);
  return outcome;
}

size_t RemoveObservationsOf(ImageId image_id, Reconstruction& model) {
  const std::vector<Point2D>& points2D = model.images.at(image_id).points2D;
  size_t num_removed = 0;
  for (uint32_t idx = 0; idx < points2D.size(); ++idx) {
    if (!points2D[idx].HasPoint3D()) continue;
    RemoveObservation(model, {image_id, idx});
    ++num_removed;
  }
  return num_removed;
}

std::vector<Track> TracksIn(const std::vector<Track>& tracks,
                            const std::function<bool(ImageId)>& is_wanted) {
  std::vector<Track> wanted;
  for (const Track& track : tracks) {
    Track& elements = wanted.emplace_back();
    for (const TrackElement& element : track) {
      if (is_wanted(element.image_id)) elements.push_back(element);
    }
    if (elements.size() < 2) wanted.pop_back();
  }
  return wanted;
}

std::map<ImageId, size_t> NumSupportingObservations(const Reconstruction& model) {
  const size_t min_track_length = model.images.size() < 3 ? 2 : 3;
  std::map<ImageId, size_t> num_by_image;
  for (const auto& [id, image] : model.images) num_by_image[id] = 0;
  for (const auto& [id, point3D] : model.points3D) {
    if (point3D.track.size() < min_track_length) continue;
    for (const TrackElement& element : point3D.track) ++num_by_image[element.image_id];
  }
  return num_by_image;
}

}  // namespace vgtw
