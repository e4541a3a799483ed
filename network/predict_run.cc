// SPDX-License-Identifier: BSD-3-Clause
#include "network/predict_run.h"

#include "network/gpu.h"
#include "network/predict_chunks.h"
#include "network/predict_convert.h"
#include "network/predict_memory.h"
#include "network/runtime.h"
#include "scene/error.h"
#include "scene/memory.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <numeric>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// Work in units of one transformer block on one view.
struct WorkUnits {
  int64_t heads = 0;
  int64_t of_view = 0;
};

WorkUnits WorkUnitsOf(const NetworkDescription& description, bool with_points) {
  constexpr int64_t kDenseHead = 9;
  const int64_t num_blocks = NumBlocks(description);
  const bool is_vggt = std::holds_alternative<VggtConfig>(description.config);
  const bool has_distractor_head =
      std::visit([](const auto& sizes) { return sizes.has_distractor_head; }, description.config);
  const int64_t num_heads = 1 + (with_points && is_vggt) + has_distractor_head;
  return {kDenseHead * num_heads, num_blocks + kDenseHead * num_heads};
}

// The memory that a pass may take beside what the process holds already.
int64_t MemoryForPass(const ReadyNetwork& network, double max_memory_gib) {
  constexpr double kUsableShare = 0.9;
  const auto limit = static_cast<int64_t>(max_memory_gib * kGib);
  if (network.device.is_cuda()) {
    const std::vector<Gpu> gpus = ListGpus();
    const auto idx = static_cast<size_t>(std::max<int>(0, network.device.index()));
    const double on_board = idx < gpus.size() ? static_cast<double>(gpus[idx].memory_bytes) : 0.0;
    const int64_t total = limit > 0 ? limit : static_cast<int64_t>(kUsableShare * on_board);
    return total - network.weights_bytes;
  }
  if (network.release_memory) network.release_memory();
  if (limit > 0) return limit - ResidentMemory();
  return static_cast<int64_t>(kUsableShare * static_cast<double>(AvailableMemory()));
}

class Stopwatch {
 public:
  explicit Stopwatch(double& seconds) : seconds_(seconds) {}
  ~Stopwatch() {
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  double& seconds_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// What is masked is known to be a distractor, whatever the network says of it.
// excluded [H, W]; maps of one view.
void AddKnownDistractors(const at::Tensor& excluded, DenseOutputs& maps) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  at::Tensor& logits = maps.distractor_logits;
  if (!logits.defined()) logits = at::full_like(maps.depth, -kInfinity);
  logits = logits.masked_fill(excluded.to(logits.device()), kInfinity);
}

class PredictRun {
 public:
  PredictRun(const ReadyNetwork& network,
             const PredictOptions& options,
             const fs::path& image_folder,
             const std::vector<std::string>& image_names,
             const std::function<void(const ViewPrediction&)>& on_prediction,
             const ProgressCallback& progress)
      : network_(network),
        options_(options),
        on_prediction_(on_prediction),
        progress_(progress),
        photos_(
            image_folder, image_names, LoaderOf(network.description, options), options.num_threads),
        work_(WorkUnitsOf(network.description, options.with_points)) {}

  PredictSummary Run() {
    summary_.network_width = photos_.network_width();
    summary_.network_height = photos_.network_height();
    const int num_views_at_once = options_.max_views_at_once > 0
                                      ? options_.max_views_at_once
                                      : MaxViewsAtOnce(network_, options_.max_memory_gib, photos_);
    const std::vector<ViewChunk> chunks =
        PlanChunks(photos_.num_views(), num_views_at_once, options_.num_overlap_views);
    for (const ViewChunk& chunk : chunks) total_ += (chunk.end - chunk.begin) * work_.of_view;
    for (const ViewChunk& chunk : chunks) RunChunk(chunk, chunks.size() > 1);
    summary_.peak_memory_gib = static_cast<double>(PeakMemory()) / kGib;
    return std::move(summary_);
  }

 private:
  // What a pass over one chunk gave, and where each of its views lies there.
  struct Pass {
    Features features;
    CameraOutputs cameras;
    std::vector<int64_t> rank;  // by view - chunk.begin
    at::Tensor excluded;        // [S, H, W], by view - chunk.begin; undefined without masks
  };

  at::Tensor LoadImages(const ViewChunk& chunk) {
    const Stopwatch stopwatch(summary_.load_sec);
    return photos_.Load(chunk.begin, chunk.end);
  }

