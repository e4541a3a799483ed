// SPDX-License-Identifier: BSD-3-Clause
// Distractor-aware training (Pan et al., Visual Geometry Transformer in the Wild, section 4) and
// training of small networks from nothing.
#pragma once

#include "network/config.h"
#include "scene/progress.h"
#include "scene/scene_stream.h"

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

// What is added up, each with its weight.
enum class TrainingLoss {
  kMask,
  kSuppression,
  kConsistency,
  kCamera,
  kDepth,
  kPoints,
  kCorrespondence
};
inline constexpr size_t kNumTrainingLosses = 7;
inline constexpr std::array<const char*, kNumTrainingLosses> kTrainingLossNames = {
    "mask", "suppression", "consistency", "camera", "depth", "points", "correspondence"};

enum class SceneKind {
  kVaried,  // scene/scene_stream.h
  kDemo     // those of `vgtw demo`: scene/demo_scenes.h
};

// Photos with masks of their distractors (scene/distractor_mask.h: <name>.png, 0 = excluded).
struct MaskedFolder {
  std::filesystem::path image_path;
  std::filesystem::path mask_path;
};

struct TrainOptions {
  // Weights to start from, later ones over earlier ones; none = a new network of `sizes`.
  std::vector<std::filesystem::path> weights;
  VggtConfig sizes = {};
  uint64_t weights_seed = 0;  // of what is new
  // True: LoRA and distractor head alone, on weights that stay; they are added where the weights
  // have none. False: everything.
  bool lora_only = true;
  LoraConfig lora = {};
  double lora_dropout = 0.05;

  // In the order of TrainingLoss; the defaults are the paper's, which has no labels of geometry.
  std::array<double, kNumTrainingLosses> loss_weights = {0.2, 0.01, 0.05};
  // Which of the four layers that dense heads read suppression and consistency look at, in [0,3].
  int feature_layer = 3;

  // What is learnt from: folders, if there are any, and rendered scenes without end.
  SceneStreamOptions scenes = {};
  SceneKind scene_kind = SceneKind::kVaried;
  int num_scenes = 0;        // that are rendered, over and over; 0 = never the same
  double scene_share = 0.0;  // of the samples, beside folders
  std::vector<MaskedFolder> folders;

  int64_t num_steps = 1000;
  int samples_per_step = 4;
  double learning_rate = 1e-4;      // highest
  double head_learning_rate = 0.0;  // highest of the distractor head; 0 = as the rest
  double warmup_share = 0.05;       // of the steps, in which the rates rise
  double decay_share = 0.95;        // of the steps, the last, in which they fall
  double weight_decay = 0.05;
  double max_gradient_norm = 1.0;
  double ema_decay = 0.0;  // of the weights that are written; 0 = those of the last step

  std::string device = "cpu";
  bool bfloat16 = false;  // products
  bool recompute_blocks = false;
  int num_threads = 0;

  // Held-out scenes that are looked at every so many steps, and at the end.
  int64_t validate_every = 500;
  int num_validation_scenes = 32;
  // How often the state is written, so that a killed run goes on from there.
  double save_every_sec = 120.0;

  // Throws std::invalid_argument naming the field that is out of its range.
  void Check() const;
};

// Of one step; means over its samples.
struct TrainingStep {
  int64_t step = 0;                                    // counted from 0
  double learning_rate = 0.0;                          // of all but the distractor head
  double loss = 0.0;                                   // weighted sum
  std::array<double, kNumTrainingLosses> losses = {};  // not weighted
};

// Of predictions on held-out scenes, each scene in the frame of its first view, scales by medians.
// training_log.h names the fields.
struct ValidationScore {
  int64_t step = 0;  // that were done
  double mask_f1 = 0.0;
  double mask_iou = 0.0;
  double mask_precision = 0.0;
  double mask_recall = 0.0;
  double abs_rel = 0.0;             // depths of static pixels
  double within_1_25 = 0.0;         // share of these
  double rotation_deg = 0.0;        // median over pairs of views
  double direction_deg = 0.0;       // of the translation, likewise
  double pairs_within_5_deg = 0.0;  // share of pairs, both errors
  // Mean confidence on distractors over that on static pixels.
  double confidence_ratio = 0.0;
  // Mean similarity of any two static patches of a scene, by the features that suppression and
  // consistency read: 1 = features tell nothing apart.
  double patch_similarity = 0.0;
  // Share of static patches whose nearest one in another view, by the same features, shows their
  // place, as consistency takes for granted.
  double nearest_right = 0.0;
};

struct TrainSummary {
  int64_t num_steps = 0;    // that are done
  bool is_stopped = false;  // before the last
  int64_t num_trained = 0;  // parameters
  std::vector<ValidationScore> validations;
  double seconds = 0.0;  // of this run
  double peak_memory_gib = 0.0;
};

// Trains, and goes on where a run that was stopped left off. `output_path` becomes a folder with
//   weights.safetensors   what was trained: LoRA and distractor head under their official names, or
//                         the whole network; the sizes that shapes do not tell as metadata
//   state.safetensors     all that a resumed run needs; written beside and renamed
//   log.jsonl             one line per step and per validation
// Law: a run that was killed and resumed ends with the same bits as one that was not, with the same
// options, machine and number of threads. Throws Error if the weights, photos or masks are not
// usable, if the folder holds a run with other options, or if the loss is not finite.
// `should_stop` is asked after every step; where it says true, the state is written, no weights
// are, and the rest is for the next call.
TrainSummary Train(const TrainOptions& options,
                   const std::filesystem::path& output_path,
                   const ProgressCallback& progress = {},
                   const std::function<bool()>& should_stop = {});

// Removes what a run left in `output_path`, and nothing else that lies there.
void ForgetRun(const std::filesystem::path& output_path);

}  // namespace vgtw
