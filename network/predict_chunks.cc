// SPDX-License-Identifier: BSD-3-Clause
#include "network/predict_chunks.h"

#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>

namespace vgtw {
namespace {

struct DepthPair {
  double in_chunk = 0.0;
  double in_world = 0.0;
};

// Where the network is surer than in half of the view.
double MedianConfidence(const ViewPrediction& view) {
  std::vector<double> values;
  for (const float value : view.depth_conf.data()) {
    if (std::isfinite(value)) values.push_back(static_cast<double>(value));
  }
  return values.empty() ? 0.0 : Median(std::move(values));
}

bool IsStatic(const ViewPrediction& view, size_t i) {
  // An unknown probability is no distractor.
  return view.distractor.empty() || !(view.distractor.data()[i] >= 0.5f);
}

void AppendDepths(const ViewPrediction& in_chunk,
                  const ViewPrediction& in_world,
                  bool only_good,
                  std::vector<DepthPair>& pairs) {
  const double min_confidence = only_good ? MedianConfidence(in_chunk) : 0.0;
  for (size_t i = 0; i < in_chunk.depth.size(); ++i) {
    const float a = in_chunk.depth.data()[i];
    const float b = in_world.depth.data()[i];
    if (!std::isfinite(a) || !std::isfinite(b)) continue;
    if (only_good) {
      if (!IsStatic(in_chunk, i) || !IsStatic(in_world, i)) continue;
      // A quantised confidence is often equal to its median.
      const bool has_conf = !in_chunk.depth_conf.empty();
      if (has_conf && !(static_cast<double>(in_chunk.depth_conf.data()[i]) >= min_confidence)) {
        continue;
      }
    }
    pairs.push_back({static_cast<double>(a), static_cast<double>(b)});
  }
}

std::vector<DepthPair> SharedDepths(const std::vector<ViewPrediction>& views_in_chunk,
                                    const std::vector<ViewPrediction>& views_in_world) {
  constexpr size_t kMinGoodPixels = 100;
  std::vector<DepthPair> pairs;
  for (const bool only_good : {true, false}) {
    pairs.clear();
    for (size_t i = 0; i < views_in_chunk.size(); ++i) {
      AppendDepths(views_in_chunk[i], views_in_world[i], only_good, pairs);
    }
    if (pairs.size() >= kMinGoodPixels) break;
  }
  return pairs;
}

template <typename Value>
double MedianOf(const std::vector<DepthPair>& pairs, const Value& value) {
  std::vector<double> values(pairs.size());
  std::transform(pairs.begin(), pairs.end(), values.begin(), value);
  return Median(std::move(values));
}

// The centre of a camera and one point on each of its axes, `distance` away.
void AppendCamera(const Rigid3d& cam_from_world,
                  double distance,
                  std::vector<Eigen::Vector3d>& points) {
  const Rigid3d world_from_cam = Inverse(cam_from_world);
  points.push_back(world_from_cam.translation);
  for (int axis = 0; axis < 3; ++axis) {
    points.push_back(world_from_cam * (distance * Eigen::Vector3d::Unit(axis)));
  }
}

void MeasureCameras(const std::vector<ViewPrediction>& views_in_chunk,
                    const std::vector<ViewPrediction>& views_in_world,
                    AlignedChunk& aligned) {
  double sum = 0.0;
  std::vector<double> angles_deg;
  for (size_t i = 0; i < views_in_chunk.size(); ++i) {
    const Rigid3d moved =
        TransformCamera(aligned.world_from_chunk, views_in_chunk[i].view.cam_from_world);
    const Rigid3d& known = views_in_world[i].view.cam_from_world;
    sum += (OriginInSource(moved) - OriginInSource(known)).squaredNorm();
    angles_deg.push_back(AngleBetweenDeg(moved.rotation, known.rotation));
  }
  aligned.residuals.centre_rmse = std::sqrt(sum / static_cast<double>(views_in_chunk.size()));
  aligned.residuals.rotation_median_deg = Median(std::move(angles_deg));
}

}  // namespace

std::vector<ViewChunk> PlanChunks(int num_views, int max_views, int num_overlap_views) {
  VGTW_CHECK(num_views >= 1 && max_views >= 1 && num_overlap_views >= 1, "sizes of chunks");
  if (num_views <= max_views) return {{0, num_views, 0}};
  VGTW_CHECK(max_views >= 2, "chunks of one view share none");
  const int num_shared = std::min(num_overlap_views, max_views / 2);
  const int num_new = max_views - num_shared;
  // Behind the first num_shared views, every chunk adds its share of the rest.
  const int64_t num_rest = num_views - num_shared;
  const int64_t num_chunks = (num_rest + num_new - 1) / num_new;
  std::vector<ViewChunk> chunks;
  for (int64_t i = 0; i < num_chunks; ++i) {
    const auto begin = static_cast<int>(num_rest * i / num_chunks);
    const auto end = static_cast<int>(num_rest * (i + 1) / num_chunks) + num_shared;
    chunks.push_back({begin, end, i == 0 ? 0 : num_shared});
  }
  return chunks;
}

std::optional<AlignedChunk> AlignChunk(const std::vector<ViewPrediction>& views_in_chunk,
                                       const std::vector<ViewPrediction>& views_in_world) {
  VGTW_CHECK(views_in_chunk.size() == views_in_world.size(), "views come in pairs");
  const std::vector<DepthPair> depths = SharedDepths(views_in_chunk, views_in_world);
  if (depths.empty()) return std::nullopt;
  const double scale =
      MedianOf(depths, [](const DepthPair& pair) { return pair.in_world / pair.in_chunk; });
  const double typical_depth =
      MedianOf(depths, [](const DepthPair& pair) { return pair.in_chunk; });
  std::vector<Eigen::Vector3d> points_in_chunk;
  std::vector<Eigen::Vector3d> points_in_world;
  for (size_t i = 0; i < views_in_chunk.size(); ++i) {
    AppendCamera(views_in_chunk[i].view.cam_from_world, typical_depth, points_in_chunk);
    AppendCamera(views_in_world[i].view.cam_from_world, scale * typical_depth, points_in_world);
  }
  const std::optional<RobustSim3d> fit = EstimateSim3dRobust(points_in_chunk, points_in_world);
  if (!fit) return std::nullopt;
  AlignedChunk aligned;
  aligned.world_from_chunk = fit->b_from_a;
  aligned.residuals.num_shared_views = static_cast<int>(views_in_chunk.size());
  aligned.residuals.scale = fit->b_from_a.scale;
  MeasureCameras(views_in_chunk, views_in_world, aligned);
  aligned.residuals.depth_median_percent = MedianOf(depths, [&](const DepthPair& pair) {
    return 100.0 * std::abs(fit->b_from_a.scale * pair.in_chunk / pair.in_world - 1.0);
  });
  return aligned;
}

void TransformPrediction(const Sim3d& b_from_a, ViewPrediction& prediction) {
  prediction.view.cam_from_world = TransformCamera(b_from_a, prediction.view.cam_from_world);
  const auto scale = static_cast<float>(b_from_a.scale);
  for (float& depth : prediction.depth.data()) depth *= scale;
  for (DepthSample& sample : prediction.depth_samples) sample.depth *= scale;
  for (Eigen::Vector3f& point : prediction.points.data()) {
    point = (b_from_a * point.cast<double>()).cast<float>();
  }
}

}  // namespace vgtw
