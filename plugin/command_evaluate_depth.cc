// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/commands.h"
#include "plugin/depth_evaluation.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <cmath>
#include <memory>
#include <stdexcept>

namespace vgtw {
namespace {

using nlohmann::json;

struct AlignmentChoice {
  const char* flag;
  DepthAlignment alignment;
  const char* text;
};

constexpr AlignmentChoice kAlignments[] = {
    {"median", DepthAlignment::kMedian, "scaled by the ratio of the medians"},
    {"scale", DepthAlignment::kScale, "scaled for least absolute differences (10 IRLS steps)"},
    {"scale_shift",
     DepthAlignment::kScaleShift,
     "scaled and shifted for least absolute differences"},
    {"none", DepthAlignment::kNone, "not aligned"},
};

const AlignmentChoice& ChoiceOf(const std::string& flag) {
  for (const AlignmentChoice& choice : kAlignments) {
    if (flag == choice.flag) return choice;
  }
  throw std::logic_error("a choice that the flags do not allow");
}

std::vector<std::string> Choices() {
  std::vector<std::string> choices;
  for (const AlignmentChoice& choice : kAlignments) choices.push_back(choice.flag);
  return choices;
}

struct EvaluateDepthCommand {
  CloudSourceFlags sources;
  DepthEvaluationOptions options;
  std::string method = "reprojection";
  std::string cloud = "all";
  std::string depth_alignment = "median";
  std::string fit = "view";
  double max_depth = 0.0;
  Usability usability;

  void Run() {
    Apply(usability);
    sources.Resolve(usability.num_threads);
    VGTW_CHECK(max_depth >= 0.0, "--max_depth " + std::to_string(max_depth) + ", must be >= 0");
    options.reproject = method == "reprojection";
    options.cloud_of_all_views = cloud == "all";
    options.cloud_alignment = sources.alignment;
    options.depth_alignment = ChoiceOf(depth_alignment).alignment;
    options.one_fit = fit == "all";
    options.num_threads = usability.num_threads;
    if (max_depth > 0.0) options.max_depth = max_depth;
    CloudSource prediction(sources.input_path, sources.filter);
    CloudSource reference(sources.reference_path, sources.reference_filter);
    ProgressDisplay display("views");
    const DepthEvaluation evaluation =
        EvaluateDepths(prediction, reference, options, display.Callback());
    const json conditions = {{"filter", prediction.FilterAsJson()},
                             {"reference_filter", reference.FilterAsJson()}};
    json result = Json(evaluation);
    result.update(conditions);
    Finish(usability,
           Table(evaluation) + Conditions(evaluation) + "prediction: " + prediction.FilterText() +
               "\nreference: " + reference.FilterText() + "\n",
           result);
  }

  bool HasFit() const {
    return !options.reproject && options.depth_alignment != DepthAlignment::kNone;
  }

  std::string Table(const DepthEvaluation& evaluation) const {
    std::vector<std::vector<std::string>> rows = {{"view", "AbsRel", "delta < 1.25, %", "pixels"}};
    if (HasFit()) rows[0].insert(rows[0].end(), {"scale", "shift"});
    const auto add = [&](std::string name, double abs_rel, double within, size_t num_pixels) {
      rows.push_back({std::move(name),
                      FormatNumber(abs_rel, 5),
                      FormatNumber(within, 2),
                      std::to_string(num_pixels)});
    };
    size_t num_views = 0;
    for (const ViewDepthError& view : evaluation.views) {
      add(view.name, view.error.AbsRel(), view.error.WithinPercent(), view.error.num_pixels);
      if (HasFit()) {
        rows.back().push_back(FormatNumber(view.fit.scale, 5));
        rows.back().push_back(FormatNumber(view.fit.shift, 5));
      }
      num_views += view.error.num_pixels > 0;
    }
    const size_t num_pixels = evaluation.pooled.num_pixels;
    add("mean of " + std::to_string(num_views) + " views",
        evaluation.mean_abs_rel,
        evaluation.mean_within_percent,
        num_pixels);
    add("all pixels", evaluation.pooled.AbsRel(), evaluation.pooled.WithinPercent(), num_pixels);
    for (std::vector<std::string>& row : rows) row.resize(rows[0].size());
    return FormatTable(rows);
  }

  // What the numbers hold under.
  std::string Conditions(const DepthEvaluation& evaluation) const {
    std::string text;
    if (options.reproject) {
      text = std::string("reprojection of ") +
             (options.cloud_of_all_views ? "all views' points into every view"
                                         : "each view's own points") +
             " (nearest per pixel); prediction " + AlignmentText(*evaluation.alignment) +
             ", scale " + FormatNumber(evaluation.alignment->reference_from_prediction.scale, 6);
    } else {
      text = std::string("depth maps, ") + ChoiceOf(depth_alignment).text;
      if (HasFit()) text += options.one_fit ? ", one fit for all views" : ", a fit per view";
    }
    text += "\npixels of the reference where both have depth";
    if (max_depth > 0.0) text += ", at most " + FormatNumber(max_depth, 4) + " deep";
    return text + "\n";
  }

  json Json(const DepthEvaluation& evaluation) const {
    json views = json::array();
    for (const ViewDepthError& view : evaluation.views) {
      views.push_back({{"name", view.name},
                       {"abs_rel", view.error.AbsRel()},
                       {"within_1_25_percent", view.error.WithinPercent()},
                       {"num_pixels", view.error.num_pixels},
                       {"scale", view.fit.scale},
                       {"shift", view.fit.shift}});
    }
    json result = {{"method", method},
                   {"max_depth", max_depth},
                   {"views", views},
                   {"mean",
                    {{"abs_rel", evaluation.mean_abs_rel},
                     {"within_1_25_percent", evaluation.mean_within_percent}}},
                   {"pixels",
                    {{"abs_rel", evaluation.pooled.AbsRel()},
                     {"within_1_25_percent", evaluation.pooled.WithinPercent()},
                     {"num_pixels", evaluation.pooled.num_pixels}}}};
    if (options.reproject) {
      result["cloud"] = cloud;
      result["alignment"] = AsJson(*evaluation.alignment);
    } else {
      result["depth_alignment"] = depth_alignment;
      result["fit"] = fit;
    }
    return result;
  }
};

}  // namespace

std::function<void()> DeclareEvaluateDepth(Flags& flags) {
  const auto command = std::make_shared<EvaluateDepthCommand>();
  flags.Group("Input")
      .Require("input_path", &command->sources.input_path, "Predictions folder that is evaluated")
      .Require("reference_path",
               &command->sources.reference_path,
               "Predictions folder of what it should be, of the same photos");
  flags.Group("Algorithm")
      .AddChoice("method",
                 &command->method,
                 {"reprojection", "maps"},
                 "The aligned cloud projected into the reference's views, as in the paper of VGTW, "
                 "or depth maps as they are");
  AddAlignmentFlag(flags, command->sources);
  flags
      .AddChoice("cloud",
                 &command->cloud,
                 {"all", "own"},
                 "Reprojected into a view: the points of all views, or its own")
      .AddChoice("depth_alignment",
                 &command->depth_alignment,
                 Choices(),
                 "How maps are brought to the reference's scale")
      .AddChoice("fit",
                 &command->fit,
                 {"view", "all"},
                 "Maps are aligned each for itself or all at once, as video benchmarks do")
      .Add("max_depth",
           &command->max_depth,
           "Pixels that should be deeper do not count, scene units of the reference; 0 = none");
  AddFilterFlags(flags, command->sources);
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
