// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/covisibility.h"
#include "matching/view_sketch.h"

#include <vector>

namespace vgtw {

struct PairSelectionOptions {
  CovisibilityOptions covisibility = {};
  // A pair is good if it shares so much, in [0, 1], under so large an angle, in [0, 180].
  double min_covisibility = 0.1;
  double min_angle_deg = 1.5;
  // Each view takes the good pairs of the highest covisibility, and of the rest those that differ
  // most from what it has: see SelectPairs. Both in [0, 100000].
  int num_best = 10;
  int num_diverse = 5;
  // The views of a good pair are at most so many chosen pairs away from each other; in [1, 100].
  int max_hops = 3;
  // Pairs that are measured per view, a half of them those that look best, the others spread over
  // the rest. Where fewer views see the same things, nothing is left out. In [2, 1000000].
  int max_candidates = 100;
  int num_threads = 0;  // 0 = all cores

  void Check() const;
};

// The pairs to match, by indices ascending. Chosen are
// - num_best good pairs of each view;
// - num_diverse more, one after the other those with the largest covisibility * (1 - the highest
//   covisibility of the other view with a view that is paired already): what the best ones, often
//   neighbours of one sequence, crowd out;
// - good pairs whose views are more than max_hops chosen pairs apart, the most covisible first:
//   loops are closed where a path comes back;
// - a maximum spanning forest, so that views are connected wherever measured pairs connect them.
//   It takes good pairs first, then pairs with too small an angle, then those that share too
//   little; such pairs are chosen only there. If measured pairs leave parts apart, what else shares
//   voxels with another part is measured too.
// The same for any number of threads. Time grows linearly with the number of views while the number
// of views that see the same things does not grow.
std::vector<ViewPair> SelectPairs(const std::vector<ViewSketch>& sketches,
                                  const PairSelectionOptions& options);

}  // namespace vgtw
