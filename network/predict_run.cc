// SPDX-License-Identifier: BSD-3-Clause
#include "network/predict_run.h"

#include "network/gpu.h"
#include "network/predict_chunks.h"
#include "network/predict_convert.h"
#include "network/predict_memory.h"
#include "network/preprocess.h"
#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>
#include <chrono>
#include <numeric>

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <c10/core/InferenceMode.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr double kGib = 1024.0 * 1024.0 * 1024.0;

// Work in units of one layer of the trunk on one view, by count of operations.
struct WorkUnits {
  int64_t num_layers = 0;
  int64_t encoder = 0;
  int64_t heads = 0;

  int64_t OfView() const { return encoder + num_layers + heads; }
};

WorkUnits WorkUnitsOf(const NetworkDescription& description) {
  constexpr int64_t kHeads = 12;
  if (const auto* vggt = std::get_if<VggtConfig>(&description.config)) {
    return {vggt->depth, vggt->encoder ? vggt->encoder->depth / 2 : 0, kHeads};
  }
  const auto& pi3 = std::get<Pi3Config>(description.config);
  return {pi3.depth / 2, pi3.encoder.depth / 2, kHeads};
}

PreprocessOptions LoaderOf(const NetworkDescription& description, const PredictOptions& options) {
  PreprocessOptions loader;
  const bool is_vggt = std::holds_alternative<VggtConfig>(description.config);
  loader.policy = is_vggt ? ResizePolicy::kCrop : ResizePolicy::kStretch;
  loader.side_px = options.side_px;
  loader.max_pixels = options.max_pixels;
  return loader;
}

