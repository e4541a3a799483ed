// SPDX-License-Identifier: BSD-3-Clause
#include "network/training_log.h"

#include "scene/files.h"

#include <optional>
#include <sstream>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using nlohmann::json;

constexpr ScoreField kScoreFields[] = {
    {"mask_f1", "mask F1", 3, &ValidationScore::mask_f1},
    {"mask_iou", "mask IoU", 3, &ValidationScore::mask_iou},
    {"mask_precision", "precision", 3, &ValidationScore::mask_precision},
    {"mask_recall", "recall", 3, &ValidationScore::mask_recall},
    {"abs_rel", "AbsRel", 4, &ValidationScore::abs_rel},
    {"within_1_25", "within 1.25", 3, &ValidationScore::within_1_25},
    {"rotation_deg", "rotation (deg)", 2, &ValidationScore::rotation_deg},
    {"direction_deg", "direction (deg)", 2, &ValidationScore::direction_deg},
    {"pairs_within_5_deg", "pairs within 5 deg", 3, &ValidationScore::pairs_within_5_deg},
    {"confidence_ratio", "confidence ratio", 3, &ValidationScore::confidence_ratio},
    {"patch_similarity", "similarity", 3, &ValidationScore::patch_similarity},
    {"nearest_right", "nearest right", 3, &ValidationScore::nearest_right}};

double NumberAt(const json& entry, const char* name) {
  const auto found = entry.find(name);
  return found != entry.end() && found->is_number() ? found->get<double>() : 0.0;
}

struct Line {
  std::string text;
  json entry;
  bool is_validation = false;
};

// nullopt for what is no whole line of a log, or was written after these steps.
std::optional<Line> ParseLine(std::string text, int64_t num_steps_done) {
  Line line;
  line.entry = json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!line.entry.is_object()) return std::nullopt;
  const auto step = line.entry.find("step");
  if (step == line.entry.end() || !step->is_number_integer()) return std::nullopt;
  line.is_validation = line.entry.contains(kScoreFields[0].name);
  const int64_t last_kept = line.is_validation ? num_steps_done : num_steps_done - 1;
  if (step->get<int64_t>() > last_kept) return std::nullopt;
  line.text = std::move(text);
  return line;
}

void Append(const Line& line, TrainingLog& log) {
  const auto step = line.entry["step"].get<int64_t>();
  if (line.is_validation) {
    ValidationScore& score = log.validations.emplace_back();
    score.step = step;
    for (const ScoreField& field : kScoreFields) {
      score.*field.value = NumberAt(line.entry, field.name);
    }
    return;
  }
  TrainingStep& entry = log.steps.emplace_back();
  entry.step = step;
  entry.learning_rate = NumberAt(line.entry, "learning_rate");
  entry.loss = NumberAt(line.entry, "loss");
  for (size_t i = 0; i < kNumTrainingLosses; ++i) {
    entry.losses[i] = NumberAt(line.entry, kTrainingLossNames[i]);
  }
}

std::vector<Line> ReadLines(const std::filesystem::path& path, int64_t num_steps_done) {
  std::vector<Line> lines;
  if (!std::filesystem::exists(path)) return lines;
  std::istringstream file(ReadFile(path));
  for (std::string text; std::getline(file, text);) {
    if (auto line = ParseLine(std::move(text), num_steps_done)) lines.push_back(std::move(*line));
  }
  return lines;
}

TrainingLog LogOf(const std::vector<Line>& lines) {
  TrainingLog log;
  for (const Line& line : lines) Append(line, log);
  return log;
}

}  // namespace

std::span<const ScoreField> ScoreFields() { return kScoreFields; }

std::string LogLine(const TrainingStep& step) {
  json entry = {{"step", step.step}, {"learning_rate", step.learning_rate}, {"loss", step.loss}};
  for (size_t i = 0; i < kNumTrainingLosses; ++i) entry[kTrainingLossNames[i]] = step.losses[i];
  return entry.dump();
}

std::string LogLine(const ValidationScore& score) {
  json entry = {{"step", score.step}};
  for (const ScoreField& field : kScoreFields) entry[field.name] = score.*field.value;
  return entry.dump();
}

TrainingLog ReadTrainingLog(const std::filesystem::path& path, int64_t num_steps_done) {
  return LogOf(ReadLines(path, num_steps_done));
}

TrainingLog CutLog(const std::filesystem::path& path, int64_t num_steps_done) {
  const std::vector<Line> lines = ReadLines(path, num_steps_done);
  std::string kept;
  for (const Line& line : lines) kept += line.text + "\n";
  if (std::filesystem::exists(path)) WriteFileAtomically(path, kept);
  return LogOf(lines);
}

}  // namespace vgtw
