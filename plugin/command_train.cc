// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/training_folders.h"
#include "network/train.h"
#include "network/training_log.h"
#include "plugin/commands.h"
#include "plugin/network_commands.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "plugin/training_curves.h"
#include "scene/error.h"
#include "scene/files.h"

#include <csignal>
#include <filesystem>
#include <memory>

#include <signal.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// Ctrl-C and a polite kill end a run after its present step; asked a second time it ends at once.
class StopSignals {
 public:
  StopSignals() {
    struct sigaction action = {};
    action.sa_handler = [](int) { is_wanted_ = 1; };
    action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
    for (const int signal : {SIGINT, SIGTERM}) ::sigaction(signal, &action, nullptr);
  }
  static bool AreWanted() { return is_wanted_ != 0; }

 private:
  static inline volatile std::sig_atomic_t is_wanted_ = 0;
};

// A flag per field of TrainOptions; what is not a number is resolved by Options().
struct TrainCommand {
  TrainOptions options;
  fs::path config;
  fs::path output_path;
  fs::path weights_path;
  fs::path lora_path;
  fs::path image_path;
  fs::path mask_path;
  std::string trains = "lora";
  std::string scenes = "varied";
  std::string precision = "fp32";
  int num_steps = 1000;
  int validate_every = 500;
  int dim = 1024;
  int depth = 24;
  int num_heads = 16;
  int num_camera_heads = 16;
  int num_camera_blocks = 4;
  int encoder_depth = 24;
  int dpt_features = 256;
  int lora_rank = 32;
  std::vector<int64_t> dpt_channels = {256, 512, 1024, 1024};
  std::vector<int64_t> head_layers = {4, 11, 17, 23};
  bool overwrite = false;
  Usability usability;

  TrainOptions Options() const {
    TrainOptions resolved = options;
    resolved.num_threads = usability.num_threads;
    resolved.num_steps = num_steps;
    resolved.validate_every = validate_every;
    resolved.lora_only = trains == "lora";
    resolved.scene_kind = scenes == "demo" ? SceneKind::kDemo : SceneKind::kVaried;
    resolved.lora.rank = lora_rank;
    resolved.bfloat16 = precision == "bf16";
    for (const fs::path& path : {weights_path, lora_path}) {
      if (!path.empty()) resolved.weights.push_back(path);
    }
    resolved.sizes = Sizes();
    if (image_path.empty() != mask_path.empty()) {
      throw Error("one of --image_path and --mask_path alone, expected photos with their masks");
    }
    if (!image_path.empty()) resolved.folders = FindFolders();
    if (resolved.weights.empty() && resolved.lora_only) {
      throw Error("--trains lora without --weights_path, expected weights that it is added to");
    }
    return resolved;
  }

  VggtConfig Sizes() const {
    VggtConfig sizes = options.sizes;
    sizes.dim = dim;
    sizes.depth = depth;
    sizes.num_heads = num_heads;
    sizes.num_camera_heads = num_camera_heads;
    sizes.num_camera_blocks = num_camera_blocks;
    if (encoder_depth == 0) {
      sizes.encoder.reset();
    } else {
      sizes.encoder->dim = dim;
      sizes.encoder->depth = encoder_depth;
      sizes.encoder->num_heads = num_heads;
    }
    sizes.dpt.num_features = dpt_features;
    sizes.dpt.num_channels = Four(dpt_channels, "dpt_channels");
    sizes.head_layers = Four(head_layers, "head_layers");
    return sizes;
  }

  static std::array<int64_t, 4> Four(const std::vector<int64_t>& numbers, const char* flag) {
    if (numbers.size() != 4) {
      throw Error("--" + std::string(flag) + " with " + std::to_string(numbers.size()) +
                  " numbers, expected four");
    }
    return {numbers[0], numbers[1], numbers[2], numbers[3]};
  }

  std::vector<MaskedFolder> FindFolders() const {
    std::vector<MaskedFolder> folders;
    for (const TrainingScene& scene : FindTrainingScenes(image_path, mask_path)) {
      folders.push_back({scene.image_path, scene.mask_path});
    }
    return folders;
  }

