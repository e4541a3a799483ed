// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/dataset_scenes.h"
#include "bridge/protocol.h"

#include <cstdint>
#include <string>
#include <vector>

namespace vgtw {

struct DrawnImages {
  std::vector<std::string> test;   // sorted
  std::vector<std::string> clean;  // of the pseudo ground truth, sorted
};

// Every photo has a rank that depends on the seed and on its name without extension alone, so that
// copies of other sizes draw the same photos, and a photo that is added changes at most one. Test
// images are those of lowest rank
//   "clean", "clutter"  of that kind
//   "mixed"             of both, but at least `min_shared_images` (if there are) are clean: what
//   the
//                       prediction and the pseudo ground truth have in common aligns them
// Clean images are those of lowest rank, or all; the test images among them always.
DrawnImages DrawImages(const std::vector<std::string>& clean,
                       const std::vector<std::string>& clutter,
                       const ProtocolSampling& sampling);

// The scenes with their draws. Throws Error if a scene has fewer than 2 photos to draw from.
std::vector<ProtocolScene> MakeProtocolScenes(const std::vector<DatasetScene>& scenes,
                                              const ProtocolSampling& sampling);

}  // namespace vgtw
