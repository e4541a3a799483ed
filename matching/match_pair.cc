// SPDX-License-Identifier: BSD-3-Clause
#include "matching/match_pair.h"

#include "matching/epipolar_band.h"
#include "matching/flow_field.h"
#include "matching/relative_pose.h"
#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

namespace vgtw {
namespace {

// Verified matches reach to 1 in their windows; if the outer ones come near, others were cut off.
constexpr double kCrowdedShare = 0.75;
// So many times the least number of inliers are no accident, nor a corner of what there is.
constexpr size_t kMinSureFactor = 4;
// Fine passes go on while each finds so many times what the last one did.
constexpr double kMinGrowth = 1.1;
constexpr int kMaxFinePasses = 4;
constexpr float kMinFineRadiusPx = 4.0f;
// In errors of inliers: a band along the epipolar line is smaller than a disc of this radius.
constexpr double kMinBandLength = 3.0;
constexpr float kMaxFineRadiusShare = 0.1f;  // of the longest side

size_t NumInliers(const MatchedPair& pair) { return pair.geometry.inlier_matches.size(); }

std::span<const uint32_t> LargestFeatures(const MatchingView& view, size_t count) {
  const std::vector<uint32_t>& idxs = view.idxs_by_scale();
  return std::span(idxs).first(std::min(idxs.size(), count));
}

std::optional<RelativePoseError> ErrorOfPrediction(const MatchingView& view1,
                                                   const MatchingView& view2,
                                                   const TwoViewGeometry& geometry) {
  if (!geometry.cam2_from_cam1) return std::nullopt;
  const Rigid3d predicted =
      view2.features().view.cam_from_world * Inverse(view1.features().view.cam_from_world);
  RelativePoseError error;
  error.rotation_deg = AngleBetweenDeg(predicted.rotation, geometry.cam2_from_cam1->rotation);
  const Eigen::Vector3d& measured = geometry.cam2_from_cam1->translation;
  const double norms = predicted.translation.norm() * measured.norm();
  if (norms > 0.0) {
    const double cosine = std::clamp(predicted.translation.dot(measured) / norms, -1.0, 1.0);
    error.direction_deg = std::acos(cosine) * 180.0 / std::numbers::pi;
  }
  return error;
}

// Where counterparts lie, measured from where depth and pose put them, and from the pixel itself.
// The first is smooth over depth edges, the second does not suffer from wrong depth.
struct MatchFlow {
  FlowField from_prediction;
  FlowField from_pixel;
  std::optional<EpipolarBand> band;  // of the measured geometry
};

// Two passes over one pair.
class PairMatcher {
 public:
  PairMatcher(const MatchingView& view1, const MatchingView& view2, const MatchPairOptions& options)
      : view1_(view1), view2_(view2), options_(options) {}

  MatchedPair Coarse() const;
  MatchedPair Fine(const MatchedPair& coarse) const;

 private:
  WindowPredictor PredictorFor(int num_widenings) const;
  MatchedPair SearchOnce(const WindowPredictor& predictor) const;
  bool IsCrowded(const MatchedPair& pair, const WindowPredictor& predictor) const;
  MatchedPair Verified(FeatureMatches matches, MatchMethod method) const;
  MayMatch OnEpipolarLine(const TwoViewGeometry& geometry) const;
  std::optional<EpipolarBand> BandOf(const TwoViewGeometry& geometry) const;
  std::optional<SearchWindow> FineWindow(const WindowPredictor& predictor,
                                         const MatchFlow& flow,
                                         uint32_t idx1) const;
  float ClampedRadius(float radius_px) const;

