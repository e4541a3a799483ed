// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/conventions.h"

#include "bridge/photo_order.h"
#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

namespace vgtw {
namespace {

constexpr size_t kMaxProbes = 16;
constexpr size_t kRunLength = 4;  // neighbours by name, which mostly overlap
constexpr size_t kMaxSamples = 500;
constexpr size_t kMinProbes = 2;
// Anchors decide if their spread, relative to the photo's longer side, is good under another
// reading and so many times smaller than as read.
constexpr double kMaxGoodSpread = 0.03;
constexpr double kSpreadRatio = 4.0;
// Flow decides if, under another reading, enough samples agree in depth, a good share of those that
// meet the other view, many times more than as read, and the photos correlate there, and more than
// as read. Measured on rendered scenes with VGGT's errors: right readings reach 41-94 % of the hits
// and a correlation of 0.17-0.69; at least one of both is less than half of it in wrong ones.
constexpr size_t kMinAgreeing = 500;
constexpr double kMinAgreeingShare = 0.3;
constexpr double kAgreeingRatio = 1.4;
constexpr double kMinCorrelation = 0.12;
constexpr double kCorrelationRatio = 1.5;
constexpr double kPlainerRatio = 1.1;
constexpr double kMaxDepthDifference = 0.03;  // relative; VGGT's own is 1.2 % in the median

// Photos to look at: all, or runs of neighbours spread over the set.
std::vector<bool> ChooseProbes(size_t num_photos) {
  std::vector<bool> is_probed(num_photos, num_photos <= kMaxProbes);
  if (num_photos <= kMaxProbes) return is_probed;
  constexpr size_t kNumRuns = kMaxProbes / kRunLength;
  for (size_t run = 0; run < kNumRuns; ++run) {
    const size_t begin = run * (num_photos - kRunLength) / (kNumRuns - 1);
    for (size_t i = 0; i < kRunLength; ++i) is_probed[begin + i] = true;
  }
  return is_probed;
}

Eigen::Vector2d RelativePosition(const Camera& camera, const Eigen::Vector2d& pixel) {
  return {pixel.x() / static_cast<double>(camera.width),
          pixel.y() / static_cast<double>(camera.height)};
}

void AddSample(const Eigen::Vector2d& pixel, double depth, ConventionProbe& probe) {
  const auto ray = Unproject(probe.view.camera, pixel);
  if (!ray) return;
  probe.points_in_cam.push_back(depth * ray->homogeneous());
  probe.positions.push_back(RelativePosition(probe.view.camera, pixel));
}

// Network pixels on a grid that have depth and are static as far as known.
void AddMapSamples(const ViewPrediction& prediction, ConventionProbe& probe) {
  const auto per_side = static_cast<int>(std::sqrt(kMaxSamples));
  const DepthMap& depth = prediction.depth;
  for (int row = 0; row < per_side; ++row) {
    for (int column = 0; column < per_side; ++column) {
      const int x = (2 * column + 1) * depth.width() / (2 * per_side);
      const int y = (2 * row + 1) * depth.height() / (2 * per_side);
      const bool is_distractor =
          !prediction.distractor.empty() && prediction.distractor(x, y) >= 0.5f;
      if (std::isnan(depth(x, y)) || is_distractor) continue;
      AddSample(Apply(prediction.view.original_from_network, Eigen::Vector2d(x + 0.5, y + 0.5)),
                depth(x, y),
                probe);
    }
  }
}

ConventionProbe MakeProbe(const ImportedView& imported) {
  const ViewPrediction& prediction = imported.prediction;
  ConventionProbe probe{prediction.view, imported.pose, {}, {}, {}, prediction.depth};
  const size_t anchor_step = imported.anchors.size() / kMaxSamples + 1;
  for (size_t i = 0; i < imported.anchors.size(); i += anchor_step) {
    probe.anchors.push_back(imported.anchors[i]);
  }
  if (!prediction.depth.empty()) {
    AddMapSamples(prediction, probe);
    return probe;
  }
  const size_t step = prediction.depth_samples.size() / kMaxSamples + 1;
  for (size_t i = 0; i < prediction.depth_samples.size(); i += step) {
    const DepthSample& sample = prediction.depth_samples[i];
    AddSample(sample.pixel_in_original.cast<double>(), sample.depth, probe);
  }
  return probe;
}

bool IsInside(const Camera& camera, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() < static_cast<double>(camera.width) &&
         pixel.y() < static_cast<double>(camera.height);
}

// Whether the map holds this depth there; true where there is no map.
bool AgreesWithDepth(const ConventionProbe& probe, const Eigen::Vector2d& pixel, double z) {
  if (probe.depth.empty()) return true;
  const Eigen::Vector2d in_network = Apply(Inverse(probe.view.original_from_network), pixel);
  const auto x = static_cast<int>(std::floor(in_network.x()));
  const auto y = static_cast<int>(std::floor(in_network.y()));
  if (!probe.depth.Contains(x, y)) return false;
  return std::abs(z - probe.depth(x, y)) <= kMaxDepthDifference * z;  // false for NaN
}

// Samples of `a` that land in `b`, and how many did before depth was compared.
ViewFlow MakeFlow(const std::vector<ConventionProbe>& probes,
                  size_t a,
                  size_t b,
                  const ConventionRepair& repair,
                  size_t& num_hits) {
  ViewFlow flow{a, b, {}, {}};
  const Rigid3d b_from_a =
      CamFromWorld(probes[b].pose, repair) * Inverse(CamFromWorld(probes[a].pose, repair));
  for (size_t i = 0; i < probes[a].points_in_cam.size(); ++i) {
    const Eigen::Vector3d point = b_from_a * probes[a].points_in_cam[i];
    const auto pixel = Project(probes[b].view.camera, point);
    if (!pixel || !IsInside(probes[b].view.camera, *pixel)) continue;
    ++num_hits;
    if (!AgreesWithDepth(probes[b], *pixel, point.z())) continue;
    flow.positions_a.push_back(probes[a].positions[i]);
    flow.positions_b.push_back(RelativePosition(probes[b].view.camera, *pixel));
  }
  return flow;
}

std::vector<ViewFlow> MakeFlows(const std::vector<ConventionProbe>& probes,
                                const ConventionRepair& repair,
                                size_t& num_hits) {
  std::vector<ViewFlow> flows;
  for (size_t a = 0; a < probes.size(); ++a) {
    for (size_t b = 0; b < probes.size(); ++b) {
      if (a != b) flows.push_back(MakeFlow(probes, a, b, repair, num_hits));
    }
  }
  return flows;
}

std::vector<float> DetailsAt(const PhotoDetail& detail,
                             const std::vector<Eigen::Vector2d>& positions) {
  std::vector<float> values;
  for (const Eigen::Vector2d& position : positions) values.push_back(DetailAt(detail, position));
  return values;
}

// Every reading of the poses that one or more repairs give, the plainest first.
std::vector<ConventionRepair> Readings(RotationForm form) {
  std::vector<ConventionRepair> readings;
  for (const bool swap : {false, true}) {
    if (swap && form == RotationForm::kMatrix) continue;
    readings.push_back({false, false, swap});
    readings.push_back({true, false, swap});
    readings.push_back({false, true, swap});
    readings.push_back({true, true, swap});
  }
  return readings;
}

// Median over the views that have anchors of their spread relative to the photo's longer side;
// nullopt if there are none.
std::optional<double> RelativeAnchorSpread(const std::vector<ConventionProbe>& probes,
                                           const ConventionRepair& repair) {
  constexpr size_t kMinAnchors = 20;
  std::vector<double> spreads;
  for (const ConventionProbe& probe : probes) {
    if (probe.anchors.size() < kMinAnchors) continue;
    const auto side =
        static_cast<double>(std::max(probe.view.camera.width, probe.view.camera.height));
    spreads.push_back(std::min(AnchorSpread(probe, repair) / side, 1e6));
  }
  if (spreads.empty()) return std::nullopt;
  return Median(std::move(spreads));
}

std::optional<ConventionRepair> BetterByAnchors(const std::vector<ConventionProbe>& probes,
                                                const std::vector<ConventionRepair>& readings,
                                                double spread_as_read) {
  std::optional<ConventionRepair> better;
  double best = std::min(kMaxGoodSpread, spread_as_read / kSpreadRatio);
  for (const ConventionRepair& reading : readings) {
    const double spread = RelativeAnchorSpread(probes, reading).value();
    if (spread >= best) continue;
    best = spread;
    better = reading;
  }
  return better;
}

std::optional<ConventionRepair> BetterByFlow(const std::vector<ConventionProbe>& probes,
                                             const std::vector<const PhotoDetail*>& details,
                                             const std::vector<ConventionRepair>& readings,
                                             const ConventionRepair& as_read) {
  const FlowAgreement read = MeasureFlow(probes, details, as_read);
  std::optional<ConventionRepair> better;
  double best_score = 0.0;
  for (const ConventionRepair& reading : readings) {
    const FlowAgreement other = MeasureFlow(probes, details, reading);
    const auto num_agreeing = static_cast<double>(other.num_agreeing);
    const bool is_far_better =
        other.num_agreeing >= kMinAgreeing &&
        num_agreeing >= kMinAgreeingShare * static_cast<double>(other.num_hits) &&
        num_agreeing >= kAgreeingRatio * static_cast<double>(read.num_agreeing) &&
        other.correlation >= kMinCorrelation &&
        other.correlation >= kCorrelationRatio * read.correlation;
    // Where readings come to the same, the plainest is meant.
    const double score = num_agreeing * other.correlation;
    if (!is_far_better || score < kPlainerRatio * best_score) continue;
    best_score = score;
    better = reading;
  }
  return better;
}

}  // namespace

double AnchorSpread(const ConventionProbe& probe, const ConventionRepair& repair) {
  const Rigid3d cam_from_world = CamFromWorld(probe.pose, repair);
  std::vector<Eigen::Vector2d> residuals;
  for (const Anchor& anchor : probe.anchors) {
    const auto pixel = Project(probe.view.camera, cam_from_world * anchor.point_in_world);
    if (pixel) residuals.push_back(*pixel - anchor.pixel_in_original);
  }
  if (residuals.empty() || 2 * residuals.size() < probe.anchors.size()) {
    return std::numeric_limits<double>::infinity();
  }
  std::vector<double> x;
  std::vector<double> y;
  for (const Eigen::Vector2d& residual : residuals) {
    x.push_back(residual.x());
    y.push_back(residual.y());
  }
  const Eigen::Vector2d offset(Median(std::move(x)), Median(std::move(y)));
  std::vector<double> distances;
  for (const Eigen::Vector2d& residual : residuals) distances.push_back((residual - offset).norm());
  distances.resize(probe.anchors.size(), std::numeric_limits<double>::max());
  return Median(std::move(distances));
}

FlowAgreement MeasureFlow(const std::vector<ConventionProbe>& probes,
                          const std::vector<const PhotoDetail*>& details,
                          const ConventionRepair& repair) {
  constexpr size_t kMinLength = 30;
  FlowAgreement agreement;
  for (const ConventionProbe& probe : probes) {
    agreement.num_samples += probe.points_in_cam.size() * (probes.size() - 1);
  }
  double weighted_sum = 0.0;
  size_t total_weight = 0;
  for (const ViewFlow& flow : MakeFlows(probes, repair, agreement.num_hits)) {
    const size_t length = flow.positions_a.size();
    agreement.num_agreeing += length;
    if (length < kMinLength) continue;
    const std::vector<float> values_a = DetailsAt(*details[flow.view_a], flow.positions_a);
    const std::vector<float> values_b = DetailsAt(*details[flow.view_b], flow.positions_b);
    weighted_sum += static_cast<double>(length) * Correlation(values_a, values_b);
    total_weight += length;
  }
  if (total_weight > 0) agreement.correlation = weighted_sum / static_cast<double>(total_weight);
  return agreement;
}

std::optional<ConventionRepair> FindBetterReading(const std::vector<ConventionProbe>& probes,
                                                  const std::vector<const PhotoDetail*>& details,
                                                  const ConventionRepair& as_read) {
  const std::vector<ConventionRepair> readings = Readings(probes.front().pose.form);
  if (const auto spread = RelativeAnchorSpread(probes, as_read)) {
    return BetterByAnchors(probes, readings, *spread);
  }
  return BetterByFlow(probes, details, readings, as_read);
}

ConventionCheck::ConventionCheck(const ImportJob& job)
    : job_(job), is_probed_(ChooseProbes(job.photos.size())) {}

void ConventionCheck::Add(const ImportedView& imported) {
  const bool has_evidence = !imported.prediction.depth.empty() ||
                            !imported.prediction.depth_samples.empty() || !imported.anchors.empty();
  if (!is_probed_[imported.photo_idx] || !has_evidence) return;
  probes_.push_back(MakeProbe(imported));
  photo_indices_.push_back(imported.photo_idx);
  ReadDetail(imported.photo_idx);
}

void ConventionCheck::ReadDetail(size_t photo_idx) {
  if (details_.contains(photo_idx)) return;
  details_.emplace(photo_idx,
                   MakePhotoDetail(ReadRgbImage(job_.image_folder / job_.photos[photo_idx].name)));
}

std::vector<std::string> ConventionCheck::FindMistakes() {
  if (probes_.size() < kMinProbes) return {};
  if (auto mistake = FindWrongPoses()) return {*std::move(mistake)};
  if (auto mistake = FindWrongOrder()) return {*std::move(mistake)};
  return {};
}

std::optional<std::string> ConventionCheck::FindWrongPoses() const {
  const std::optional<ConventionRepair> better =
      FindBetterReading(probes_, DetailsOfProbes(), job_.options.repair);
  if (!better) return std::nullopt;
  const std::string options = OptionsText(*better);
  return "the poses contradict the depth, the points or the photos, and agree far better " +
         (options.empty() ? "without the repairs asked for: import again without them"
                          : "read with " + options + ": import again with that");
}

std::vector<const PhotoDetail*> ConventionCheck::DetailsOfProbes() const {
  std::vector<const PhotoDetail*> details;
  for (const size_t photo_idx : photo_indices_) details.push_back(&details_.at(photo_idx));
  return details;
}

// As read, view i of the probes shows photo_indices_[i]; sorted by numbers in their names, the
// photos might be what the network saw.
std::optional<std::string> ConventionCheck::FindWrongOrder() {
  std::vector<std::string> names;
  for (const Photo& photo : job_.photos) names.push_back(photo.name);
  const std::vector<size_t> natural = NaturalOrder(names);
  std::vector<const PhotoDetail*> details = DetailsOfProbes();
  std::vector<size_t> photos = photo_indices_;
  std::vector<size_t> candidate;
  for (const size_t photo_idx : photo_indices_) {
    const size_t wanted = natural[photo_idx];
    const auto known = std::find(photos.begin(), photos.end(), wanted);
    candidate.push_back(static_cast<size_t>(known - photos.begin()));
    if (known != photos.end()) continue;
    ReadDetail(wanted);
    photos.push_back(wanted);
    details.push_back(&details_.at(wanted));
  }
  size_t num_hits = 0;
  const auto order = FindBetterPhotoOrder(
      MakeFlows(probes_, job_.options.repair, num_hits), probes_.size(), details, {candidate});
  if (!order) return std::nullopt;
  return OrderText(*order, order->photo_of_view == candidate, photos);
}

std::string ConventionCheck::OrderText(const PhotoOrder& order,
                                       bool is_natural,
                                       const std::vector<size_t>& photos) const {
  char correlations[64];
  std::snprintf(correlations,
                sizeof(correlations),
                "%.2f instead of %.2f",
                order.correlation,
                order.correlation_as_read);
  std::string text = "the photos seem to be in another order than the views: they correlate " +
                     std::string(correlations) + " ";
  if (is_natural) {
    return text +
           "in numeric order of their names; the network saw them so: rename them with "
           "leading zeros, or give one .npz per image";
  }
  size_t num_listed = 0;
  for (size_t i = 0; i < order.photo_of_view.size() && num_listed < 3; ++i) {
    if (order.photo_of_view[i] == i) continue;
    text += (num_listed++ == 0 ? "if " : ", ") + Printable(job_.photos[photos[i]].name) +
            " is exchanged for " + Printable(job_.photos[photos[order.photo_of_view[i]]].name);
  }
  return text + " ...: rename the photos to the network's order, or give one .npz per image";
}

}  // namespace vgtw
