// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/mask_flags.h"

namespace vgtw {

void MaskFlags::Declare(Flags& flags) {
  flags.Group("Masks")
      .Add("mask_threshold",
           &options_.threshold,
           "Distractor probability from which a pixel is excluded, in (0,1]")
      .Add("dilate_px",
           &options_.dilate_px,
           "Margin around distractors in original pixels, since features look around themselves")
      .Add("erode_px", &options_.erode_px, "Shrink excluded areas first (removes specks), pixels")
      .Add("min_area_px", &options_.min_area_px, "Keep excluded areas smaller than this, pixels")
      .Add("fill_holes_px", &options_.fill_holes_px, "Exclude holes smaller than this, pixels")
      .AddChoice(
          "unknown", &unknown_, {"keep", "exclude"}, "Pixels that the network never saw (crop)");
}

StaticMaskOptions MaskFlags::Options() const {
  StaticMaskOptions options = options_;
  options.unknown = unknown_ == "keep" ? UnknownPolicy::kKeep : UnknownPolicy::kExclude;
  options.Check();
  return options;
}

}  // namespace vgtw
