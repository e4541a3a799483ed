// SPDX-License-Identifier: BSD-3-Clause
#include "scene/mask_vote.h"

#include "scene/error.h"
#include "scene/parallel.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>
#include <utility>

namespace vgtw {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// sigma of a normal distribution by the median of its absolute values.
constexpr double kSigmaOfMedian = 1.4826;

bool IsKnown(float depth) { return std::isfinite(depth) && depth > 0.0f; }

struct DepthRange {
  float nearest = std::numeric_limits<float>::infinity();
  float farthest = 0.0f;
};

DepthRange RangeOf3x3(const DepthMap& depth, int x, int y) {
  DepthRange range;
  for (int v = std::max(y - 1, 0); v <= std::min(y + 1, depth.height() - 1); ++v) {
    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, depth.width() - 1); ++u) {
      if (!IsKnown(depth(u, v))) continue;
      range.nearest = std::min(range.nearest, depth(u, v));
      range.farthest = std::max(range.farthest, depth(u, v));
    }
  }
  return range;
}

// Smallest known depth among up to `reach` elements to both sides of each, one row or column.
void ReachMin(const float* in, float* out, int size, size_t step, int reach) {
  for (int i = 0; i < size; ++i) {
    float min = std::numeric_limits<float>::infinity();
    for (int k = std::max(i - reach, 0); k <= std::min(i + reach, size - 1); ++k) {
      const float depth = in[static_cast<size_t>(k) * step];
      if (IsKnown(depth)) min = std::min(min, depth);
    }
    out[static_cast<size_t>(i) * step] = min;
  }
}

DepthMap NearestAround(const DepthMap& depth, int reach) {
  DepthMap of_rows(depth.width(), depth.height());
  DepthMap nearest(depth.width(), depth.height());
  for (int y = 0; y < depth.height(); ++y) {
    ReachMin(&depth(0, y), &of_rows(0, y), depth.width(), 1, reach);
  }
  for (int x = 0; x < depth.width(); ++x) {
    ReachMin(
        &of_rows(x, 0), &nearest(x, 0), depth.height(), static_cast<size_t>(depth.width()), reach);
  }
  for (size_t i = 0; i < depth.size(); ++i) {
    if (!IsKnown(depth.data()[i])) nearest.data()[i] = kNaN;
  }
  return nearest;
}

constexpr VoteView::Sighting kUnseen = {kNaN, kNaN, false};

// A pixel on which others may vote.
struct Sample {
  int x = 0;
  int y = 0;
  Eigen::Vector3d point_in_world;
};

std::vector<Sample> TakeSamples(const VoteView& view, int stride) {
  std::vector<Sample> samples;
  for (int y = 0; y < view.depth().height(); y += stride) {
    for (int x = 0; x < view.depth().width(); x += stride) {
      if (view.IsDepthEdge(x, y)) continue;
      const auto point = UnprojectPixel(view.view(), view.depth(), x, y);
      if (point) samples.push_back({x, y, *point});
    }
  }
  return samples;
}

std::vector<VoteView::Sighting> SeeAll(const std::vector<Sample>& samples,
                                       const VoteView& voter,
                                       int num_threads) {
  constexpr size_t kChunk = 16384;
  std::vector<VoteView::Sighting> sightings(samples.size());
  const size_t num_chunks = (samples.size() + kChunk - 1) / kChunk;
  ParallelFor(static_cast<int64_t>(num_chunks), num_threads, [&](int64_t chunk) {
    const size_t begin = static_cast<size_t>(chunk) * kChunk;
    const size_t end = std::min(begin + kChunk, samples.size());
    for (size_t i = begin; i < end; ++i) {
      sightings[i] = voter.See(samples[i].point_in_world).value_or(kUnseen);
    }
  });
  return sightings;
}

