// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "network/identify.h"
#include "scene/distractor_mask.h"
#include "scene/grid.h"
#include "scene/prediction.h"
#include "scene/progress.h"
#include "scene/view.h"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

enum class Precision { kFloat32, kBfloat16, kFloat16 };

// Which view's frame a chunk is predicted in. VGGT sees the first view with other eyes than the
// rest; pi3 has no such view.
enum class ReferenceChoice {
  kFirst,
  kMostConnected  // whose picture, as DINOv2 describes it, resembles the others most on average
};

struct PredictOptions {
  std::optional<NetworkKind> kind = {};  // must be that of the weights; none = whatever they are of
  std::string device = "cpu";            // or "cuda", "cuda:1"
  Precision precision = Precision::kFloat32;
  // Width of the network's image (VGGT, VGTW), multiple of 14; 0 = that of its training.
  int side_px = 0;
  int max_pixels = 255000;    // of the network's image (pi3)
  int max_views_at_once = 0;  // 0 = as many as max_memory_gib allows
  // Views that two chunks share; fewer where chunks are so small that less than half were new.
  int num_overlap_views = 4;
  double max_memory_gib = 0.0;  // of the process, or of the GPU; 0 = what is free, less a reserve
  ReferenceChoice reference = ReferenceChoice::kFirst;
  bool with_points = false;  // also ViewPrediction::points, as the network's point head says
  // Masks of known distractors, in the photos' pixels; an empty one = none known in this photo. No
  // patch attends to one that is at least half excluded (the paper's probe, section 3.2), and
  // excluded pixels get distractor probability 1. Called from several threads.
  std::function<StaticMask(const std::string& image_name)> read_static_mask = {};
  int num_threads = 0;  // 0 = all cores

  // Throws std::invalid_argument naming the field that is out of its range.
  void Check() const;
};

// How a chunk of views was brought into the frame of those before it; residuals are those of the
// views that they share.
struct ChunkAlignment {
  int first_view = 0;  // index into image_names
  int num_views = 0;
  int num_shared_views = 0;  // that were usable in both
  double scale = 1.0;        // of world_from_chunk
  double centre_rmse = 0.0;  // scene units
  double rotation_median_deg = 0.0;
  double depth_median_percent = 0.0;  // |difference| of static depths
};

struct PredictSummary {
  int num_views = 0;
  int network_width = 0;
  int network_height = 0;
  double load_sec = 0.0;    // photos
  double encode_sec = 0.0;  // trunk and cameras
  double heads_sec = 0.0;
  double peak_memory_gib = 0.0;             // of the process
  std::vector<ChunkAlignment> alignments;   // empty if all views fitted in one pass
  std::vector<std::string> rejected_views;  // with the reason
};

// Whose attention to look at: the patch of this pixel.
struct ProbeRequest {
  std::string image_name;
  Eigen::Vector2d pixel_in_original = Eigen::Vector2d::Zero();
  // Pairs of a block within views and a block across them, counted from 0; none = the last.
  std::vector<int64_t> layers;
};

// One value per patch [rows, columns], by view in the order of the photos.
struct ProbedLayer {
  int64_t layer = 0;
  std::vector<Grid<float>> similarity;  // cosine of the layer's tokens with the query's, -1 .. 1
  std::vector<Grid<float>> attention;   // of the query to that patch, mean over the heads
  double special_attention = 0.0;       // to camera and register tokens; with all patches 1
  double distractor_attention = 0.0;    // to patches that the masks exclude
};

struct ProbeSummary {
  std::vector<ProbedLayer> layers;  // as the network is
  std::vector<ProbedLayer>
      masked_layers;  // while nothing attends to excluded patches; if there are masks
  std::vector<PixelMap> original_from_patch;  // by view; patch (column, row) ends at + 1
  size_t query_view = 0;
  int64_t query_row = 0;
  int64_t query_column = 0;
};

// Photos to predictions.
class Predictor {
 public:
  // Loads the weights; what a later file holds replaces the same names of earlier ones. Throws
  // Error for unusable weights or devices.
  Predictor(const std::vector<std::filesystem::path>& weights, const PredictOptions& options);
  ~Predictor();
  Predictor(const Predictor&) = delete;
  Predictor& operator=(const Predictor&) = delete;

  NetworkKind kind() const;

  // Calls `on_prediction` for each view as soon as it is complete, in the order of `image_names`.
  // Poses, depths and intrinsics are in the conventions of scene/view.h: original pixels with
  // centres at + 0.5, cam_from_world, confidences as the network gives them (pi3's as sigmoid). A
  // view whose camera is not usable (field of view near 0 or 180 degrees, not finite) is rejected
  // and named. `progress` counts work, not views. Throws Error for unusable photos, memory that
  // does not suffice, or chunks that cannot be aligned.
  PredictSummary Run(const std::filesystem::path& image_folder,
                     const std::vector<std::string>& image_names,
                     const std::function<void(const ViewPrediction&)>& on_prediction,
                     const ProgressCallback& progress = {}) const;

  // All photos in one pass, the first as reference. Throws Error as Run does, if the photos do not
  // fit into memory, or if the query or a layer does not exist.
  ProbeSummary Probe(const std::filesystem::path& image_folder,
                     const std::vector<std::string>& image_names,
                     const ProbeRequest& request,
                     const ProgressCallback& progress = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vgtw
