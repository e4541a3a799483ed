// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/cloud_error.h"
#include "evaluation/icp.h"
#include "evaluation/voxel_mean.h"
#include "plugin/cloud_source.h"
#include "plugin/commands.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <memory>

namespace vgtw {
namespace {

using Points = std::vector<Eigen::Vector3d>;
using nlohmann::json;

json AsJson(const DirectedCloudError& error) {
  return {{"num_points", error.num_points},
          {"num_clipped", error.num_clipped},
          {"mean", error.mean},
          {"median", error.median},
          {"within_f_distance_percent", 100.0 * error.share_within_f_distance},
          {"num_normals", error.num_normals},
          {"normal_mean", error.normal_mean},
          {"normal_median", error.normal_median}};
}

struct EvaluatePointsCommand {
  CloudSourceFlags sources;
  std::string icp = "none";
  IcpOptions icp_options;
  double voxel_size = 0.0;
  CloudErrorOptions options;
  Usability usability;

  struct Evaluation {
    CloudAlignment alignment;
    std::optional<IcpResult> icp;
    std::string filter_text;
    std::string reference_filter_text;
    CloudError error;
  };

  void Run() {
    Apply(usability);
    sources.Resolve(usability.num_threads);
    options.num_threads = icp_options.num_threads = usability.num_threads;
    icp_options.with_scale = icp == "similarity";
    options.Check();
    icp_options.Check();
    CloudSource prediction(sources.input_path, sources.filter);
    CloudSource reference(sources.reference_path, sources.reference_filter);
    Evaluation evaluation;
    evaluation.alignment = AlignClouds(prediction, reference, sources.alignment);
    Sim3d motion = evaluation.alignment.reference_from_prediction;
    if (icp != "none") {
      evaluation.icp = RefineByIcp(prediction, reference, motion);
      motion = evaluation.icp->target_from_source;
    }
    evaluation.filter_text = prediction.FilterText();
    evaluation.reference_filter_text = reference.FilterText();
    evaluation.error = CompareClouds(
        InVoxels(Moved(motion, prediction.Points())), InVoxels(reference.Points()), options);
    json result = Json(evaluation);
    result["filter"] = prediction.FilterAsJson();
    result["reference_filter"] = reference.FilterAsJson();
    Finish(usability, Text(evaluation), result);
  }

  IcpResult RefineByIcp(CloudSource& prediction, CloudSource& reference, const Sim3d& guess) {
    const PointTree source(prediction.Points(), usability.num_threads);
    const PointTree target(reference.Points(), usability.num_threads);
    const auto result = AlignByIcp(source, target, guess, icp_options);
    if (!result) {
      Fail(prediction.path(),
           "has no points within " + FormatNumber(icp_options.max_distance, 4) +
               " of the reference that determine a motion",
           "clouds that nearly meet",
           "give a larger --icp_distance or another --alignment");
    }
    return *result;
  }

  Points InVoxels(Points points) const {
    return voxel_size != 0.0 ? MeanInVoxels(points, voxel_size) : points;
  }

  std::string Text(const Evaluation& evaluation) const {
    const CloudError& error = evaluation.error;
    const DirectedCloudError& accuracy = error.accuracy;
    const DirectedCloudError& completeness = error.completeness;
    const auto row = [](std::string title, double acc, double comp, double both, int digits) {
      return std::vector<std::string>{std::move(title),
                                      FormatNumber(acc, digits),
                                      FormatNumber(comp, digits),
                                      FormatNumber(both, digits)};
    };
    const std::string f_distance = FormatNumber(options.f_distance, 4);
    std::string text = FormatTable({
        {"", "accuracy", "completeness", "overall"},
        row("distance, mean", accuracy.mean, completeness.mean, error.Overall(), 5),
        row("distance, median",
            accuracy.median,
            completeness.median,
            0.5 * (accuracy.median + completeness.median),
            5),
        row("within " + f_distance + ", % (precision, recall, F)",
            100.0 * accuracy.share_within_f_distance,
            100.0 * completeness.share_within_f_distance,
            100.0 * error.F(),
            2),
        row("normal consistency, mean (NC1, NC2, NC)",
            accuracy.normal_mean,
            completeness.normal_mean,
            error.NormalConsistencyMean(),
            4),
        row("normal consistency, median",
            accuracy.normal_median,
            completeness.normal_median,
            error.NormalConsistencyMedian(),
            4),
        {"points",
         std::to_string(accuracy.num_points),
         std::to_string(completeness.num_points),
         ""},
    });
    return text + Conditions(evaluation);
  }

