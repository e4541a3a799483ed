// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/cloud_evaluation.h"
#include "plugin/cloud_source.h"
#include "plugin/commands.h"
#include "plugin/table.h"

#include <memory>

namespace vgtw {
namespace {

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
  CloudEvaluationOptions options;
  Usability usability;

  struct Evaluation : CloudEvaluation {
    std::string filter_text;
    std::string reference_filter_text;
  };

  void Run() {
    Apply(usability);
    sources.Resolve(usability.num_threads);
    options.error.num_threads = options.icp.num_threads = usability.num_threads;
    options.use_icp = icp != "none";
    options.icp.with_scale = icp == "similarity";
    options.error.Check();
    options.icp.Check();
    CloudSource prediction(sources.input_path, sources.filter);
    CloudSource reference(sources.reference_path, sources.reference_filter);
    const CloudAlignment alignment = AlignClouds(prediction, reference, sources.alignment);
    const Evaluation evaluation{EvaluateClouds(prediction, reference, alignment, options),
                                prediction.FilterText(),
                                reference.FilterText()};
    json result = Json(evaluation);
    result["filter"] = prediction.FilterAsJson();
    result["reference_filter"] = reference.FilterAsJson();
    Finish(usability, Text(evaluation), result);
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
    const std::string f_distance = FormatNumber(options.error.f_distance, 4);
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
      text += ", then " + icp + " ICP within " + FormatNumber(options.icp.max_distance, 4) + " (" +
              std::to_string(evaluation.icp->num_iterations) + " iterations" +
              (evaluation.icp->converged ? "" : ", not converged") + ", RMSE " +
              FormatNumber(evaluation.icp->rmse, 5) + ", scale " +
              FormatNumber(evaluation.icp->target_from_source.scale, 6) + ")";
    }
    text += "\nprediction: " + evaluation.filter_text +
            "\nreference: " + evaluation.reference_filter_text + "\nvoxels: " +
            (options.voxel_size > 0.0 ? "means in cubes of " + FormatNumber(options.voxel_size, 4)
                                      : "none") +
            "; clipping: ";
    if (options.error.clip_distance > 0.0) {
      text += "distances above " + FormatNumber(options.error.clip_distance, 4) +
              " count as that (" + std::to_string(evaluation.error.accuracy.num_clipped) + " and " +
              std::to_string(evaluation.error.completeness.num_clipped) + " points)";
    } else {
      text += "none";
    }
    return text + "; normals: " + std::to_string(options.error.num_normal_neighbours) +
           " nearest points, unsigned\n";
  }

  json Json(const Evaluation& evaluation) const {
    const CloudError& error = evaluation.error;
    json result = {{"alignment", AsJson(evaluation.alignment)},
                   {"icp", nullptr},
                   {"voxel_size", options.voxel_size},
                   {"clip_distance", options.error.clip_distance},
                   {"f_distance", options.error.f_distance},
                   {"num_normal_neighbours", options.error.num_normal_neighbours},
                   {"accuracy", AsJson(error.accuracy)},
                   {"completeness", AsJson(error.completeness)},
                   {"overall", error.Overall()},
                   {"f_percent", 100.0 * error.F()},
                   {"normal_consistency_mean", error.NormalConsistencyMean()},
                   {"normal_consistency_median", error.NormalConsistencyMedian()}};
    if (evaluation.icp) {
      result["icp"] = {{"kind", icp},
                       {"max_distance", options.icp.max_distance},
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
           &command->options.icp.max_distance,
           "Pairs farther apart do not count in ICP, scene units of the reference")
      .Add("icp_iterations", &command->options.icp.max_iterations, "At most that many");
  AddFilterFlags(flags, command->sources);
  flags
      .Add("voxel_size",
           &command->options.voxel_size,
           "Means in cubes of this edge instead of all points, scene units of the reference; 0 = "
           "none")
      .Add("clip_distance",
           &command->options.error.clip_distance,
           "Larger distances count as this, scene units of the reference; 0 = none")
      .Add("f_distance",
           &command->options.error.f_distance,
           "Distance that is right for precision, recall and F, scene units of the reference")
      .Add("normal_neighbours",
           &command->options.error.num_normal_neighbours,
           "Nearest points that a normal is taken from, the point itself among them");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
