// SPDX-License-Identifier: BSD-3-Clause
#include "scene/static_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace vgtw {
namespace {

// Bins per longest side in which samples are looked up.
constexpr double kNumSampleBins = 128.0;

bool Agrees(double measured, double expected, double max_relative_difference) {
  return std::abs(measured - expected) <= max_relative_difference * measured;
}

}  // namespace

StaticView::StaticView(ViewPrediction prediction, double distractor_threshold)
    : prediction_(std::move(prediction)),
      distractor_threshold_(distractor_threshold),
      network_from_original_(Inverse(prediction_.view.original_from_network)) {
  if (prediction_.depth.empty()) {
    prediction_.depth = DepthFromPoints(prediction_.view, prediction_.points);
  }
  if (prediction_.depth.empty()) BinSamples();
}

void StaticView::BinSamples() {
  const Camera& camera = prediction_.view.camera;
  bin_edge_px_ = static_cast<double>(std::max(camera.width, camera.height)) / kNumSampleBins;
  samples_by_bin_ = Grid<std::vector<DepthSample>>(
      static_cast<int>(std::ceil(static_cast<double>(camera.width) / bin_edge_px_)),
      static_cast<int>(std::ceil(static_cast<double>(camera.height) / bin_edge_px_)));
  for (const DepthSample& sample : prediction_.depth_samples) {
    const Eigen::Vector2d pixel = sample.pixel_in_original.cast<double>();
    const Eigen::Array2i bin = BinOf(pixel);
    if (!samples_by_bin_.Contains(bin.x(), bin.y()) || !IsStatic(pixel)) continue;
    samples_by_bin_(bin.x(), bin.y()).push_back(sample);
  }
}

Eigen::Array2i StaticView::BinOf(const Eigen::Vector2d& pixel_in_original) const {
  // Clamped before the conversion, which is undefined for numbers that no int holds.
  return (pixel_in_original / bin_edge_px_).array().floor().max(-1.0).min(1e6).cast<int>();
}

void StaticView::AddConfidencesTo(ConfidenceHistogram& histogram) const {
  const ConfidenceMap& confidence = prediction_.depth_conf;
  for (size_t i = 0; i < confidence.size() && i < prediction_.depth.size(); ++i) {
    if (std::isfinite(prediction_.depth.data()[i])) histogram.Add(confidence.data()[i]);
  }
  if (!prediction_.depth.empty()) return;
  for (const DepthSample& sample : prediction_.depth_samples) histogram.Add(sample.confidence);
}

bool StaticView::IsStatic(const Eigen::Vector2d& pixel_in_original) const {
  const DistractorMask& distractor = prediction_.distractor;
  if (distractor.empty()) return true;
  const Eigen::Vector2d pixel = Apply(network_from_original_, pixel_in_original);
  if (!(pixel.x() >= 0.0 && pixel.x() < distractor.width() && pixel.y() >= 0.0 &&
        pixel.y() < distractor.height())) {
    return false;
  }
  return distractor(static_cast<int>(pixel.x()), static_cast<int>(pixel.y())) <
         distractor_threshold_;
}

std::vector<StaticView::Point> StaticView::StaticPoints(double confidence_threshold) const {
  const View& view = prediction_.view;
  const DepthMap& depth = prediction_.depth;
  std::vector<Point> points;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const float confidence = prediction_.depth_conf.empty() ? 1.0f : prediction_.depth_conf(x, y);
      if (!prediction_.depth_conf.empty() && !(confidence >= confidence_threshold)) continue;
      const Eigen::Vector2d pixel =
          Apply(view.original_from_network, Eigen::Vector2d(x + 0.5, y + 0.5));
      if (!IsStatic(pixel)) continue;
      if (const auto point = UnprojectPixel(view, depth, x, y)) {
        points.push_back({*point, pixel, confidence});
      }
    }
  }
  if (!depth.empty()) return points;
  for (const DepthSample& sample : prediction_.depth_samples) {
    const Eigen::Vector2d pixel = sample.pixel_in_original.cast<double>();
    if (!(sample.confidence >= confidence_threshold) || !IsStatic(pixel)) continue;
    const auto ray = Unproject(view.camera, pixel);
    if (!ray) continue;
    points.push_back({Inverse(view.cam_from_world) * (sample.depth * ray->homogeneous()),
                      pixel,
                      sample.confidence});
  }
  return points;
}

template <typename Visit>
bool StaticView::AnySampleAround(const Eigen::Vector2d& pixel_in_original,
                                 const Visit& visit) const {
  const Eigen::Array2i bin = BinOf(pixel_in_original);
  for (int y = bin.y() - 1; y <= bin.y() + 1; ++y) {
    for (int x = bin.x() - 1; x <= bin.x() + 1; ++x) {
      if (!samples_by_bin_.Contains(x, y)) continue;
      const std::vector<DepthSample>& samples = samples_by_bin_(x, y);
      if (std::any_of(samples.begin(), samples.end(), visit)) return true;
    }
  }
  return false;
}

std::optional<DepthSample> StaticView::DepthAt(const Eigen::Vector2d& pixel_in_original) const {
  if (!IsStatic(pixel_in_original)) return std::nullopt;
  std::optional<DepthSample> nearest;
  if (prediction_.depth.empty()) {
    const Eigen::Vector2f pixel = pixel_in_original.cast<float>();
    float nearest_distance = std::numeric_limits<float>::infinity();
    AnySampleAround(pixel_in_original, [&](const DepthSample& sample) {
      const float distance = (sample.pixel_in_original - pixel).norm();
      if (distance < nearest_distance) {
        nearest = sample;
        nearest_distance = distance;
      }
      return false;
    });
    return nearest;
  }
  const Eigen::Vector2d pixel = Apply(network_from_original_, pixel_in_original);
  const auto depth = SampleDepth(prediction_.depth, pixel);
  if (!depth) return std::nullopt;
  const ConfidenceMap& confidence = prediction_.depth_conf;
  return DepthSample{pixel_in_original.cast<float>(),
                     static_cast<float>(*depth),
                     confidence.empty()
                         ? 1.0f
                         : confidence(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()))};
}

std::optional<Eigen::Vector2d> StaticView::See(const Eigen::Vector3d& point_in_world,
                                               double max_relative_depth_difference) const {
  const View& view = prediction_.view;
  const Eigen::Vector3d point_in_cam = view.cam_from_world * point_in_world;
  const std::optional<Eigen::Vector2d> pixel = Project(view.camera, point_in_cam);
  if (!pixel || !(pixel->x() >= 0.0 && pixel->x() < static_cast<double>(view.camera.width) &&
                  pixel->y() >= 0.0 && pixel->y() < static_cast<double>(view.camera.height))) {
    return std::nullopt;
  }
  if (!IsStatic(*pixel)) return std::nullopt;
  bool agrees = false;
  if (prediction_.depth.empty()) {
    agrees = AnySampleAround(*pixel, [&](const DepthSample& sample) {
      return Agrees(sample.depth, point_in_cam.z(), max_relative_depth_difference);
    });
  } else if (const auto measured =
                 SampleDepth(prediction_.depth, Apply(network_from_original_, *pixel))) {
    agrees = Agrees(*measured, point_in_cam.z(), max_relative_depth_difference);
  }
  return agrees ? pixel : std::nullopt;
}

}  // namespace vgtw
