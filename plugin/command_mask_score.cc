// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/commands.h"
#include "plugin/mask_scores.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "scene/error.h"
#include "scene/files.h"

#include <memory>
#include <span>

namespace vgtw {
namespace {

struct Column {
  const char* title;  // in the table; "" = only in files
  const char* key;
  double MaskRatios::*ratio;
  int digits;
};

constexpr Column kColumns[] = {
    {"accuracy", "accuracy", &MaskRatios::accuracy, 4},
    {"precision", "precision", &MaskRatios::precision, 4},
    {"recall", "recall", &MaskRatios::recall, 4},
    {"F1 = Dice", "f1", &MaskRatios::f1, 4},
    {"IoU", "iou", &MaskRatios::iou, 4},
    {"", "dice", &MaskRatios::dice, 4},
    {"boundary F", "boundary_f", &MaskRatios::boundary_f, 4},
    {"left /1000", "on_distractors_per_1000_kept", &MaskRatios::on_distractors_per_1000_kept, 1},
    {"lost /1000", "lost_per_1000_static", &MaskRatios::lost_per_1000_static, 1},
};
constexpr size_t kNumFeatureColumns = 2;  // the last

struct NamedRatios {
  std::string name;
  MaskRatios ratios;
};

struct MaskScoreCommand {
  MaskScoresOptions options;
  std::filesystem::path csv_path;
  Usability usability;

  std::span<const Column> Columns() const {
    const std::span<const Column> all(kColumns);
    return options.database_path.empty() ? all.first(all.size() - kNumFeatureColumns) : all;
  }

  void Run() {
    Apply(usability);
    if (options.mask_path.empty() == options.predictions_path.empty()) {
      throw Error("what is to be scored, expected one of --mask_path and --predictions_path");
    }
    if (!csv_path.empty()) AtomicFile{csv_path};
    options.num_threads = usability.num_threads;
    ProgressDisplay display("masks");
    const std::vector<ImageMaskScore> scores = ScoreMasks(options, display.Callback());

    std::vector<MaskScore> all;
    MaskScore pooled;
    std::vector<NamedRatios> images;
    for (const ImageMaskScore& image : scores) {
      images.push_back({image.name, RatiosOf(image.score)});
      all.push_back(image.score);
      pooled += image.score;
    }
    const NamedRatios mean = {"mean of " + std::to_string(images.size()) + " images",
                              MeanRatios(all)};
    const NamedRatios pool = {"pooled", RatiosOf(pooled)};
    if (!csv_path.empty()) WriteFileAtomically(csv_path, Csv(images));
    nlohmann::json json_images = nlohmann::json::array();
    for (const NamedRatios& image : images) json_images.push_back(Json(image));
    Finish(usability,
           Text(images, mean, pool),
           {{"images", json_images}, {"mean", Json(mean)}, {"pooled", Json(pool)}});
  }

  std::string Text(std::vector<NamedRatios> lines,
                   const NamedRatios& mean,
                   const NamedRatios& pool) const {
    lines.push_back(mean);
    lines.push_back(pool);
    std::vector<std::vector<std::string>> rows = {{"image"}};
    for (const Column& column : Columns()) {
      if (*column.title != '\0') rows[0].push_back(column.title);
    }
    for (const NamedRatios& line : lines) {
      rows.push_back({line.name});
      for (const Column& column : Columns()) {
        if (*column.title == '\0') continue;
        rows.back().push_back(FormatNumber(line.ratios.*column.ratio, column.digits));
      }
    }
    std::string text = FormatTable(rows) +
                       "positive = distractor; mean weighs images, pooled pixels; "
                       "an image without distractors in both masks counts 1";
    if (!options.database_path.empty()) {
      text += "; left: features on distractors per 1000 kept; lost: per 1000 static ones";
    }
    return text + "\n";
  }

  nlohmann::json Json(const NamedRatios& line) const {
    nlohmann::json json = {{"name", line.name}};
    for (const Column& column : Columns()) json[column.key] = line.ratios.*column.ratio;
    return json;
  }

  std::string Csv(const std::vector<NamedRatios>& images) const {
    std::string text = "image";
    for (const Column& column : Columns()) text += std::string(",") + column.key;
    text += "\n";
    for (const NamedRatios& image : images) {
      text += QuotedForCsv(image.name);
      for (const Column& column : Columns()) {
        text += "," + FormatNumber(image.ratios.*column.ratio, 6);
      }
      text += "\n";
    }
    return text;
  }

  static std::string QuotedForCsv(const std::string& name) {
    std::string quoted = "\"";
    for (const char c : name) {
      if (c == '"') quoted += c;
      quoted += c;
    }
    return quoted + "\"";
  }
};

}  // namespace

std::function<void()> DeclareMaskScore(Flags& flags) {
  const auto command = std::make_shared<MaskScoreCommand>();
  MaskScoresOptions& options = command->options;
  flags.Group("Input")
      .Add("mask_path", &options.mask_path, "COLMAP masks to score: <photo name>.png")
      .Add("predictions_path",
           &options.predictions_path,
           "Or a predictions folder, whose distractor probabilities are scored")
      .Require("reference_mask_path",
               &options.reference_mask_path,
               "True masks; the images that have one are scored")
      .Add("image_path", &options.image_path, "Photos, of which the true masks must have the size")
      .Add("database_path",
           &options.database_path,
           "COLMAP database of features extracted WITHOUT masks: also count what masks leave of "
           "them")
      .Add("allow_missing_masks",
           &options.allow_missing_masks,
           "Score an image without a mask as if nothing were excluded instead of stopping");
  flags.Group("Algorithm")
      .Add("mask_threshold",
           &options.threshold,
           "Distractor probability from which a pixel is excluded, in (0,1]; for predictions")
      .Add("tolerance_px",
           &options.tolerance_px,
           "Tolerance of the boundary F, pixels; 0 = 0.008 of the diagonal, rounded up (DAVIS)");
  flags.Group("Output").Add(
      "csv", &command->csv_path, "Also write one line per image to this file");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
