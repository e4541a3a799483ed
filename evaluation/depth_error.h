// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace vgtw {

// Depths of the same pixels, all > 0 and finite.
struct DepthPairs {
  std::vector<double> predicted;
  std::vector<double> expected;
};

// How predicted depths are brought to the scale of the expected ones.
enum class DepthAlignment {
  kNone,
  kMedian,     // median of the expected / median of the predicted (DUSt3R, MonST3R)
  kScale,      // least sum of absolute differences by 10 reweighted least squares (MonST3R, pi3)
  kScaleShift  // least sum of absolute differences over scale and shift, exact
};

// aligned = scale * predicted + shift
struct DepthFit {
  double scale = 1.0;
  double shift = 0.0;
};

// Law: predictions multiplied by a number give a fit divided by it. The last kind goes from line to
// line through two of the points until none next to it is better (Wesolowsky, "A new descent
// algorithm for the least absolute value regression problem", 1981); peers approach it by gradient
// descent. Returns nullopt without pairs and, for kScaleShift, if all predictions are equal.
std::optional<DepthFit> FitDepth(const DepthPairs& pairs, DepthAlignment alignment);

// Sums over pixels; views are pooled by adding them.
struct DepthError {
  size_t num_pixels = 0;
  double sum_abs_rel = 0.0;  // of |aligned - expected| / expected
  size_t num_within = 0;     // with max(aligned / expected, expected / aligned) < 1.25

  double AbsRel() const;         // mean; NaN without pixels
  double WithinPercent() const;  // "delta < 1.25"; NaN without pixels
  DepthError& operator+=(const DepthError& other);
};

// An aligned depth that is not positive is not within.
DepthError CompareDepths(const DepthPairs& pairs, const DepthFit& fit);

}  // namespace vgtw
