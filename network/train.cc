// SPDX-License-Identifier: BSD-3-Clause
#include "network/train.h"

#include "network/device.h"
#include "network/folder_samples.h"
#include "network/plain_errors.h"
#include "network/runtime.h"
#include "network/scene_samples.h"
#include "network/training_log.h"
#include "network/training_loss.h"
#include "network/training_mode.h"
#include "network/training_options.h"
#include "network/training_state.h"
#include "network/validation.h"
#include "network/weights.h"
#include "network/weights_audit.h"
#include "scene/error.h"
#include "scene/memory.h"
#include "scene/parallel.h"
#include "scene/random.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <memory>
#include <utility>

#include <ATen/ATen.h>
#include <torch/csrc/autograd/autograd.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr char kStateFile[] = "state.safetensors";
constexpr char kWeightsFile[] = "weights.safetensors";

// Keys of random choices that must not depend on each other.
constexpr uint64_t kValidationKey = 1;
constexpr uint64_t kSourceKey = 2;
constexpr uint64_t kDropoutKey = 3;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

TrainingSample ToDevice(TrainingSample sample, const at::Device& device) {
  for (at::Tensor* tensor : {&sample.images,
                             &sample.distractor,
                             &sample.truth.depth,
                             &sample.truth.cam_from_world,
                             &sample.truth.intrinsics}) {
    if (tensor->defined()) *tensor = tensor->to(device);
  }
  return sample;
}

// Scenes and folders by their shares.
class MixedSamples : public SampleSource {
 public:
  explicit MixedSamples(const TrainOptions& options)
      : scenes_(options.scenes, options.scene_kind),
        seed_(options.scenes.seed),
        scene_share_(options.folders.empty() ? 1.0 : options.scene_share),
        num_scenes_(static_cast<uint64_t>(options.num_scenes)) {
    if (!options.folders.empty())
      folders_.emplace(FolderSampleOptions{options.folders,
                                           options.scenes.width,
                                           options.scenes.height,
                                           options.scenes.min_views,
                                           options.scenes.max_views,
                                           options.scenes.seed});
  }

  TrainingSample Get(uint64_t idx) const override {
    RandomStream random(HashKey({seed_, idx, kSourceKey}));
    if (random.Uniform() >= scene_share_) return folders_->Get(idx);
    return scenes_.Get(num_scenes_ > 0 ? idx % num_scenes_ : idx);
  }

 private:
  SceneSamples scenes_;
  uint64_t seed_;
  double scene_share_;
  uint64_t num_scenes_;
  std::optional<FolderSamples> folders_;
};

SceneStreamOptions HeldOut(SceneStreamOptions scenes) {
  scenes.seed = HashKey({scenes.seed, kValidationKey});
  return scenes;
}

// Answers with what is written in the end: means of past values where there are any.
class ResultSource : public ParameterSource {
 public:
  ResultSource(const TrainedParameters& parameters, const AdamW::Moments& moments)
      : parameters_(parameters), moments_(moments) {}

  at::Tensor Get(const std::string& name, const Shape&, at::ScalarType type) override {
    const size_t idx = parameters_.IndexOf(name);
    const bool has_mean = !moments_.mean.empty() && moments_.mean[idx].defined();
    return (has_mean ? moments_.mean[idx] : parameters_.all()[idx].value).to(type);
  }

 private:
  const TrainedParameters& parameters_;
  const AdamW::Moments& moments_;
};

struct Start {
  NetworkDescription network;
  std::optional<Checkpoint> weights;
  uint64_t fingerprint = 0;
};

// Which network is trained, and the weights to start from.
Start FindStart(const TrainOptions& options) {
  Start start;
  start.network = {NetworkKind::kVggt, options.sizes};
  if (!options.weights.empty()) {
    const fs::path path = NameOf(options.weights);
    start.weights.emplace(OpenWeights(options.weights));
    const WeightsAudit audit =
        AuditWeights(*start.weights, path, ValueCheck::kFinite, options.num_threads);
    RequireComplete(audit, path);
    start.network = audit.description;
    start.fingerprint = Fingerprint(*start.weights);
  }
  const auto extend = [&](auto& config) {
    if (options.lora_only && !config.lora) config.lora = options.lora;
    config.has_distractor_head = config.has_distractor_head || options.lora_only;
    return config.has_distractor_head;
  };
  const bool is_vgtw = std::visit(extend, start.network.config);
  const auto* vggt = std::get_if<VggtConfig>(&start.network.config);
  const bool is_vggt = vggt != nullptr;
  if (options.loss_weights[static_cast<size_t>(TrainingLoss::kPoints)] > 0.0 &&
      !(is_vggt && vggt->has_point_head)) {
    throw Error("a points_weight, but the network has no point head, expected --point_head 1");
  }
  if (is_vgtw) start.network.kind = is_vggt ? NetworkKind::kVgtw : NetworkKind::kVgtwPi3;
  start.network.side_px = options.scenes.width;
  return start;
}

