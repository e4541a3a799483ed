// SPDX-License-Identifier: BSD-3-Clause
#include "network/probe_run.h"

#include "network/predict_convert.h"
#include "network/probe.h"
#include "network/runtime.h"
#include "scene/error.h"

#include <algorithm>
#include <cmath>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

namespace vgtw {
namespace {

int64_t NumLayers(const NetworkDescription& description) {
  if (const auto* vggt = std::get_if<VggtConfig>(&description.config)) return vggt->depth;
  return std::get<Pi3Config>(description.config).depth / 2;
}

std::vector<int64_t> LayersOf(const ProbeRequest& request, int64_t num_layers) {
  if (request.layers.empty()) return {num_layers - 1};
  for (const int64_t layer : request.layers) {
    if (layer >= 0 && layer < num_layers) continue;
    throw Error("layer " + std::to_string(layer) + ": the network has layers 0 to " +
                std::to_string(num_layers - 1));
  }
  return request.layers;
}

// The patch of the queried pixel.
PatchQuery QueryOf(const ProbeRequest& request, const PhotoLoader& photos) {
  int view = 0;
  while (view < photos.num_views() && photos.name(view) != request.image_name) ++view;
  if (view == photos.num_views()) {
    throw Error("query: no photo is named " + Printable(request.image_name));
  }
  const PhotoPlacement& placement = photos.placement(view);
  const Eigen::Vector2d pixel =
      Apply(Inverse(placement.geometry.original_from_network), request.pixel_in_original);
  const auto& [photo_width, photo_height] = placement.photo_size;
  const bool is_on_photo = (request.pixel_in_original.array() >= 0.0).all() &&
                           request.pixel_in_original.x() < static_cast<double>(photo_width) &&
                           request.pixel_in_original.y() < static_cast<double>(photo_height);
  if (!is_on_photo || !(pixel.array() >= 0.0).all() || !(pixel.x() < photos.network_width()) ||
      !(pixel.y() < photos.network_height())) {
    throw Error("query: pixel " + std::to_string(request.pixel_in_original.x()) + "," +
                std::to_string(request.pixel_in_original.y()) + " is outside of what the network " +
                "sees of " + Printable(request.image_name) + ", " + std::to_string(photo_width) +
                "x" + std::to_string(photo_height));
  }
  return {view,
          static_cast<int64_t>(std::floor(pixel.y() / kPatchSize)),
          static_cast<int64_t>(std::floor(pixel.x() / kPatchSize))};
}

std::vector<Grid<float>> ToGrids(const at::Tensor& maps) {
  std::vector<Grid<float>> grids;
  for (int64_t i = 0; i < maps.size(0); ++i) grids.push_back(ToGrid(maps[i]));
  return grids;
}

std::vector<ProbedLayer> ToLayers(const std::vector<PatchProbe>& probes,
                                  const std::vector<int64_t>& layers,
                                  const at::Tensor& excluded_patches) {
  std::vector<ProbedLayer> probed;
  for (size_t i = 0; i < probes.size(); ++i) {
    ProbedLayer layer;
    layer.layer = layers[i];
    layer.similarity = ToGrids(probes[i].similarity);
    layer.attention = ToGrids(probes[i].attention);
    layer.special_attention = probes[i].special_attention;
    if (excluded_patches.defined()) {
      layer.distractor_attention =
          (probes[i].attention.flatten(1) * excluded_patches).sum().item<double>();
    }
    probed.push_back(std::move(layer));
  }
  return probed;
}

}  // namespace

ProbeSummary ProbeViews(const ReadyNetwork& network,
                        const PredictOptions& options,
                        const std::filesystem::path& image_folder,
                        const std::vector<std::string>& image_names,
                        const ProbeRequest& request,
                        const ProgressCallback& progress) {
  VGTW_CHECK(!image_names.empty(), "no photos");
  UseThreads(options.num_threads);
  const c10::InferenceMode inference;
  const int64_t num_layers = NumLayers(network.description);
  const std::vector<int64_t> layers = LayersOf(request, num_layers);
  const PhotoLoader photos(
      image_folder, image_names, LoaderOf(network.description, options), options.num_threads);
  const PatchQuery query = QueryOf(request, photos);
  const int num_fitting = MaxViewsAtOnce(network, options.max_memory_gib, photos);
  if (num_fitting < photos.num_views()) {
    throw Error(std::to_string(photos.num_views()) + " photos do not fit into memory at once, " +
                std::to_string(num_fitting) + " do; give fewer, or raise --max_memory");
  }
  const at::Tensor images = photos.Load(0, photos.num_views()).to(network.device);
  at::Tensor excluded;
  if (options.read_static_mask) {
    excluded = ExcludedPatches(photos.LoadExcluded(0, photos.num_views(), options.read_static_mask))
                   .to(network.device);
  }

  EncodeOptions encode;
  int64_t num_done = 0;
  const int64_t num_passes = excluded.defined() ? 2 : 1;
  encode.on_block = [&] {
    if (network.release_memory) network.release_memory();
    if (progress) progress(++num_done, num_passes * NumBlocks(network.description));
  };
  ProbeSummary summary;
  summary.layers =
      ToLayers(ProbePatch(*network.model, images, query, layers, encode), layers, excluded);
  if (excluded.defined()) {
    encode.excluded_patches = excluded;
    summary.masked_layers =
        ToLayers(ProbePatch(*network.model, images, query, layers, encode), layers, excluded);
  }
  for (int view = 0; view < photos.num_views(); ++view) {
    PixelMap map = photos.placement(view).geometry.original_from_network;
    map.leftCols<2>() *= static_cast<double>(kPatchSize);
    summary.original_from_patch.push_back(map);
  }
  summary.query_view = static_cast<size_t>(query.view);
  summary.query_row = query.row;
  summary.query_column = query.column;
  return summary;
}

}  // namespace vgtw
