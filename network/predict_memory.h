// SPDX-License-Identifier: BSD-3-Clause
// How many views fit into memory at once.
#pragma once

#include "network/identify.h"

#include <cstdint>

namespace vgtw {

// What a pass over S views of width x height pixels holds at its peak, S * per_view + fixed bytes,
// in float32 and apart from the weights.
//   per view  the tokens of the layers that the heads read, those of the layer at hand, and the
//             widest moment of a transformer block: 15 times its tokens
//   fixed     one view in a dense head, whose maps are as large as the image
// An upper bound: VGTW at 518 x 392 takes 87 MiB a view and 720 MiB in a head, of 109 and 890 here.
struct MemoryEstimate {
  int64_t per_view = 0;
  int64_t fixed = 0;
};
MemoryEstimate EstimateMemory(const NetworkDescription& description, int width, int height);

}  // namespace vgtw