  // Encodes a chunk with its reference in front.
  Pass Encode(const ViewChunk& chunk) {
    at::Tensor images = LoadImages(chunk).to(network_.device);
    const Stopwatch stopwatch(summary_.encode_sec);
    const int64_t num_views = images.size(0);
    const int64_t reference = ReferenceOf(images);
    Pass pass;
    EncodeOptions encode;
    if (options_.read_static_mask) {
      pass.excluded = photos_.LoadExcluded(chunk.begin, chunk.end, options_.read_static_mask);
      encode.excluded_patches = ExcludedPatches(pass.excluded).to(network_.device);
    }
    pass.rank.resize(static_cast<size_t>(num_views));
    std::iota(pass.rank.begin(), pass.rank.end(), 0);
    if (reference > 0) {
      std::vector<int64_t> order = pass.rank;
      std::rotate(order.begin(), order.begin() + reference, order.begin() + reference + 1);
      for (size_t i = 0; i < order.size(); ++i) {
        pass.rank[static_cast<size_t>(order[i])] = static_cast<int64_t>(i);
      }
      const at::Tensor indices = at::tensor(order).to(images.device());
      images = images.index_select(0, indices);
      if (encode.excluded_patches.defined()) {
        encode.excluded_patches = encode.excluded_patches.index_select(0, indices);
      }
    }
    encode.on_block = [&] {
      if (network_.release_memory) network_.release_memory();
      Advance(num_views);
    };
    pass.features = network_.model->Encode(images, encode);
    pass.cameras = network_.model->PredictCameras(pass.features);
    pass.cameras.cam_from_world = pass.cameras.cam_from_world.cpu();
    if (network_.release_memory) network_.release_memory();
    return pass;
  }

  int64_t ReferenceOf(const at::Tensor& images) const {
    if (options_.reference == ReferenceChoice::kFirst || !network_.describe_views) return 0;
    // One view at a time: this must not need more memory than the pass itself.
    std::vector<at::Tensor> descriptions;
    for (int64_t i = 0; i < images.size(0); ++i) {
      descriptions.push_back(network_.describe_views(images.slice(0, i, i + 1)));
      if (network_.release_memory) network_.release_memory();
    }
    return MostConnectedView(at::cat(descriptions, 0));
  }

  ConvertedView Convert(const ViewChunk& chunk, const Pass& pass, int view) {
    const Stopwatch stopwatch(summary_.heads_sec);
    const int64_t rank = pass.rank[static_cast<size_t>(view - chunk.begin)];
    DenseOutputs maps = network_.model->PredictMaps(
        pass.features, rank, rank + 1, {.points = options_.with_points});
    if (pass.excluded.defined()) AddKnownDistractors(pass.excluded[view - chunk.begin], maps);
    ConvertedView converted = ConvertView(photos_.name(view),
                                          photos_.placement(view),
                                          SelectView(pass.cameras, rank, maps, 0),
                                          options_.with_points);
    Advance(work_.heads);
    return converted;
  }

  void RunChunk(const ViewChunk& chunk, bool is_one_of_several) {
    const Pass pass = Encode(chunk);
    Sim3d world_from_chunk;
    if (is_one_of_several) world_from_chunk = Align(chunk, pass);
    std::vector<ViewPrediction> last;
    const int first_kept = chunk.end - options_.num_overlap_views;
    for (int view = chunk.begin + chunk.num_shared_views; view < chunk.end; ++view) {
      ConvertedView converted = Convert(chunk, pass, view);
      if (!converted.fault.empty()) {
        summary_.rejected_views.push_back(photos_.name(view) + ": " + converted.fault);
        continue;
      }
      TransformPrediction(world_from_chunk, converted.prediction);
      on_prediction_(converted.prediction);
      ++summary_.num_views;
      if (is_one_of_several && view >= first_kept) last.push_back(std::move(converted.prediction));
    }
    last_views_ = std::move(last);
    if (network_.release_memory) network_.release_memory();
  }