  void Run() {
    Apply(usability);
    const TrainOptions resolved = Options();
    if (overwrite) {
      ForgetRun(output_path);
      fs::remove(CurvesPath());
    }
    TrainSummary summary;
    {
      ProgressDisplay display("steps");
      const StopSignals signals;
      summary = Train(resolved, output_path, display.Callback(), &StopSignals::AreWanted);
    }
    if (summary.is_stopped) {
      throw Error("stopped after " + std::to_string(summary.num_steps) + " of " +
                  std::to_string(num_steps) + " steps, which are saved in " + output_path.string() +
                  "; the same command goes on from there");
    }
    const std::string curves = DrawTrainingCurves(ReadTrainingLog(output_path / kTrainingLogFile));
    if (!curves.empty()) WriteFileAtomically(CurvesPath(), curves);
    Finish(usability, Text(summary), Json(summary));
  }

  fs::path CurvesPath() const { return output_path / "curves.svg"; }

  std::string Text(const TrainSummary& summary) const {
    std::vector<std::vector<std::string>> table = {{"steps"}};
    for (const ScoreField& field : ScoreFields()) table[0].push_back(field.title);
    for (const ValidationScore& score : summary.validations) {
      table.push_back({std::to_string(score.step)});
      for (const ScoreField& field : ScoreFields()) {
        table.back().push_back(FormatNumber(score.*field.value, field.num_digits));
      }
    }
    return FormatTable(table) +
           "held-out scenes; depths of static pixels, scaled by medians per scene; rotation and "
           "direction of the baseline: medians over pairs of views; confidence on distractors / on "
           "static pixels; similarity of any two static patches\n" +
           std::to_string(summary.num_steps) + " steps, " + std::to_string(summary.num_trained) +
           " parameters, " + FormatNumber(summary.seconds, 0) + " s, peak memory " +
           FormatNumber(summary.peak_memory_gib, 2) +
           " GiB\nwritten: " + (output_path / "weights.safetensors").string() + ", " +
           CurvesPath().string() + "\n";
  }

  json Json(const TrainSummary& summary) const {
    json validations = json::array();
    for (const ValidationScore& score : summary.validations) {
      validations.push_back(json::parse(LogLine(score)));
    }
    return {{"num_steps", summary.num_steps},
            {"num_parameters", summary.num_trained},
            {"validations", validations},
            {"seconds", summary.seconds},
            {"peak_memory_gib", summary.peak_memory_gib},
            {"output_path", output_path.string()}};
  }

  void DeclareNetwork(Flags& flags) {
    flags.Group("Network")
        .Add("weights_path", &weights_path, "Weights to start from; none = a new network")
        .Add("lora_path", &lora_path, "LoRA and distractor head to start from, over these")
        .AddChoice("trains",
                   &trains,
                   {"lora", "all"},
                   "LoRA and distractor head on weights that stay (distractor-aware training), or "
                   "everything")
        .Add("lora_rank", &lora_rank, "Rank of a new LoRA")
        .Add("lora_alpha", &options.lora.alpha, "Its factor is alpha / rank")
        .Add("lora_dropout", &options.lora_dropout, "Share of its inputs that are dropped")
        .Add("dim", &dim, "Channels of a new network")
        .Add("depth", &depth, "Its pairs of a block within views and one across")
        .Add("heads", &num_heads, "Its attention heads")
        .Add("camera_heads", &num_camera_heads, "Attention heads of its camera head")
        .Add("camera_blocks", &num_camera_blocks, "Blocks of its camera head")
        .Add("encoder_depth", &encoder_depth, "Blocks of its encoder; 0 = patches by a convolution")
        .Add("head_layers", &head_layers, "Four layers that its dense heads read, from 0")
        .Add("dpt_features", &dpt_features, "Channels of its dense heads")
        .Add("dpt_channels", &dpt_channels, "Their channels at the four resolutions")
        .Add("point_head", &options.sizes.has_point_head, "A head for points")
        .Add("distractor_head", &options.sizes.has_distractor_head, "A head for distractors")
        .Add("weights_seed", &options.weights_seed, "Of new weights and of dropout");
  }