// [3, H, W] in [0, 1]
at::Tensor ToTensor(const RgbImage& image) {
  static_assert(sizeof(Rgb) == 3, "pixels lie one after the other");
  const at::Tensor bytes = at::from_blob(const_cast<Rgb*>(image.data().data()),
                                         {image.height(), image.width(), 3},
                                         at::TensorOptions(at::kByte));
  return bytes.permute({2, 0, 1}).to(at::kFloat).div_(255.0);
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
        image_folder_(image_folder),
        image_names_(image_names),
        on_prediction_(on_prediction),
        progress_(progress),
        loader_(LoaderOf(network.description, options)),
        work_(WorkUnitsOf(network.description)) {}

  PredictSummary Run() {
    Place();
    const std::vector<ViewChunk> chunks =
        PlanChunks(static_cast<int>(image_names_.size()), MaxViews(), options_.num_overlap_views);
    for (const ViewChunk& chunk : chunks) total_ += (chunk.end - chunk.begin) * work_.OfView();
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
  };

  void Place() {
    std::vector<ImageSize> sizes(image_names_.size());
    ParallelFor(static_cast<int64_t>(sizes.size()), options_.num_threads, [&](int64_t i) {
      const fs::path path = image_folder_ / image_names_[static_cast<size_t>(i)];
      const ImageSize size = ReadImageSize(path);
      const std::string fault = FindFault(size, loader_);
      if (!fault.empty()) Fail(path, "has " + fault, "a photo", "leave it out");
      sizes[static_cast<size_t>(i)] = size;
    });
    placements_ = PlacePhotos(sizes, loader_);
    summary_.network_width = placements_.front().geometry.network_width;
    summary_.network_height = placements_.front().geometry.network_height;
  }

  // The memory that a pass may take beside what the process holds already.
  int64_t MemoryForPass() const {
    constexpr double kUsableShare = 0.9;
    const auto limit = static_cast<int64_t>(options_.max_memory_gib * kGib);
    if (network_.device.is_cuda()) {
      const std::vector<Gpu> gpus = ListGpus();
      const auto idx = static_cast<size_t>(std::max<int>(0, network_.device.index()));
      const double on_board = idx < gpus.size() ? static_cast<double>(gpus[idx].memory_bytes) : 0.0;
      const int64_t total = limit > 0 ? limit : static_cast<int64_t>(kUsableShare * on_board);
      return total - network_.weights_bytes;
    }
    if (network_.release_memory) network_.release_memory();
    if (limit > 0) return limit - ResidentMemory();
    return static_cast<int64_t>(kUsableShare * static_cast<double>(AvailableMemory()));
  }

  int MaxViews() const {
    if (options_.max_views_at_once > 0) return options_.max_views_at_once;
    const auto num_views = static_cast<int64_t>(image_names_.size());
    const MemoryEstimate need =
        EstimateMemory(network_.description, summary_.network_width, summary_.network_height);
    const int64_t fitting = (MemoryForPass() - need.fixed) / need.per_view;
    if (fitting < std::min<int64_t>(2, num_views)) {
      const double missing = static_cast<double>(need.fixed + 2 * need.per_view - MemoryForPass());
      throw Error("memory: two views of " + std::to_string(summary_.network_width) + "x" +
                  std::to_string(summary_.network_height) + " pixels do not fit, " +
                  std::to_string(static_cast<int64_t>(missing / kGib * 1024.0) + 1) +
                  " MiB more are needed; raise --max_memory or use smaller images (--side_px)");
    }
    return static_cast<int>(std::min(fitting, num_views));
  }

  // [S, 3, H, W] on the CPU
  at::Tensor LoadImages(const ViewChunk& chunk) {
    const Stopwatch stopwatch(summary_.load_sec);
    const at::Tensor images = at::empty(
        {chunk.end - chunk.begin, 3, summary_.network_height, summary_.network_width}, at::kFloat);
    ParallelFor(chunk.end - chunk.begin, options_.num_threads, [&](int64_t i) {
      const c10::InferenceMode inference;  // a mode is its thread's own
      const auto view = static_cast<size_t>(chunk.begin + i);
      const RgbImage photo = ReadRgbImageOnWhite(image_folder_ / image_names_[view]);
      images[i].copy_(ToTensor(MakeNetworkImage(photo, placements_[view], loader_)));
    });
    return images;
  }

  // Encodes a chunk with its reference in front.
  Pass Encode(const ViewChunk& chunk) {
    at::Tensor images = LoadImages(chunk).to(network_.device);
    const Stopwatch stopwatch(summary_.encode_sec);
    const int64_t num_views = images.size(0);
    const int64_t reference = ReferenceOf(images);
    Pass pass;
    pass.rank.resize(static_cast<size_t>(num_views));
    std::iota(pass.rank.begin(), pass.rank.end(), 0);
    if (reference > 0) {
      std::vector<int64_t> order = pass.rank;
      std::rotate(order.begin(), order.begin() + reference, order.begin() + reference + 1);
      for (size_t i = 0; i < order.size(); ++i) {
        pass.rank[static_cast<size_t>(order[i])] = static_cast<int64_t>(i);
      }
      images = images.index_select(0, at::tensor(order).to(images.device()));
    }
    int64_t pending = work_.encoder;
    EncodeOptions encode;
    encode.on_layer = [&](int64_t, const at::Tensor&) {
      if (network_.release_memory) network_.release_memory();
      Advance(num_views * (1 + std::exchange(pending, 0)));
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
    const DenseOutputs maps = network_.model->PredictMaps(pass.features, rank, rank + 1);
    ConvertedView converted = ConvertView(image_names_[static_cast<size_t>(view)],
                                          placements_[static_cast<size_t>(view)],
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
        summary_.rejected_views.push_back(image_names_[static_cast<size_t>(view)] + ": " +
                                          converted.fault);
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
            return prediction.view.name == image_names_[static_cast<size_t>(view)];
          });
      if (!converted.fault.empty() || known == last_views_.end()) continue;
      in_chunk.push_back(std::move(converted.prediction));
      in_world.push_back(std::move(*known));
    }
    std::optional<AlignedChunk> aligned;
    if (!in_chunk.empty()) aligned = AlignChunk(in_chunk, in_world);
    if (!aligned) {
      throw Error("the views " + image_names_[static_cast<size_t>(chunk.begin)] + " to " +
                  image_names_[static_cast<size_t>(chunk.end - 1)] +
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
  const fs::path& image_folder_;
  const std::vector<std::string>& image_names_;
  const std::function<void(const ViewPrediction&)>& on_prediction_;
  const ProgressCallback& progress_;
  PreprocessOptions loader_;
  WorkUnits work_;
  std::vector<PhotoPlacement> placements_;
  std::vector<ViewPrediction> last_views_;  // in the world, for the next chunk
  PredictSummary summary_;
  int64_t done_ = 0;
  int64_t total_ = 0;
};

}  // namespace

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
  // LibTorch starts with one thread where the environment says so or a CPU quota misleads it.
  at::set_num_threads(ResolveThreads(options.num_threads));
  const c10::InferenceMode inference;
  return PredictRun(network, options, image_folder, image_names, on_prediction, progress).Run();
}

}  // namespace vgtw