// tau between a view and a voter.
double FindTolerance(const VoteView& view,
                     const std::vector<Sample>& samples,
                     const std::vector<VoteView::Sighting>& sightings,
                     const MaskVoteOptions& options) {
  std::vector<double> sizes;
  for (size_t i = 0; i < samples.size(); ++i) {
    const VoteView::Sighting& sighting = sightings[i];
    if (std::isnan(sighting.residual) || !sighting.is_static) continue;
    if (!view.IsMasked(samples[i].x, samples[i].y)) sizes.push_back(std::abs(sighting.residual));
  }
  if (sizes.empty()) return options.max_relative_depth_difference;
  const double sigma = kSigmaOfMedian * Median(std::move(sizes));
  return std::max(options.max_relative_depth_difference, options.noise_factor * sigma);
}

// Sums of the values 0 or 1 over squares around each pixel, cut off at the border.
class WindowCounts {
 public:
  WindowCounts(int width, int height) : sums_(width + 1, height + 1) {}

  // In row order.
  void Set(int x, int y, bool value) {
    sums_(x + 1, y + 1) = (value ? 1u : 0u) + sums_(x, y + 1) + sums_(x + 1, y) - sums_(x, y);
  }
  // Whether more than half of the pixels within `reach` have a 1.
  bool HasMajority(int x, int y, int reach) const {
    const int left = std::max(x - reach, 0);
    const int top = std::max(y - reach, 0);
    const int right = std::min(x + reach + 1, sums_.width() - 1);
    const int bottom = std::min(y + reach + 1, sums_.height() - 1);
    const uint32_t count =
        sums_(right, bottom) - sums_(left, bottom) - sums_(right, top) + sums_(left, top);
    return 2u * count > static_cast<uint32_t>((right - left) * (bottom - top));
  }

 private:
  Grid<uint32_t> sums_;
};

Eigen::Vector3d ViewingDirection(const View& view) {
  return view.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ();
}

}  // namespace

void MaskVoteOptions::Check() const {
  const auto check = [](bool is_valid, const char* name, double value, const char* bounds) {
    VGTW_CHECK(is_valid,
               std::string("MaskVoteOptions::") + name + " = " + std::to_string(value) +
                   ", must be in " + bounds);
  };
  const auto is_within = [](double value, double min, double max) {
    return value >= min && value <= max;
  };
  check(distractor_threshold > 0.0 && distractor_threshold <= 1.0,
        "distractor_threshold",
        distractor_threshold,
        "(0, 1]");
  check(max_relative_depth_difference > 0.0 && max_relative_depth_difference < 1.0,
        "max_relative_depth_difference",
        max_relative_depth_difference,
        "(0, 1)");
  check(is_within(noise_factor, 0.0, 100.0), "noise_factor", noise_factor, "[0, 100]");
  check(max_relative_step > 0.0 && max_relative_step <= 10.0,
        "max_relative_step",
        max_relative_step,
        "(0, 10]");
  check(is_within(position_error_px, 0, 1000), "position_error_px", position_error_px, "[0, 1000]");
  check(is_within(min_consistent, 1, 1000), "min_consistent", min_consistent, "[1, 1000]");
  check(max_see_through_share >= 0.0 && max_see_through_share < 1.0,
        "max_see_through_share",
        max_see_through_share,
        "[0, 1)");
  check(is_within(min_see_through, 1, 1000), "min_see_through", min_see_through, "[1, 1000]");
  check(is_within(window_px, 1, 1001) && window_px % 2 == 1,
        "window_px",
        window_px,
        "1, 3, ... 1001");
  check(is_within(min_see_through_masked_share, 0.0, 1.0),
        "min_see_through_masked_share",
        min_see_through_masked_share,
        "[0, 1]");
  check(is_within(max_views, 1, 1000), "max_views", max_views, "[1, 1000]");
}