class TrainRun {
 public:
  TrainRun(const TrainOptions& options, fs::path output_path)
      : options_(options),
        output_path_(std::move(output_path)),
        device_(ParseDevice(options.device)),
        start_(FindStart(options)),
        parameters_(start_.network,
                    start_.weights ? &*start_.weights : nullptr,
                    options.lora_only ? TrainedParts::kLoraAndDistractorHead : TrainedParts::kAll,
                    options.weights_seed,
                    device_),
        optimiser_(parameters_, OptimiserOf(options)),
        samples_(options),
        held_out_(HeldOut(options.scenes), options.scene_kind) {
    start_.weights.reset();
    const int num_threads = ResolveThreads(options.num_threads);
    const int num_workers = device_.is_cpu() ? std::min(num_threads, options.samples_per_step) : 1;
    threads_per_worker_ = std::max(1, num_threads / num_workers);
    for (int i = 0; i < num_workers; ++i) leaves_.emplace_back(parameters_);
  }

  TrainSummary Run(const ProgressCallback& progress, const std::function<bool()>& should_stop) {
    const Clock::time_point start = Clock::now();
    const fs::path state_path = output_path_ / kStateFile;
    const std::string identity = IdentityOf(options_, start_.fingerprint);
    int64_t step =
        ReadTrainingState(state_path, identity, parameters_, optimiser_.moments()).value_or(0);
    summary_.validations = CutLog(output_path_ / kTrainingLogFile, step).validations;
    log_.open(output_path_ / kTrainingLogFile, std::ios::app);
    Clock::time_point last_save = Clock::now();
    const auto save = [&] {
      WriteTrainingState(state_path, parameters_, optimiser_.moments(), step, identity);
      last_save = Clock::now();
    };
    while (step < options_.num_steps && !summary_.is_stopped) {
      Log(LogLine(Step(step)));
      ++step;
      if (progress) progress(step, options_.num_steps);
      if (step % options_.validate_every == 0 || step == options_.num_steps) Validate(step);
      if (SecondsSince(last_save) > options_.save_every_sec) save();
      summary_.is_stopped = step < options_.num_steps && should_stop && should_stop();
    }
    save();
    if (!summary_.is_stopped) {
      WriteTrainedWeights(
          output_path_ / kWeightsFile, start_.network, parameters_, optimiser_.moments());
    }
    summary_.num_steps = step;
    summary_.num_trained = parameters_.NumTrained();
    summary_.seconds = SecondsSince(start);
    summary_.peak_memory_gib = static_cast<double>(PeakMemory()) / static_cast<double>(1 << 30);
    return std::move(summary_);
  }

 private:
  at::ScalarType ProductType() const { return options_.bfloat16 ? at::kBFloat16 : at::kFloat; }

  // Gradients of one sample; they lie in the leaves of the worker.
  SampleLoss Differentiate(LeafSource& leaves, int64_t step, int sample_of_step) {
    UseThreads(threads_per_worker_);
    const auto idx = static_cast<uint64_t>(step * options_.samples_per_step + sample_of_step);
    const TrainingModeScope mode(
        {.lora_dropout = options_.lora_dropout,
         .dropout_seed = HashKey({options_.weights_seed, idx, kDropoutKey}),
         .recompute_blocks = options_.recompute_blocks});
    // Products in bfloat16 read copies of the values, which the last step changed.
    const std::unique_ptr<Model> model =
        BuildModel(ParameterScope(leaves, ProductType()), start_.network);
    leaves.ClearGradients();
    const SampleLoss loss = ComputeSampleLoss(*model,
                                              ToDevice(samples_.Get(idx), device_),
                                              options_.loss_weights,
                                              options_.feature_layer);
    if (loss.total.requires_grad()) torch::autograd::backward({loss.total}, {});
    return loss;
  }