  void DeclareData(Flags& flags) {
    flags.Group("Data")
        .Add("image_path", &image_path, "Photos of one scene, or a folder of them for each")
        .Add(
            "mask_path", &mask_path, "Their masks, <photo name>.png, 0 = distractor; folders alike")
        .Add("scene_share",
             &options.scene_share,
             "Share of rendered scenes beside photos; without photos all are")
        .AddChoice("scenes",
                   &scenes,
                   {"varied", "demo"},
                   "Rendered scenes: of all kinds, or like those of `vgtw demo`")
        .Add("num_scenes",
             &options.num_scenes,
             "That are rendered, over and over; 0 = never the same twice")
        .Add("width", &options.scenes.width, "Of the network's images, pixels, a multiple of 14")
        .Add("height", &options.scenes.height, "Likewise")
        .Add("min_views", &options.scenes.min_views, "Views of a sample, at least")
        .Add("max_views", &options.scenes.max_views, "And at most")
        .Add("distractor_share",
             &options.scenes.distractor_share,
             "Share of rendered scenes that have distractors")
        .Add("texture_path", &options.scenes.texture_folder, "Photos for surfaces of scenes")
        .Add("seed", &options.scenes.seed, "Of the samples");
  }

  void DeclareLoss(Flags& flags) {
    flags.Group("Loss");
    for (size_t i = 0; i < kNumTrainingLosses; ++i) {
      flags.Add(std::string(kTrainingLossNames[i]) + "_weight",
                &options.loss_weights[i],
                "Weight of the loss; 0 = none");
    }
    flags.Add("feature_layer",
              &options.feature_layer,
              "Which of the four layers that dense heads read suppression and consistency look at, "
              "from 0");
  }

  void DeclareOptimiser(Flags& flags) {
    flags.Group("Optimiser")
        .Add("steps", &num_steps, "Steps in all; more than a finished run had go on from it")
        .Add("samples_per_step", &options.samples_per_step, "Samples whose gradients are averaged")
        .Add("learning_rate", &options.learning_rate, "The highest")
        .Add("head_learning_rate",
             &options.head_learning_rate,
             "The highest of the distractor head; 0 = as the rest")
        .Add("warmup_share", &options.warmup_share, "Share of the steps in which they rise")
        .Add("decay_share", &options.decay_share, "Share of the steps in which they fall, the last")
        .Add("weight_decay", &options.weight_decay, "Of weights of products but LoRA's")
        .Add("max_gradient_norm",
             &options.max_gradient_norm,
             "Longer gradients of trunk, heads, LoRA or distractor head are shortened; 0 = none")
        .Add("ema_decay",
             &options.ema_decay,
             "Of the mean of past weights that is written in their place; 0 = none")
        .Add("validate_every", &validate_every, "Steps between looks at held-out scenes")
        .Add("validation_scenes", &options.num_validation_scenes, "How many these are")
        .Add("save_every_sec", &options.save_every_sec, "Seconds between states to resume from");
  }
};

}  // namespace

std::function<void()> DeclareTrain(Flags& flags) {
  const auto command = std::make_shared<TrainCommand>();
  flags.Group("Input").ConfigFile(&command->config);
  command->DeclareNetwork(flags);
  command->DeclareData(flags);
  command->DeclareLoss(flags);
  command->DeclareOptimiser(flags);
  flags.Group("Machine")
      .Add("device", &command->options.device, "cpu, cuda or cuda:<number>")
      .AddChoice("precision", &command->precision, {"fp32", "bf16"}, "Numbers of matrix products")
      .Add("recompute",
           &command->options.recompute_blocks,
           "Keep less for the gradient and run blocks twice: a third slower, far less memory");
  flags.Group("Output")
      .Require("output_path",
               &command->output_path,
               "Folder of the run: weights.safetensors, state.safetensors, log.jsonl. A run that "
               "was stopped goes on")
      .Add("overwrite", &command->overwrite, "Begin anew");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
