// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/expected_errors.h"

namespace vgtw {

void AddExpectedErrors(Flags& flags, ExpectedErrors& errors) {
  flags.Group("Errors to expect of predictions (standard deviations)")
      .Add("expected_rotation_deg", &errors.rotation_deg, "Rotation between two photos, degrees")
      .Add("expected_centre_percent",
           &errors.centre_percent,
           "Vector between two centres, percent of the cameras' extent or of the middle depth, "
           "whichever is less")
      .Add("expected_focal_percent", &errors.focal_percent, "Focal length, percent")
      .Add("expected_depth_percent", &errors.depth_percent, "Depth of a pixel, percent");
}

}  // namespace vgtw
