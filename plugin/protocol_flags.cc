// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/protocol_flags.h"

#include "plugin/table.h"

namespace vgtw {

void AddConditionFlags(Flags& flags, ProtocolConditions& conditions) {
  flags.Group("Conditions")
      .Add("keep_percent",
           &conditions.keep_percent,
           "Share of a prediction's depths kept, the most confident ones, percent")
      .Add("reference_keep_percent",
           &conditions.reference_keep_percent,
           "The same of the pseudo ground truth")
      .AddChoice("keep_scope",
                 &conditions.keep_scope,
                 {"all", "view"},
                 "These are shares of all views together or of each view")
      .AddChoice("keep_order",
                 &conditions.keep_order,
                 {"before", "after"},
                 "They are taken before distractors are left out, or after")
      .Add("mask_threshold",
           &conditions.mask_threshold,
           "Distractor probability from which a pixel is left out, in (0,1]")
      .AddChoice("alignment",
                 &conditions.alignment,
                 {"pixels", "cameras", "dataset_cameras", "auto", "none"},
                 "Umeyama on pixels or cameras of photos that prediction and reference have in "
                 "common, or of each to the data set's cameras, which needs no common photo")
      .AddChoice("icp",
                 &conditions.icp,
                 {"none", "rigid", "similarity"},
                 "Then iterative closest points, with or without scale")
      .Add("icp_distance",
           &conditions.icp_distance,
           "Pairs farther apart do not count in ICP, scene units of the reference")
      .Add("normal_neighbours",
           &conditions.num_normal_neighbours,
           "Nearest points that a normal is taken from, the point itself among them")
      .AddChoice("depth_method",
                 &conditions.depth_method,
                 {"reprojection", "maps"},
                 "Depths of the aligned cloud in the reference's views, or maps as they are")
      .AddChoice("cloud",
                 &conditions.depth_cloud,
                 {"all", "own"},
                 "Reprojected into a view: the points of all views, or its own")
      .AddChoice("depth_alignment",
                 &conditions.depth_alignment,
                 {"median", "scale", "scale_shift", "none"},
                 "How depth maps are brought to the reference's scale, a fit per view")
      .AddChoice("depth_mean",
                 &conditions.depth_mean,
                 {"pixels", "views"},
                 "AbsRel and delta are means over all pixels or over the views' means")
      .AddChoice("pose_alignment",
                 &conditions.pose_alignment,
                 {"sim3", "se3", "first", "none"},
                 "Alignment of camera centres for ATE and RPE")
      .Add("rpe_delta",
           &conditions.rpe_delta,
           "Step from the first to the second view of a pair of the RPE, in the order of names");
}

std::string ConditionsText(const ProtocolConditions& conditions) {
  std::string text =
      "prediction " + (conditions.alignment == "none" ? std::string("not aligned")
                                                      : "Sim3-aligned on " + conditions.alignment);
  if (conditions.icp != "none") {
    text += ", then " + conditions.icp + " ICP within " + FormatNumber(conditions.icp_distance, 3);
  }
  text += "; " + FormatNumber(conditions.keep_percent, 0) + " % most confident of " +
          (conditions.keep_scope == "all" ? "all views" : "each view") + " " +
          conditions.keep_order + " the distractor test at " +
          FormatNumber(conditions.mask_threshold, 2) + ", reference " +
          FormatNumber(conditions.reference_keep_percent, 0) + " %; normals of " +
          std::to_string(conditions.num_normal_neighbours) + " neighbours; depth by " +
          conditions.depth_method;
  text += conditions.depth_method == "maps" ? " (" + conditions.depth_alignment + ")"
                                            : " of " + conditions.depth_cloud + " points";
  return text + ", mean over " + conditions.depth_mean + "; poses " +
         (conditions.pose_alignment == "none" ? "not aligned"
                                              : conditions.pose_alignment + "-aligned") +
         ", RPE over " + std::to_string(conditions.rpe_delta) +
         (conditions.rpe_delta == 1 ? " step" : " steps") + " in the order of names";
}

}  // namespace vgtw