  const MatchingView& view1_;
  const MatchingView& view2_;
  const MatchPairOptions& options_;
};

MatchedPair PairMatcher::Verified(FeatureMatches matches, MatchMethod method) const {
  MatchedPair pair;
  pair.geometry =
      EstimateTwoViewGeometry(view1_.features(), view2_.features(), matches, options_.two_view);
  pair.matches = std::move(matches);
  if (NumInliers(pair) > 0) pair.method = method;
  return pair;
}

WindowPredictor PairMatcher::PredictorFor(int num_widenings) const {
  return WindowPredictor(view1_.features(),
                         view2_.features(),
                         options_.uncertainty,
                         options_.num_sigmas * std::exp2(num_widenings));
}

MatchedPair PairMatcher::SearchOnce(const WindowPredictor& predictor) const {
  return Verified(SearchWindows(
                      view1_,
                      view2_,
                      LargestFeatures(view1_, static_cast<size_t>(options_.num_coarse_features)),
                      [&](uint32_t idx1) { return predictor.WindowOf(idx1); },
                      {},
                      options_.search),
                  MatchMethod::kGuided);
}

bool PairMatcher::IsCrowded(const MatchedPair& pair, const WindowPredictor& predictor) const {
  std::vector<double> shares;
  for (const auto& [idx1, idx2] : pair.geometry.inlier_matches) {
    const auto window = predictor.WindowOf(idx1);
    if (!window) continue;
    const Eigen::Vector2f& pixel2 = view2_.features().pixels[idx2];
    shares.push_back(std::sqrt(window->capsule.SquaredDistanceToAxis(pixel2)) /
                     window->capsule.radius);
  }
  return !shares.empty() && Percentile(std::move(shares), 80.0) > kCrowdedShare;
}

MatchedPair PairMatcher::Coarse() const {
  const size_t min_num_sure =
      kMinSureFactor * static_cast<size_t>(options_.two_view.min_num_inliers);
  MatchedPair best;
  for (int i = std::min(options_.min_num_widenings, options_.max_num_widenings);
       i <= options_.max_num_widenings;
       ++i) {
    const WindowPredictor predictor = PredictorFor(i);
    MatchedPair pair = SearchOnce(predictor);
    if (NumInliers(pair) <= NumInliers(best)) continue;
    best = std::move(pair);
    best.num_widenings = i;
    if (i > 0) best.method = MatchMethod::kWidened;
    if (NumInliers(best) >= min_num_sure && !IsCrowded(best, predictor)) return best;
  }
  MatchedPair unguided = Verified(
      SearchAll(view1_,
                view2_,
                LargestFeatures(view1_, static_cast<size_t>(options_.num_coarse_features)),
                LargestFeatures(view2_, 2 * static_cast<size_t>(options_.num_coarse_features)),
                options_.search),
      MatchMethod::kUnguided);
  unguided.num_widenings = options_.max_num_widenings;
  return NumInliers(unguided) > NumInliers(best) ? unguided : best;
}

MayMatch PairMatcher::OnEpipolarLine(const TwoViewGeometry& geometry) const {
  const ViewFeatures& features1 = view1_.features();
  const ViewFeatures& features2 = view2_.features();
  const double max_error_px = options_.two_view.max_error_px;
  if (geometry.config == kTwoViewCalibrated) {
    const double max_error =
        2.0 * max_error_px /
        (features1.view.camera.MeanFocalLength() + features2.view.camera.MeanFocalLength());
    return [&features1, &features2, max_error, E = *geometry.E](uint32_t idx1, uint32_t idx2) {
      return SampsonDistance(E,
                             features1.rays[idx1].cast<double>(),
                             features2.rays[idx2].cast<double>()) <= max_error;
    };
  }
  if (geometry.config == kTwoViewUncalibrated) {
    return [&features1, &features2, max_error_px, F = *geometry.F](uint32_t idx1, uint32_t idx2) {
      return SampsonDistance(F,
                             features1.pixels[idx1].cast<double>(),
                             features2.pixels[idx2].cast<double>()) <= max_error_px;
    };
  }
  return {};  // a plane or a turn leaves the epipolar lines open
}

std::optional<EpipolarBand> PairMatcher::BandOf(const TwoViewGeometry& geometry) const {
  const double max_error_px = options_.two_view.max_error_px;
  if (geometry.config == kTwoViewCalibrated) {
    return EpipolarBand::OfRays(*geometry.E, view2_.features().view.camera, max_error_px);
  }
  if (geometry.config == kTwoViewUncalibrated)
    return EpipolarBand::OfPixels(*geometry.F, max_error_px);
  return std::nullopt;
}

float PairMatcher::ClampedRadius(float radius_px) const {
  const Camera& camera2 = view2_.features().view.camera;
  const float max_radius_px =
      kMaxFineRadiusShare * static_cast<float>(std::max(camera2.width, camera2.height));
  return std::clamp(radius_px, kMinFineRadiusPx, std::max(kMinFineRadiusPx, max_radius_px));
}

std::optional<SearchWindow> PairMatcher::FineWindow(const WindowPredictor& predictor,
                                                    const MatchFlow& flow,
                                                    uint32_t idx1) const {
  const Eigen::Vector2f& pixel1 = view1_.features().pixels[idx1];
  const auto predicted =
      std::isfinite(view1_.features().depths[idx1]) ? predictor.WindowOf(idx1) : std::nullopt;
  const bool by_depth = predicted && flow.from_prediction.Radius() <= flow.from_pixel.Radius();
  const FlowField& field = by_depth ? flow.from_prediction : flow.from_pixel;
  if (!field.IsUsable()) return std::nullopt;
  const Eigen::Vector2f centre = (by_depth ? predicted->centre : pixel1) + field.At(pixel1);
  SearchWindow window;
  window.capsule = {centre, centre, ClampedRadius(field.Radius())};
  if (flow.band && window.capsule.radius > kMinBandLength * options_.two_view.max_error_px) {
    const Eigen::Vector2f& x1 = flow.band->is_of_rays() ? view1_.features().rays[idx1] : pixel1;
    const auto band = flow.band->Around(centre, window.capsule.radius, x1.cast<double>());
    if (!band) return std::nullopt;
    window.capsule = *band;
  }
  if (predicted) window.scale_ratio = predicted->scale_ratio;
  return window;
}

MatchedPair PairMatcher::Fine(const MatchedPair& coarse) const {
  // As wide as the last coarse window, so that nothing it held counts as out of sight.
  const WindowPredictor predictor = PredictorFor(options_.max_num_widenings);
  std::vector<FlowField::Anchor> from_prediction, from_pixel;
  for (const auto& [idx1, idx2] : coarse.geometry.inlier_matches) {
    const Eigen::Vector2f& pixel1 = view1_.features().pixels[idx1];
    const Eigen::Vector2f& pixel2 = view2_.features().pixels[idx2];
    from_pixel.push_back({pixel1, pixel2 - pixel1});
    if (!std::isfinite(view1_.features().depths[idx1])) continue;
    if (const auto predicted = predictor.WindowOf(idx1)) {
      from_prediction.push_back({pixel1, pixel2 - predicted->centre});
    }
  }
  const MatchFlow flow = {FlowField(std::move(from_prediction)),
                          FlowField(std::move(from_pixel)),
                          BandOf(coarse.geometry)};
  MatchedPair fine = Verified(SearchWindows(
                                  view1_,
                                  view2_,
                                  view1_.idxs_by_scale(),
                                  [&](uint32_t idx1) { return FineWindow(predictor, flow, idx1); },
                                  OnEpipolarLine(coarse.geometry),
                                  options_.search),
                              coarse.method);
  fine.num_widenings = coarse.num_widenings;
  fine.window_radius_px =
      ClampedRadius(std::min(flow.from_prediction.Radius(), flow.from_pixel.Radius()));
  return fine;
}

}  // namespace

void MatchPairOptions::Check() const {
  uncertainty.Check();
  search.Check();
  two_view.Check();
  VGTW_CHECK(num_sigmas > 0.0 && std::isfinite(num_sigmas), "MatchPairOptions::num_sigmas");
  VGTW_CHECK(min_num_widenings >= 0 && min_num_widenings <= 16,
             "MatchPairOptions::min_num_widenings");
  VGTW_CHECK(max_num_widenings >= 0 && max_num_widenings <= 16,
             "MatchPairOptions::max_num_widenings");
  VGTW_CHECK(num_coarse_features >= 1, "MatchPairOptions::num_coarse_features");
}

std::string_view Name(MatchMethod method) {
  switch (method) {
    case MatchMethod::kGuided:
      return "guided";
    case MatchMethod::kWidened:
      return "widened";
    case MatchMethod::kUnguided:
      return "unguided";
    case MatchMethod::kNone:
      break;
  }
  return "none";
}

MatchedPair MatchPair(const MatchingView& view1,
                      const MatchingView& view2,
                      const MatchPairOptions& options) {
  options.Check();
  const PairMatcher matcher(view1, view2, options);
  MatchedPair pair = matcher.Coarse();
  for (int pass = 0; pass < kMaxFinePasses && NumInliers(pair) > 0; ++pass) {
    const auto num_before = static_cast<double>(NumInliers(pair));
    MatchedPair fine = matcher.Fine(pair);
    const bool is_settled = fine.window_radius_px <= 2.0f * kMinFineRadiusPx;
    if (NumInliers(fine) >= NumInliers(pair)) pair = std::move(fine);
    if (is_settled || static_cast<double>(NumInliers(pair)) < kMinGrowth * num_before) break;
  }
  pair.prediction_error = ErrorOfPrediction(view1, view2, pair.geometry);
  return pair;
}

MatchedPair MatchPairUnguided(const MatchingView& view1,
                              const MatchingView& view2,
                              const MatchPairOptions& options) {
  options.Check();
  MatchedPair pair;
  pair.matches =
      SearchAll(view1, view2, view1.idxs_by_scale(), view2.idxs_by_scale(), options.search);
  pair.geometry =
      EstimateTwoViewGeometry(view1.features(), view2.features(), pair.matches, options.two_view);
  if (NumInliers(pair) > 0) pair.method = MatchMethod::kUnguided;
  pair.prediction_error = ErrorOfPrediction(view1, view2, pair.geometry);
  return pair;
}

}  // namespace vgtw