VoteView::VoteView(const ViewPrediction& prediction, const MaskVoteOptions& options)
    : view_(prediction.view),
      network_from_original_(Inverse(prediction.view.original_from_network)),
      depth_(prediction.depth.empty() ? DepthFromPoints(prediction.view, prediction.points)
                                      : prediction.depth),
      nearest_(depth_.width(), depth_.height(), kNaN),
      farthest_(depth_.width(), depth_.height(), kNaN),
      nearest_around_(NearestAround(depth_, options.position_error_px)),
      mask_(view_.network_width, view_.network_height, MaskState::kStatic) {
  options.Check();
  for (int y = 0; y < depth_.height(); ++y) {
    for (int x = 0; x < depth_.width(); ++x) {
      if (!IsKnown(depth_(x, y))) continue;
      const DepthRange range = RangeOf3x3(depth_, x, y);
      if (range.farthest > (1.0 + options.max_relative_step) * range.nearest) continue;
      nearest_(x, y) = range.nearest;
      farthest_(x, y) = range.farthest;
    }
  }
  for (size_t i = 0; i < prediction.distractor.size(); ++i) {
    const float probability = prediction.distractor.data()[i];
    mask_.data()[i] = std::isnan(probability)                       ? MaskState::kUnknown
                      : probability >= options.distractor_threshold ? MaskState::kMasked
                                                                    : MaskState::kStatic;
  }
}

bool VoteView::IsDepthEdge(int x, int y) const { return std::isnan(nearest_(x, y)); }

std::optional<VoteView::Sighting> VoteView::See(const Eigen::Vector3d& point_in_world) const {
  const Eigen::Vector3d point_in_cam = view_.cam_from_world * point_in_world;
  const std::optional<Eigen::Vector2d> original = Project(view_.camera, point_in_cam);
  if (!original) return std::nullopt;
  const Eigen::Vector2d pixel = Apply(network_from_original_, *original);
  if (!(pixel.x() >= 0.0 && pixel.x() < depth_.width() && pixel.y() >= 0.0 &&
        pixel.y() < depth_.height())) {
    return std::nullopt;
  }
  const int x = static_cast<int>(pixel.x());
  const int y = static_cast<int>(pixel.y());
  const double z = point_in_cam.z();
  const double closest = std::clamp<double>(z, nearest_(x, y), farthest_(x, y));
  return Sighting{static_cast<float>(std::isnan(nearest_(x, y)) ? kNaN : (closest - z) / z),
                  static_cast<float>((nearest_around_(x, y) - z) / z),
                  mask_(x, y) == MaskState::kStatic};
}

Votes CountVotes(const VoteView& view,
                 const std::vector<const VoteView*>& others,
                 const MaskVoteOptions& options,
                 int num_threads,
                 int stride) {
  VGTW_CHECK(stride >= 1, "the stride is at least 1");
  const int width = view.view().network_width;
  const int height = view.view().network_height;
  Votes votes = {Grid<uint16_t>(width, height), Grid<uint16_t>(width, height)};
  if (view.depth().empty()) return votes;
  const std::vector<Sample> samples = TakeSamples(view, stride);
  for (const VoteView* other : others) {
    const std::vector<VoteView::Sighting> sightings = SeeAll(samples, *other, num_threads);
    const double tolerance = FindTolerance(view, samples, sightings, options);
    for (size_t i = 0; i < samples.size(); ++i) {
      const auto& [x, y, point] = samples[i];
      if (sightings[i].clearance > tolerance) {
        ++votes.num_see_through(x, y);
      } else if (std::abs(sightings[i].residual) <= tolerance && sightings[i].is_static) {
        ++votes.num_consistent(x, y);
      }
    }
  }
  return votes;
}

Verdict Judge(int num_consistent, int num_see_through, const MaskVoteOptions& options) {
  if (num_see_through >= options.min_see_through && num_see_through > num_consistent) {
    return Verdict::kDistractor;
  }
  if (num_consistent >= options.min_consistent &&
      num_see_through <= options.max_see_through_share * (num_consistent + num_see_through)) {
    return Verdict::kStatic;
  }
  return Verdict::kNone;
}

