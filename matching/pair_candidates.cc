// SPDX-License-Identifier: BSD-3-Clause
#include "matching/pair_candidates.h"

#include "scene/random.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

namespace vgtw {
namespace {

constexpr double kEdgePerFootprint = 0.25;

// Grids of all sizes would have the planes through the origin in common, so that what lies along
// one would always be split; hence each is shifted by another fraction of its edge.
uint64_t VoxelKey(const Eigen::Vector3d& point, int level) {
  constexpr double kGoldenRatio = 0.6180339887498949;
  constexpr double kMaxIndex = 1e18;  // fits an int64
  const double shift = level * kGoldenRatio - std::floor(level * kGoldenRatio);
  const Eigen::Array3d position = point.array() / std::ldexp(1.0, level) + shift;
  std::array<uint64_t, 3> idx;
  for (int i = 0; i < 3; ++i) {
    const double clamped = std::clamp(std::floor(position[i]), -kMaxIndex, kMaxIndex);
    idx[static_cast<size_t>(i)] = static_cast<uint64_t>(static_cast<int64_t>(clamped));
  }
  return HashKey({static_cast<uint64_t>(level), idx[0], idx[1], idx[2]});
}

// Keys of the voxels of a view's points, one per point and level, ascending.
std::vector<uint64_t> KeysOf(const Covisibility& covisibility, size_t view_idx) {
  std::vector<uint64_t> keys;
  const std::vector<Eigen::Vector3d>& points = covisibility.PointsOf(view_idx);
  const std::vector<double>& footprints = covisibility.FootprintsOf(view_idx);
  for (size_t i = 0; i < footprints.size(); ++i) {
    if (!(footprints[i] > 0.0 && points[i].allFinite())) continue;
    const int level = std::ilogb(kEdgePerFootprint * footprints[i]);
    for (const int step : {-1, 0, 1}) keys.push_back(VoxelKey(points[i], level + step));
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

}  // namespace

PairCandidates::PairCandidates(const Covisibility& covisibility)
    : views_(covisibility.num_views()) {
  struct KeyedEntry {
    uint64_t key;
    uint32_t view_idx;
    uint32_t num_points;
  };
  std::vector<KeyedEntry> keyed;
  for (size_t i = 0; i < views_.size(); ++i) {
    const std::vector<uint64_t> keys = KeysOf(covisibility, i);
    for (size_t k = 0; k < keys.size(); ++k) {
      if (k == 0 || keys[k] != keys[k - 1]) keyed.push_back({keys[k], static_cast<uint32_t>(i), 0});
      ++keyed.back().num_points;
    }
  }
  std::sort(keyed.begin(), keyed.end(), [](const KeyedEntry& a, const KeyedEntry& b) {
    return std::tie(a.key, a.view_idx) < std::tie(b.key, b.view_idx);
  });
  entries_.reserve(keyed.size());
  for (size_t i = 0; i < keyed.size(); ++i) {
    if (i == 0 || keyed[i].key != keyed[i - 1].key) voxel_begins_.push_back(i);
    views_[keyed[i].view_idx].push_back(i);
    entries_.push_back({voxel_begins_.size() - 1, keyed[i].view_idx, keyed[i].num_points});
  }
  voxel_begins_.push_back(entries_.size());
}

std::vector<size_t> PairCandidates::Of(size_t view_idx) const {
  std::vector<uint64_t> likeness(views_.size(), 0);
  std::vector<size_t> candidates;
  for (const size_t own : views_[view_idx]) {
    const auto add = [&](size_t idx, size_t weight) {
      const Entry& entry = entries_[idx];
      if (entry.view_idx == view_idx) return;
      if (likeness[entry.view_idx] == 0) candidates.push_back(entry.view_idx);
      likeness[entry.view_idx] += weight * std::min(entry.num_points, entries_[own].num_points);
    };
    const size_t begin = voxel_begins_[entries_[own].voxel_idx];
    const size_t end = voxel_begins_[entries_[own].voxel_idx + 1];
    const size_t near_begin = std::max(begin, own - std::min(own, kMaxViewsPerVoxel / 4));
    const size_t near_end = std::min(end, own + kMaxViewsPerVoxel / 4);
    const size_t stride = 1 + (end - begin - 1) / (kMaxViewsPerVoxel / 2);
    // Starts where `own` would be taken too, so that a pair is sampled by both of its views or
    // none.
    const size_t phase = (own - begin) % stride;
    for (size_t i = near_begin; i < near_end; ++i) add(i, 1);
    for (size_t i = begin + phase; i < end; i += stride) {
      if (i < near_begin || i >= near_end) add(i, stride);
    }
  }
  std::sort(candidates.begin(), candidates.end(), [&](size_t a, size_t b) {
    return likeness[a] != likeness[b] ? likeness[a] > likeness[b] : a < b;
  });
  return candidates;
}

}  // namespace vgtw
