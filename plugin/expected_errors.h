// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "plugin/flags.h"

namespace vgtw {

// Standard deviations of the errors of predictions, as people state them.
struct ExpectedErrors {
  double rotation_deg = 1.0;  // between two photos
  // Of the vector between two centres, percent of ErrorUnit (plugin/static_views.h).
  double centre_percent = 2.0;
  double focal_percent = 3.0;
  double depth_percent = 6.0;  // of a pixel
};

// The flags --expected_*, which several commands share.
void AddExpectedErrors(Flags& flags, ExpectedErrors& errors);

}  // namespace vgtw