  // What the numbers hold under.
  std::string Conditions(const Evaluation& evaluation) const {
    std::string text = "distances in scene units of the reference; prediction " +
                       AlignmentText(evaluation.alignment) + ", scale " +
                       FormatNumber(evaluation.alignment.reference_from_prediction.scale, 6);
    if (evaluation.icp) {
      text += ", then " + icp + " ICP within " + FormatNumber(icp_options.max_distance, 4) + " (" +
              std::to_string(evaluation.icp->num_iterations) + " iterations" +
              (evaluation.icp->converged ? "" : ", not converged") + ", RMSE " +
              FormatNumber(evaluation.icp->rmse, 5) + ", scale " +
              FormatNumber(evaluation.icp->target_from_source.scale, 6) + ")";
    }
    text += "\nprediction: " + evaluation.filter_text +
            "\nreference: " + evaluation.reference_filter_text + "\nvoxels: " +
            (voxel_size > 0.0 ? "means in cubes of " + FormatNumber(voxel_size, 4) : "none") +
            "; clipping: ";
    if (options.clip_distance > 0.0) {
      text += "distances above " + FormatNumber(options.clip_distance, 4) + " count as that (" +
              std::to_string(evaluation.error.accuracy.num_clipped) + " and " +
              std::to_string(evaluation.error.completeness.num_clipped) + " points)";
    } else {
      text += "none";
    }
    return text + "; normals: " + std::to_string(options.num_normal_neighbours) +
           " nearest points, unsigned\n";
  }

  json Json(const Evaluation& evaluation) const {
    const CloudError& error = evaluation.error;
    json result = {{"alignment", AsJson(evaluation.alignment)},
                   {"icp", nullptr},
                   {"voxel_size", voxel_size},
                   {"clip_distance", options.clip_distance},
                   {"f_distance", options.f_distance},
                   {"num_normal_neighbours", options.num_normal_neighbours},
                   {"accuracy", AsJson(error.accuracy)},
                   {"completeness", AsJson(error.completeness)},
                   {"overall", error.Overall()},
                   {"f_percent", 100.0 * error.F()},
                   {"normal_consistency_mean", error.NormalConsistencyMean()},
                   {"normal_consistency_median", error.NormalConsistencyMedian()}};
    if (evaluation.icp) {
      result["icp"] = {{"kind", icp},
                       {"max_distance", icp_options.max_distance},
                       {"num_iterations", evaluation.icp->num_iterations},
                       {"converged", evaluation.icp->converged},
                       {"paired_percent", 100.0 * evaluation.icp->share_paired},
                       {"rmse", evaluation.icp->rmse},
                       {"reference_from_prediction", AsJson(evaluation.icp->target_from_source)}};
    }
    return result;
  }
};

}  // namespace

std::function<void()> DeclareEvaluatePoints(Flags& flags) {
  const auto command = std::make_shared<EvaluatePointsCommand>();
  flags.Group("Input")
      .Require(
          "input_path",
          &command->sources.input_path,
          "What is evaluated: a predictions folder (its depths), a COLMAP model or a .ply file")
      .Require("reference_path",
               &command->sources.reference_path,
               "What it should be: one of the same kinds");
  flags.Group("Algorithm");
  AddAlignmentFlag(flags, command->sources);
  flags
      .AddChoice("icp",
                 &command->icp,
                 {"none", "rigid", "similarity"},
                 "Then iterative closest points, point to point: rigid as Open3D does it, "
                 "similarity also finds the scale, from both directions")
      .Add("icp_distance",
           &command->icp_options.max_distance,
           "Pairs farther apart do not count in ICP, scene units of the reference")
      .Add("icp_iterations", &command->icp_options.max_iterations, "At most that many");
  AddFilterFlags(flags, command->sources);
  flags
      .Add("voxel_size",
           &command->voxel_size,
           "Means in cubes of this edge instead of all points, scene units of the reference; 0 = "
           "none")
      .Add("clip_distance",
           &command->options.clip_distance,
           "Larger distances count as this, scene units of the reference; 0 = none")
      .Add("f_distance",
           &command->options.f_distance,
           "Distance that is right for precision, recall and F, scene units of the reference")
      .Add("normal_neighbours",
           &command->options.num_normal_neighbours,
           "Nearest points that a normal is taken from, the point itself among them");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
