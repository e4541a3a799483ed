// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/protocol_flags.h"

#include "plugin/table.h"

namespace vgtw {
namespace {

std::string FilterText(const ProtocolConditions& conditions) {
  return FormatNumber(conditions.keep_percent, 0) + " % most confident of " +
         (conditions.keep_scope == "all" ? "all views" : "each view") + " " +
         conditions.keep_order + " the distractor test at " +
         FormatNumber(conditions.mask_threshold, 2) + ", of the reference " +
         FormatNumber(conditions.reference_keep_percent, 0) + " %";
}

std::string CloudText(const ProtocolConditions& conditions) {
  std::string text = conditions.alignment == "none"
                         ? "prediction not aligned"
                         : "prediction Sim3-aligned (Umeyama) on " + conditions.alignment;
  if (conditions.icp != "none") {
    text += ", then " + conditions.icp + " ICP within " + FormatNumber(conditions.icp_distance, 3);
  }
  return text + "; " + FilterText(conditions);
}

std::string DepthText(const ProtocolConditions& conditions) {
  if (conditions.depth_method == "maps") {
    return "depth maps aligned by " + conditions.depth_alignment + ", " + FilterText(conditions);
  }
  return CloudText(conditions) + "; points of " +
         (conditions.depth_cloud == "all" ? "all views" : "each view") +
         " projected into the reference's views";
}

}  // namespace

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

std::string SamplingText(const ProtocolSampling& sampling) {
  return "up to " + std::to_string(sampling.num_images) + " " + sampling.test_images +
         " photos per scene, drawn by seed " + std::to_string(sampling.seed);
}

std::string ConditionsText(const ProtocolConditions& conditions, TablePart part) {
  switch (part) {
    case TablePart::kPoints:
      return "distances in scene units of the reference, " + CloudText(conditions) +
             "; normals of " + std::to_string(conditions.num_normal_neighbours) + " neighbours";
    case TablePart::kDepth:
      return DepthText(conditions) + ", mean over " + conditions.depth_mean;
    case TablePart::kPoses:
      return "RMSE in scene units of the reference and degrees, " +
             (conditions.pose_alignment == "none" ? "not aligned"
                                                  : conditions.pose_alignment + "-aligned") +
             "; RPE over " + std::to_string(conditions.rpe_delta) +
             (conditions.rpe_delta == 1 ? " step" : " steps") + " in the order of names";
    case TablePart::kMasks:
      break;
  }
  return "distractor probability from " + FormatNumber(conditions.mask_threshold, 2) +
         ", means over images";
}

}  // namespace vgtw
