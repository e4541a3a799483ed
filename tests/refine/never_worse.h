// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace vgtw {

// Refines random problems (random_problem.h) and expects of each: what was held out is explained no
// worse, both models obey their law, unusable views and no others are missing, views that are not
// refined say why and are bit by bit the seed's, and so are cameras without a refined view. Prints
// how many ended nearer to the truth, which no refinement can know.
void CheckNeverWorse(uint64_t first_number, uint64_t num_problems);

}  // namespace vgtw