  // Sums are formed in the order of the samples, whatever the number of workers.
  TrainingStep Step(int64_t step) {
    TrainingStep result;
    result.step = step;
    result.learning_rate = ScheduleOf(options_).At(step);
    std::vector<at::Tensor> gradients(parameters_.all().size());
    const auto num_workers = static_cast<int>(leaves_.size());
    const int num_samples = options_.samples_per_step;
    for (int begin = 0; begin < num_samples; begin += num_workers) {
      const int num = std::min(num_workers, num_samples - begin);
      std::vector<SampleLoss> losses(static_cast<size_t>(num));
      ParallelFor(num, num, [&](int64_t i) {
        const auto worker = static_cast<size_t>(i);
        losses[worker] = Differentiate(leaves_[worker], step, begin + static_cast<int>(i));
      });
      for (size_t worker = 0; worker < losses.size(); ++worker) {
        AddTo(result, losses[worker]);
        AddGradients(leaves_[worker], gradients);
      }
    }
    const auto norms = optimiser_.Step(std::move(gradients), step, result.learning_rate);
    if (!std::isfinite(result.loss) || !AreFinite(norms)) {
      throw Error("the loss or its gradient is not finite at step " + std::to_string(step) +
                  "; use a lower --learning_rate, and --overwrite to begin anew");
    }
    return result;
  }

  void AddTo(TrainingStep& result, const SampleLoss& loss) const {
    const double share = 1.0 / options_.samples_per_step;
    result.loss += share * loss.total.item<double>();
    for (size_t i = 0; i < kNumTrainingLosses; ++i) result.losses[i] += share * loss.values[i];
  }

  void AddGradients(const LeafSource& leaves, std::vector<at::Tensor>& sums) const {
    const double share = 1.0 / options_.samples_per_step;
    for (size_t i = 0; i < sums.size(); ++i) {
      const at::Tensor& gradient = leaves.leaves()[i].grad();
      if (!gradient.defined()) continue;
      if (sums[i].defined()) {
        sums[i].add_(gradient, share);
      } else {
        sums[i] = gradient * share;
      }
    }
  }

  void Validate(int64_t step) {
    ResultSource source(parameters_, optimiser_.moments());
    const std::unique_ptr<Model> model =
        BuildModel(ParameterScope(source, ProductType()), start_.network);
    std::vector<SampleScore> scores(static_cast<size_t>(options_.num_validation_scenes));
    ParallelFor(options_.num_validation_scenes, static_cast<int>(leaves_.size()), [&](int64_t i) {
      UseThreads(threads_per_worker_);
      const auto idx = static_cast<uint64_t>(i);
      scores[idx] =
          ScoreSample(*model, ToDevice(held_out_.Get(idx), device_), options_.feature_layer);
    });
    if (scores.empty()) return;
    summary_.validations.push_back(Summarise(scores, step));
    Log(LogLine(summary_.validations.back()));
  }

  void Log(const std::string& line) {
    log_ << line << std::endl;
    if (!log_) throw Error("cannot write " + (output_path_ / kTrainingLogFile).string());
  }

  const TrainOptions& options_;
  fs::path output_path_;
  at::Device device_;
  Start start_;
  TrainedParameters parameters_;
  AdamW optimiser_;
  MixedSamples samples_;
  SceneSamples held_out_;
  std::vector<LeafSource> leaves_;  // by worker
  int threads_per_worker_ = 1;
  std::ofstream log_;
  TrainSummary summary_;
};

}  // namespace

TrainSummary Train(const TrainOptions& options,
                   const fs::path& output_path,
                   const ProgressCallback& progress,
                   const std::function<bool()>& should_stop) {
  options.Check();
  UseThreads(options.num_threads);
  std::error_code error;
  fs::create_directories(output_path, error);
  if (error) Fail(output_path, "cannot be made (" + error.message() + ")", "a folder for the run");
  return WithPlainErrors([&] { return TrainRun(options, output_path).Run(progress, should_stop); },
                         "; use fewer --max_views, a smaller --width or --recompute 1");
}

void ForgetRun(const fs::path& output_path) {
  for (const char* name : {kStateFile, kTrainingLogFile, kWeightsFile}) {
    std::error_code error;
    fs::remove(output_path / name, error);
    if (error) Fail(output_path / name, "cannot be removed (" + error.message() + ")", "a file");
  }
}

}  // namespace vgtw
