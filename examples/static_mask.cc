// SPDX-License-Identifier: BSD-3-Clause
// How a network's distractor probability becomes the mask that COLMAP reads.
//
// A photo of 16 x 12 pixels went into the network at half its size. There, a distractor covers the
// 2 x 2 pixels from (3, 2) on, and nothing is known of the last column (a crop, say). The mask has
// the photo's size; '#' is excluded (0), '.' kept (255). Dilation adds a margin, because a feature
// descriptor looks around its keypoint. A pixel whose interpolation touches the unknown is unknown.
#include "scene/distractor_mask.h"
#include "scene/view.h"

#include <cmath>
#include <cstdio>

namespace {

vgtw::View MakeView() {
  vgtw::View view;
  view.name = "photo.png";
  view.camera.model = vgtw::CameraModel::kPinhole;
  view.camera.width = 16;
  view.camera.height = 12;
  view.camera.params = {20.0, 20.0, 8.0, 6.0};
  view.network_width = 8;
  view.network_height = 6;
  view.original_from_network << 2.0, 0.0, 0.0, 0.0, 2.0, 0.0;
  return view;
}

vgtw::DistractorMask MakeDistractor() {
  vgtw::DistractorMask distractor(8, 6, 0.0f);
  for (int y = 2; y < 4; ++y) {
    for (int x = 3; x < 5; ++x) distractor(x, y) = 1.0f;
  }
  for (int y = 0; y < 6; ++y) distractor(7, y) = std::nanf("");
  return distractor;
}

void Print(const char* title, const vgtw::StaticMask& static_mask) {
  std::printf("%s: %.1f %% excluded\n", title, 100.0 * vgtw::ExcludedShare(static_mask));
  for (int y = 0; y < static_mask.height(); ++y) {
    for (int x = 0; x < static_mask.width(); ++x) {
      std::putchar(static_mask(x, y) == 0 ? '#' : '.');
    }
    std::putchar('\n');
  }
}

}  // namespace

int main() {
  const vgtw::View view = MakeView();
  const vgtw::DistractorMask distractor = MakeDistractor();
  vgtw::StaticMaskOptions options;
  options.dilate_px = 0;
  Print("threshold 0.5", vgtw::MakeStaticMask(view, distractor, options));
  options.dilate_px = 2;
  Print("dilated by 2 pixels", vgtw::MakeStaticMask(view, distractor, options));
  options.unknown = vgtw::UnknownPolicy::kExclude;
  Print("unknown excluded, too", vgtw::MakeStaticMask(view, distractor, options));
  return 0;
}
