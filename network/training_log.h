// SPDX-License-Identifier: BSD-3-Clause
// log.jsonl of a training run: a line of JSON per step and per validation. Steps are counted from
// 0, a validation by the steps before it.
#pragma once

#include "network/train.h"

#include <cstdint>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace vgtw {

inline constexpr char kTrainingLogFile[] = "log.jsonl";  // in the folder of a run

struct ScoreField {
  const char* name;   // in JSON
  const char* title;  // for people
  int num_digits;     // that people want to see behind the point
  double ValidationScore::*value;
};
// All of a ValidationScore but its step.
std::span<const ScoreField> ScoreFields();

// Lines without their end.
std::string LogLine(const TrainingStep& step);
std::string LogLine(const ValidationScore& score);

struct TrainingLog {
  std::vector<TrainingStep> steps;
  std::vector<ValidationScore> validations;
};

// What the first `num_steps_done` steps wrote. Lines that are not whole, as a killed run leaves
// them, are passed over; no such file is an empty log. Law: reads back what LogLine wrote, bit by
// bit.
TrainingLog ReadTrainingLog(const std::filesystem::path& path,
                            int64_t num_steps_done = std::numeric_limits<int64_t>::max());

// Takes out of a log what a killed run wrote after its last state, and returns the rest.
TrainingLog CutLog(const std::filesystem::path& path, int64_t num_steps_done);

}  // namespace vgtw
