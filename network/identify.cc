// SPDX-License-Identifier: BSD-3-Clause
#include "network/identify.h"

#include "scene/error.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <utility>

namespace vgtw {
namespace {

constexpr std::array<std::pair<NetworkKind, std::string_view>, 4> kNames = {{
    {NetworkKind::kVggt, "vggt"},
    {NetworkKind::kVgtw, "vgtw"},
    {NetworkKind::kPi3, "pi3"},
    {NetworkKind::kVgtwPi3, "vgtw-pi3"},
}};

// What a damaged file may announce must neither overflow nor keep the loader busy.
constexpr uint64_t kMaxSize = uint64_t{1} << 20;
constexpr int64_t kMaxDepth = 1024;
constexpr int kMaxSide = 1 << 14;

constexpr int64_t kPublishedHeadDim = 64;
// Share of the trunk's layers at whose end a dense head reads, of the published depth.
constexpr std::array<int64_t, 4> kVggtLayerEnds = {5, 12, 18, 24};
constexpr std::array<int64_t, 4> kPi3LayerEnds = {4, 9, 14, 18};

bool IsOfLora(std::string_view name) { return name.find(".attn.lora_") != std::string_view::npos; }
bool IsOfDistractorHead(std::string_view name) { return name.starts_with("mask_head."); }

template <typename Number>
std::optional<Number> Parse(std::string_view text) {
  Number number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

std::optional<std::array<int64_t, 4>> ParseLayers(std::string_view text, int64_t depth) {
  std::array<int64_t, 4> layers = {};
  for (size_t k = 0; k < layers.size(); ++k) {
    const size_t comma = k + 1 < layers.size() ? text.find(',') : text.size();
    if (comma == std::string_view::npos) return std::nullopt;
    const auto layer = Parse<int64_t>(text.substr(0, comma));
    if (!layer || *layer < 0 || *layer >= depth) return std::nullopt;
    layers[k] = *layer;
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  return layers;
}

// Answers for sizes from names, shapes and metadata.
class Sizes {
 public:
  Sizes(const TensorShapes& shapes,
        const std::map<std::string, std::string>& metadata,
        const std::filesystem::path& path)
      : shapes_(shapes), metadata_(metadata), path_(path) {}

  bool HasBelow(std::string_view prefix) const {
    const auto next = shapes_.lower_bound(prefix);
    return next != shapes_.end() && next->first.starts_with(prefix);
  }

  bool HasAny(bool (*is_wanted)(std::string_view)) const {
    return std::any_of(
        shapes_.begin(), shapes_.end(), [&](const auto& named) { return is_wanted(named.first); });
  }

  int64_t Axis(std::string_view name, size_t rank, size_t axis, int64_t published) const {
    const auto found = shapes_.find(name);
    if (found == shapes_.end() || found->second.size() != rank) return published;
    const uint64_t size = found->second[axis];
    return size == 0 || size > kMaxSize ? published : static_cast<int64_t>(size);
  }

  // Of modules named by their number, also where some are missing.
  int64_t Depth(std::initializer_list<std::string_view> prefixes, int64_t published) const {
    int64_t depth = 0;
    for (int64_t i = 0; i < kMaxDepth; ++i) {
      for (const std::string_view prefix : prefixes) {
        if (HasBelow(std::string(prefix) + std::to_string(i) + ".")) depth = i + 1;
      }
    }
    return depth > 0 ? depth : published;
  }

  int64_t NumHeadsOfWidth(std::string_view who, int64_t dim, int64_t head_dim) const {
    if (dim % head_dim == 0) return dim / head_dim;
    Fail(path_,
         std::string(who) + " has " + std::to_string(dim) + " channels",
         "a multiple of the " + std::to_string(head_dim) + " of an attention head");
  }

  int64_t NumHeadsByKey(const char* key, int64_t dim, int64_t default_value) const {
    const std::string* text = Metadata(key);
    const auto number = text == nullptr ? default_value : Parse<int64_t>(*text);
    if (number && *number > 0 && dim % *number == 0) return *number;
    FailKey(key, "a number of attention heads that divides " + std::to_string(dim) + " channels");
  }

  double LoraAlpha(double published) const {
    const std::string* text = Metadata(kLoraAlphaKey);
    const auto alpha = text == nullptr ? published : Parse<double>(*text);
    if (alpha && std::isfinite(*alpha)) return *alpha;
    FailKey(kLoraAlphaKey, "a number");
  }

  int SideOfImages(int published) const {
    const std::string* text = Metadata(kSideKey);
    const auto side_px = text == nullptr ? published : Parse<int>(*text);
    if (side_px && *side_px > 0 && *side_px <= kMaxSide && *side_px % kPatchSize == 0) {
      return *side_px;
    }
    FailKey(kSideKey,
            "a multiple of " + std::to_string(kPatchSize) + " up to " + std::to_string(kMaxSide));
  }

  std::array<int64_t, 4> HeadLayers(const std::array<int64_t, 4>& ends, int64_t depth) const {
    if (const std::string* text = Metadata(kHeadLayersKey)) {
      if (const auto layers = ParseLayers(*text, depth)) return *layers;
      FailKey(kHeadLayersKey, "four layers from 0 to " + std::to_string(depth - 1));
    }
    std::array<int64_t, 4> layers = {};
    for (size_t k = 0; k < layers.size(); ++k) {
      const int64_t end = (2 * ends[k] * depth + ends[3]) / (2 * ends[3]);
      layers[k] = std::max<int64_t>(end, 1) - 1;
    }
    return layers;
  }

  EncoderConfig Encoder(const std::string& prefix, int64_t dim, int64_t num_heads) const {
    EncoderConfig encoder;
    encoder.dim = dim;
    encoder.num_heads = num_heads;
    encoder.depth = Depth({prefix + "blocks."}, encoder.depth);
    const int64_t published = 1 + encoder.grid_size * encoder.grid_size;
    const int64_t num_positions = Axis(prefix + "pos_embed", 3, 1, published);
    encoder.grid_size = std::lround(std::sqrt(static_cast<double>(num_positions - 1)));
    return encoder;
  }

  std::optional<LoraConfig> Lora(const std::string& first_block) const {
    if (!HasAny(IsOfLora)) return std::nullopt;
    LoraConfig lora;
    lora.rank = Axis(first_block + "attn.lora_A_q", 2, 0, lora.rank);
    lora.alpha = LoraAlpha(lora.alpha);
    return lora;
  }

  DptConfig Dpt(const std::string& head) const {
    DptConfig dpt;
    const auto layer = [&](size_t k) {
      return head + "scratch.layer" + std::to_string(k + 1) + "_rn.weight";
    };
    dpt.num_features = Axis(layer(0), 4, 0, dpt.num_features);
    for (size_t k = 0; k < 4; ++k) dpt.num_channels[k] = Axis(layer(k), 4, 1, dpt.num_channels[k]);
    return dpt;
  }

 private:
  const std::string* Metadata(const char* key) const {
    const auto found = metadata_.find(key);
    return found == metadata_.end() ? nullptr : &found->second;
  }

  [[noreturn]] void FailKey(const char* key, const std::string& expected) const {
    const std::string* text = Metadata(key);
    Fail(path_,
         text == nullptr ? std::string("has no metadata ") + key
                         : std::string("has metadata ") + key + " '" + Printable(*text) + "'",
         expected);
  }

  const TensorShapes& shapes_;
  const std::map<std::string, std::string>& metadata_;
  const std::filesystem::path& path_;
};

VggtConfig ReadVggt(const Sizes& sizes) {
  VggtConfig config;
  const std::string first_block = "aggregator.frame_blocks.0.";
  config.dim = sizes.Axis("aggregator.camera_token", 4, 3, config.dim);
  config.depth =
      sizes.Depth({"aggregator.frame_blocks.", "aggregator.global_blocks."}, config.depth);
  config.num_heads = sizes.NumHeadsOfWidth(
      "the aggregator",
      config.dim,
      sizes.Axis(first_block + "attn.q_norm.weight", 1, 0, kPublishedHeadDim));
  config.num_camera_heads =
      sizes.NumHeadsByKey(kCameraHeadsKey, 2 * config.dim, config.num_camera_heads);
  config.num_camera_blocks = sizes.Depth({"camera_head.trunk."}, config.num_camera_blocks);
  config.head_layers = sizes.HeadLayers(kVggtLayerEnds, config.depth);
  config.dpt = sizes.Dpt("depth_head.");
  config.has_point_head = sizes.HasBelow("point_head.");
  // The encoder has its own convolution one level deeper.
  config.encoder = sizes.Encoder("aggregator.patch_embed.", config.dim, config.num_heads);
  if (sizes.HasBelow("aggregator.patch_embed.proj.")) config.encoder.reset();
  config.lora = sizes.Lora(first_block);
  config.has_distractor_head = sizes.HasAny(IsOfDistractorHead);
  return config;
}

Pi3Config ReadPi3(const Sizes& sizes) {
  Pi3Config config;
  const int64_t dim = sizes.Axis("register_token", 4, 3, config.encoder.dim);
  const int64_t head_dim = sizes.Axis("decoder.0.attn.q_norm.weight", 1, 0, kPublishedHeadDim);
  config.encoder =
      sizes.Encoder("encoder.", dim, sizes.NumHeadsOfWidth("the trunk", dim, head_dim));
  const int64_t depth = sizes.Depth({"decoder."}, config.depth);
  config.depth = depth + depth % 2;  // blocks come in pairs
  config.head_dim = sizes.Axis("point_decoder.projects.weight", 2, 0, config.head_dim);
  config.num_head_heads = sizes.NumHeadsByKey(
      kDecoderHeadsKey, config.head_dim, std::max<int64_t>(config.head_dim / head_dim, 1));
  config.camera_dim = sizes.Axis("camera_decoder.linear_out.weight", 2, 0, config.camera_dim);
  config.lora = sizes.Lora("decoder.0.");
  config.has_distractor_head = sizes.HasAny(IsOfDistractorHead);
  config.head_layers = sizes.HeadLayers(kPi3LayerEnds, config.depth / 2);
  config.dpt = sizes.Dpt("mask_head.");
  return config;
}

[[noreturn]] void FailUnknown(const TensorShapes& shapes, const std::filesystem::path& path) {
  const auto is_extension = [](const auto& named) {
    return IsOfLora(named.first) || IsOfDistractorHead(named.first);
  };
  if (!shapes.empty() && std::all_of(shapes.begin(), shapes.end(), is_extension)) {
    Fail(path,
         "holds a LoRA or distractor head without the network that it extends",
         "the weights of VGGT or pi3, too",
         "give those as --weights_path and this file as --lora_path");
  }
  Fail(path,
       shapes.empty()
           ? "holds no tensor of a network"
           : "holds '" + Printable(shapes.begin()->first) + "' and " +
                 std::to_string(shapes.size() - 1) + " more tensors of no network known here",
       "the weights of VGGT, VGTW or pi3",
       "download the official file");
}

}  // namespace

std::string_view NetworkKindName(NetworkKind kind) {
  return kNames[static_cast<size_t>(kind)].second;
}

std::optional<NetworkKind> FindNetworkKind(std::string_view name) {
  for (const auto& [kind, kind_name] : kNames) {
    if (kind_name == name) return kind;
  }
  return std::nullopt;
}

TensorShapes ShapesOf(const StoredTensors& tensors) {
  TensorShapes shapes;
  for (const auto& [name, tensor] : tensors) shapes.emplace(name, tensor.shape);
  return shapes;
}

bool IsOfTracker(std::string_view tensor_name) { return tensor_name.starts_with("track_head."); }

NetworkDescription IdentifyNetwork(const TensorShapes& shapes,
                                   const std::map<std::string, std::string>& metadata,
                                   const std::filesystem::path& path) {
  const Sizes sizes(shapes, metadata, path);
  const auto is_of_vggt = [](std::string_view name) {
    return name.starts_with("aggregator.") && !IsOfLora(name);
  };
  if (sizes.HasAny(is_of_vggt)) {
    VggtConfig config = ReadVggt(sizes);
    const bool is_vgtw = config.lora || config.has_distractor_head;
    NetworkDescription network{is_vgtw ? NetworkKind::kVgtw : NetworkKind::kVggt,
                               std::move(config)};
    network.side_px = sizes.SideOfImages(network.side_px);
    return network;
  }
  if (sizes.HasBelow("encoder.") || sizes.HasBelow("point_decoder.")) {
    Pi3Config config = ReadPi3(sizes);
    const bool is_vgtw = config.lora || config.has_distractor_head;
    return {is_vgtw ? NetworkKind::kVgtwPi3 : NetworkKind::kPi3, std::move(config)};
  }
  FailUnknown(shapes, path);
}

}  // namespace vgtw