MaskedVerdicts& MaskedVerdicts::operator+=(const MaskedVerdicts& other) {
  num_static += other.num_static;
  num_distractor += other.num_distractor;
  return *this;
}

MaskedVerdicts JudgeMasked(const VoteView& view,
                           const Votes& votes,
                           const MaskVoteOptions& options) {
  MaskedVerdicts verdicts;
  for (int y = 0; y < votes.num_consistent.height(); ++y) {
    for (int x = 0; x < votes.num_consistent.width(); ++x) {
      if (!view.IsMasked(x, y)) continue;
      const Verdict verdict =
          Judge(votes.num_consistent(x, y), votes.num_see_through(x, y), options);
      verdicts.num_static += verdict == Verdict::kStatic;
      verdicts.num_distractor += verdict == Verdict::kDistractor;
    }
  }
  return verdicts;
}

bool MayRelease(const MaskedVerdicts& verdicts, const MaskVoteOptions& options) {
  const double num_verdicts = static_cast<double>(verdicts.num_static + verdicts.num_distractor);
  return static_cast<double>(verdicts.num_distractor) >=
         options.min_see_through_masked_share * num_verdicts;
}

MaskChanges ApplyVotes(const Votes& votes,
                       const MaskVoteOptions& options,
                       bool may_release,
                       DistractorMask& distractor) {
  const int width = votes.num_consistent.width();
  const int height = votes.num_consistent.height();
  if (distractor.empty()) distractor = DistractorMask(width, height, 0.0f);
  VGTW_CHECK(distractor.width() == width && distractor.height() == height,
             "the mask is of the votes' size");
  WindowCounts is_static(width, height);
  WindowCounts is_distractor(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Verdict verdict =
          Judge(votes.num_consistent(x, y), votes.num_see_through(x, y), options);
      is_static.Set(x, y, verdict == Verdict::kStatic);
      is_distractor.Set(x, y, verdict == Verdict::kDistractor);
    }
  }
  MaskChanges changes;
  const int reach = options.window_px / 2;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      float& probability = distractor(x, y);
      if (probability >= options.distractor_threshold) {
        if (!may_release || !is_static.HasMajority(x, y, reach)) continue;
        probability = 0.0f;
        ++changes.num_released;
      } else if (is_distractor.HasMajority(x, y, reach)) {
        probability = 1.0f;
        ++changes.num_added;
      }
    }
  }
  return changes;
}

std::vector<size_t> SelectVoters(const std::vector<View>& views,
                                 size_t idx,
                                 double scene_depth,
                                 int max_views) {
  VGTW_CHECK(idx < views.size() && scene_depth > 0.0, "a view and its depth");
  const Eigen::Vector3d centre = OriginInSource(views[idx].cam_from_world);
  const Eigen::Vector3d direction = ViewingDirection(views[idx]);
  std::vector<std::pair<double, size_t>> candidates;
  for (size_t i = 0; i < views.size(); ++i) {
    if (i == idx) continue;
    const double distance = (OriginInSource(views[i].cam_from_world) - centre).norm();
    const double cosine = std::clamp(direction.dot(ViewingDirection(views[i])), -1.0, 1.0);
    candidates.emplace_back(distance / scene_depth + std::acos(cosine), i);
  }
  const size_t num_voters = std::min(candidates.size(), static_cast<size_t>(max_views));
  std::partial_sort(candidates.begin(),
                    candidates.begin() + static_cast<std::ptrdiff_t>(num_voters),
                    candidates.end());
  std::vector<size_t> voters;
  for (size_t i = 0; i < num_voters; ++i) voters.push_back(candidates[i].second);
  std::sort(voters.begin(), voters.end());
  return voters;
}

std::optional<double> MedianDepth(const DepthMap& depth) {
  std::vector<double> known;
  std::copy_if(depth.data().begin(), depth.data().end(), std::back_inserter(known), IsKnown);
  if (known.empty()) return std::nullopt;
  return Median(std::move(known));
}

}  // namespace vgtw
