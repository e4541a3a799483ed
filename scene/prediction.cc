// SPDX-License-Identifier: BSD-3-Clause
#include "scene/prediction.h"

#include "scene/files.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace vgtw {
namespace {

template <typename T>
bool HasWrongSize(const Grid<T>& map, const View& view) {
  return !map.empty() && (map.width() != view.network_width || map.height() != view.network_height);
}

bool IsBadDepth(float depth) { return !std::isnan(depth) && !(std::isfinite(depth) && depth > 0); }

bool IsBadProbability(float probability) {
  return !std::isnan(probability) && !(probability >= 0.0f && probability <= 1.0f);
}

bool IsBadSample(const DepthSample& sample) {
  return !sample.pixel_in_original.allFinite() || !(std::isfinite(sample.depth)) ||
         !(sample.depth > 0.0f);
}

std::string FindFaultOfView(const View& view) {
  if (!IsSafeRelativeName(view.name)) return "the name is not a safe relative path";
  if (std::string fault = FindFault(view.camera); !fault.empty()) return fault;
  if (std::string fault = FindFault(view.cam_from_world); !fault.empty()) return fault;
  if (view.network_width < 0 || view.network_height < 0) return "the network size is negative";
  if (!view.original_from_network.allFinite() ||
      !std::isnormal(view.original_from_network.leftCols<2>().determinant())) {
    return "original_from_network has no inverse";
  }
  return {};
}

}  // namespace

std::string FindFault(const ViewPrediction& prediction) {
  const View& view = prediction.view;
  if (std::string fault = FindFaultOfView(view); !fault.empty()) return fault;
  if (HasWrongSize(prediction.depth, view)) return "depth is not of the network size";
  if (HasWrongSize(prediction.depth_conf, view)) return "depth_conf is not of the network size";
  if (HasWrongSize(prediction.distractor, view)) return "distractor is not of the network size";
  if (HasWrongSize(prediction.points, view)) return "points is not of the network size";
  if (std::ranges::any_of(prediction.depth.data(), IsBadDepth)) {
    return "a depth is neither positive nor unknown";
  }
  if (std::ranges::any_of(prediction.distractor.data(), IsBadProbability)) {
    return "a distractor probability is outside [0, 1]";
  }
  if (std::ranges::any_of(prediction.depth_samples, IsBadSample)) {
    return "a depth sample is not finite and positive";
  }
  return {};
}

}  // namespace vgtw
