// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "network/config.h"
#include "scene/safetensors.h"

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace vgtw {

enum class NetworkKind { kVggt, kVgtw, kPi3, kVgtwPi3 };
std::string_view NetworkKindName(NetworkKind kind);  // "vggt", "vgtw", "pi3", "vgtw-pi3"
std::optional<NetworkKind> FindNetworkKind(std::string_view name);

// A network and all of its sizes.
struct NetworkDescription {
  NetworkKind kind = NetworkKind::kVggt;
  std::variant<VggtConfig, Pi3Config> config;
  int side_px = 518;  // of the images that it was trained on, for a VGGT
};

// By the name that they have in the official state dicts.
using TensorShapes = std::map<std::string, std::vector<uint64_t>, std::less<>>;
TensorShapes ShapesOf(const StoredTensors& tensors);

// Tensors of VGGT's point tracker, which no network here has.
bool IsOfTracker(std::string_view tensor_name);

// Keys of a .safetensors file's metadata for what shapes do not tell. The values are decimal.
inline constexpr char kCameraHeadsKey[] = "vgtw.camera_heads";    // VGGT, VGTW
inline constexpr char kDecoderHeadsKey[] = "vgtw.decoder_heads";  // pi3: of its three decoders
inline constexpr char kLoraAlphaKey[] = "vgtw.lora_alpha";
inline constexpr char kHeadLayersKey[] = "vgtw.head_layers";  // "4,11,17,23"
inline constexpr char kSideKey[] = "vgtw.side_px";

// Which network these tensors are of, told by their names, and its sizes, told by their shapes.
// Where neither shapes nor `metadata` tell a size, it is as in the published networks: 16 heads of
// attention in the camera head, in pi3's decoders heads as wide as in its trunk, LoRA with alpha =
// 16, head layers at the same fractions of the depth. Where the tensor that tells a size is missing
// or of another rank, the size is the published one: whoever loads the network will miss the
// tensor. Throws Error if the tensors are of no network, for instance of a LoRA without its base,
// or if attention heads or the metadata do not fit the shapes; `path` is for messages.
NetworkDescription IdentifyNetwork(const TensorShapes& shapes,
                                   const std::map<std::string, std::string>& metadata,
                                   const std::filesystem::path& path);

}  // namespace vgtw