  // Where the views that `chunk` shares with the one before were put, against what it says itself.
  Sim3d Align(const ViewChunk& chunk, const Pass& pass) {
    ChunkAlignment alignment;
    alignment.first_view = chunk.begin;
    alignment.num_views = chunk.end - chunk.begin;
    if (chunk.num_shared_views == 0) {
      summary_.alignments.push_back(alignment);
      return {};
    }
    std::vector<ViewPrediction> in_chunk;
    std::vector<ViewPrediction> in_world;
    for (int view = chunk.begin; view < chunk.begin + chunk.num_shared_views; ++view) {
      ConvertedView converted = Convert(chunk, pass, view);
      const auto known = std::find_if(
          last_views_.begin(), last_views_.end(), [&](const ViewPrediction& prediction) {
            return prediction.view.name == photos_.name(view);
          });
      if (!converted.fault.empty() || known == last_views_.end()) continue;
      in_chunk.push_back(std::move(converted.prediction));
      in_world.push_back(std::move(*known));
    }
    std::optional<AlignedChunk> aligned;
    if (!in_chunk.empty()) aligned = AlignChunk(in_chunk, in_world);
    if (!aligned) {
      throw Error("the views " + photos_.name(chunk.begin) + " to " + photos_.name(chunk.end - 1) +
                  " cannot be aligned with those before: none of the " +
                  std::to_string(chunk.num_shared_views) +
                  " shared views is usable; raise --overlap or --max_views");
    }
    aligned->residuals.first_view = alignment.first_view;
    aligned->residuals.num_views = alignment.num_views;
    summary_.alignments.push_back(aligned->residuals);
    return aligned->world_from_chunk;
  }

  void Advance(int64_t units) {
    done_ += units;
    if (progress_) progress_(done_, total_);
  }

  const ReadyNetwork& network_;
  const PredictOptions& options_;
  const std::function<void(const ViewPrediction&)>& on_prediction_;
  const ProgressCallback& progress_;
  PhotoLoader photos_;
  WorkUnits work_;
  std::vector<ViewPrediction> last_views_;  // in the world, for the next chunk
  PredictSummary summary_;
  int64_t done_ = 0;
  int64_t total_ = 0;
};

}  // namespace

int64_t NumBlocks(const NetworkDescription& description) {
  if (const auto* vggt = std::get_if<VggtConfig>(&description.config)) {
    return (vggt->encoder ? vggt->encoder->depth : 0) + 2 * vggt->depth;
  }
  const auto& pi3 = std::get<Pi3Config>(description.config);
  return pi3.encoder.depth + pi3.depth;
}

PreprocessOptions LoaderOf(const NetworkDescription& description, const PredictOptions& options) {
  PreprocessOptions loader;
  const bool is_vggt = std::holds_alternative<VggtConfig>(description.config);
  loader.policy = is_vggt ? ResizePolicy::kCrop : ResizePolicy::kStretch;
  loader.side_px = options.side_px > 0 ? options.side_px : description.side_px;
  loader.max_pixels = options.max_pixels;
  return loader;
}

int MaxViewsAtOnce(const ReadyNetwork& network, double max_memory_gib, const PhotoLoader& photos) {
  const int width = photos.network_width();
  const int height = photos.network_height();
  const MemoryEstimate need = EstimateMemory(network.description, width, height);
  const int64_t memory = MemoryForPass(network, max_memory_gib);
  const int64_t fitting = (memory - need.fixed) / need.per_view;
  if (fitting < std::min(2, photos.num_views())) {
    const auto missing = static_cast<double>(need.fixed + 2 * need.per_view - memory);
    throw Error("memory: two views of " + std::to_string(width) + "x" + std::to_string(height) +
                " pixels do not fit, " +
                std::to_string(static_cast<int64_t>(missing / kGib * 1024.0) + 1) +
                " MiB more are needed; raise --max_memory or use smaller images (--side_px)");
  }
  return static_cast<int>(std::min<int64_t>(fitting, photos.num_views()));
}

int64_t MostConnectedView(const at::Tensor& descriptions) {
  const at::Tensor values = descriptions.to(at::kCPU, at::kDouble);
  const at::Tensor directions = values / values.norm(2, {1}, /*keepdim=*/true).clamp_min(1e-12);
  return at::mv(directions, directions.mean(0)).argmax().item<int64_t>();
}

PredictSummary PredictViews(const ReadyNetwork& network,
                            const PredictOptions& options,
                            const fs::path& image_folder,
                            const std::vector<std::string>& image_names,
                            const std::function<void(const ViewPrediction&)>& on_prediction,
                            const ProgressCallback& progress) {
  options.Check();
  VGTW_CHECK(!image_names.empty(), "no photos");
  UseThreads(options.num_threads);
  const c10::InferenceMode inference;
  return PredictRun(network, options, image_folder, image_names, on_prediction, progress).Run();
}

}  // namespace vgtw
