// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/covisibility.h"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace vgtw {

// Views by the voxels that their points lie in, so that not all pairs need be measured. The edge of
// a point's voxel is a quarter of what fills the view's longer side there, up to a power of two;
// the next smaller and the next larger voxel count too, so that views share some if they see things
// at sizes that differ by less than about 8. The likeness of two views is the number of points in
// common voxels, summed over sizes: the pyramid match of Grauman and Darrell, "The Pyramid Match
// Kernel", 2005.
class PairCandidates {
 public:
  // Of a voxel that more views see, a view is compared with those next to it in the list and an
  // even sample of the others, which bounds the time where everybody sees everything.
  static constexpr size_t kMaxViewsPerVoxel = 1024;

  explicit PairCandidates(const Covisibility& covisibility);

  // Views that share voxels with a view: the likest first, of equals the first in the list.
  std::vector<size_t> Of(size_t view_idx) const;

 private:
  struct Entry {
    size_t voxel_idx;
    uint32_t view_idx;
    uint32_t num_points;
  };

  std::vector<Entry> entries_;        // by voxel, then view
  std::vector<size_t> voxel_begins_;  // index of a voxel's first entry; ends with their number
  std::vector<std::vector<size_t>> views_;  // indices of the entries of each view
};

}  // namespace vgtw
