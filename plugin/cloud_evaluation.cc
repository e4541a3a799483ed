// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/cloud_evaluation.h"

#include "evaluation/voxel_mean.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <utility>
#include <vector>

namespace vgtw {
namespace {

using Points = std::vector<Eigen::Vector3d>;

IcpResult RefineByIcp(CloudSource& prediction,
                      CloudSource& reference,
                      const Sim3d& guess,
                      const IcpOptions& options) {
  const PointTree source(prediction.Points(), options.num_threads);
  const PointTree target(reference.Points(), options.num_threads);
  const auto result = AlignByIcp(source, target, guess, options);
  if (!result) {
    Fail(prediction.path(),
         "has no points within " + FormatNumber(options.max_distance, 4) +
             " of the reference that determine a motion",
         "clouds that nearly meet",
         "give a larger --icp_distance or another --alignment");
  }
  return *result;
}

Points InVoxels(Points points, double voxel_size) {
  return voxel_size != 0.0 ? MeanInVoxels(points, voxel_size) : points;
}

}  // namespace

CloudEvaluation EvaluateClouds(CloudSource& prediction,
                               CloudSource& reference,
                               const CloudAlignment& alignment,
                               const CloudEvaluationOptions& options) {
  CloudEvaluation evaluation;
  evaluation.alignment = alignment;
  Sim3d motion = alignment.reference_from_prediction;
  if (options.use_icp) {
    evaluation.icp = RefineByIcp(prediction, reference, motion, options.icp);
    motion = evaluation.icp->target_from_source;
  }
  evaluation.error = CompareClouds(InVoxels(Moved(motion, prediction.Points()), options.voxel_size),
                                   InVoxels(reference.Points(), options.voxel_size),
                                   options.error);
  return evaluation;
}

}  // namespace vgtw
