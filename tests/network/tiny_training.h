// SPDX-License-Identifier: BSD-3-Clause
// Networks and runs small enough to train in tests.
#pragma once

#include "network/identify.h"
#include "network/train.h"

namespace vgtw {

// Four layers of 16 channels without an encoder; no LoRA, no distractor head, no point head.
VggtConfig TrainableSizes();
NetworkDescription TrainableNetwork();

// Two views of 42 x 28 pixels a sample, two samples a step, one thread.
TrainOptions ShortRun(bool lora_only);

}  // namespace vgtw
