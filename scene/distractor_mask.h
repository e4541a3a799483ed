// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/grid.h"
#include "scene/view.h"

#include <cstdint>

namespace vgtw {

// Probability that a pixel shows a distractor, in [0,1] (1 = distractor); NaN = unknown.
// [H,W] in network pixels.
using DistractorMask = Grid<float>;

// COLMAP's mask of an image: 0 = excluded, 255 = kept, [H,W] in original pixels.
using StaticMask = Grid<uint8_t>;

enum class UnknownPolicy { kKeep, kExclude };

struct StaticMaskOptions {
  // A pixel is excluded where the distractor probability, upsampled bilinearly to original pixels,
  // reaches this value; in (0, 1].
  double threshold = 0.5;
  // Grows (positive) the excluded area by a disc of this radius, in original pixels. SIFT looks
  // around a keypoint, so a margin keeps distractor texture out of descriptors. >= 0.
  int dilate_px = 7;
  // Shrinks the excluded area by a disc of this radius before it is grown (removes specks), but not
  // from the image border or the unknown area. >= 0.
  int erode_px = 0;
  // Excluded areas (8-connected) smaller than this many original pixels are kept. >= 0.
  int min_area_px = 0;
  // Static holes (4-connected) inside an excluded area smaller than this many pixels are excluded;
  // a gap that touches the image border is no hole. >= 0.
  int fill_holes_px = 0;
  // What becomes of pixels that the network never saw (crop, unknown probability). kKeep keeps them
  // unless a distractor beside them is dilated into them.
  UnknownPolicy unknown = UnknownPolicy::kKeep;

  void Check() const;
};

// The mask that COLMAP reads, of size view.camera.width x height: threshold of the upsampled
// probability, then erode, min area, fill holes, dilate, then the unknown area.
// Throws std::invalid_argument if the probability's size is not the view's network size.
StaticMask MakeStaticMask(const View& view,
                          const DistractorMask& distractor,
                          const StaticMaskOptions& options);

// COLMAP's test of a keypoint: value at (floor(x), floor(y)); outside the mask is excluded.
bool IsExcluded(const StaticMask& static_mask, double x, double y);

// Distance in pixels from the centre of each pixel to that of the nearest excluded one: 0 where
// excluded, infinite if nothing is. `<= radius` is MakeStaticMask's dilation by a disc.
Grid<float> DistanceToExcluded(const StaticMask& static_mask);

// Share of excluded pixels, in [0,1].
double ExcludedShare(const StaticMask& static_mask);

}  // namespace vgtw
