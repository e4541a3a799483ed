// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "network/distractor_losses.h"

namespace vgtw {

// ComputeFeatureLosses as one writes it down, by automatic differentiation: similarities to the
// neighbours in every other view are kept, with the features that they are made of. The mean needs
// tokens of both kinds.
FeatureLosses NaiveLosses(const at::Tensor& features,
                          const TokenLabels& labels,
                          const FeatureLossOptions& options = {});

}  // namespace vgtw
