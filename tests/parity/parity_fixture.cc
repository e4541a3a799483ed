// SPDX-License-Identifier: BSD-3-Clause
#include "tests/parity/parity_fixture.h"

#include "network/camera_geometry.h"
#include "network/pi3.h"
#include "network/rotary_embedding.h"
#include "network/vggt.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/safetensors.h"
#include "tests/parity/parity_formula.h"

#include <fstream>
#include <ostream>

#include <ATen/ATen.h>
#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using nlohmann::json;
using Outputs = std::map<std::string, at::Tensor>;

EncoderConfig EncoderOf(const json& config, const char* dim) {
  return {.dim = config.at(dim),
          .depth = config.at("dino_depth"),
          .num_heads = config.at("num_heads"),
          .grid_size = config.at("img_size").get<int64_t>() / kPatchSize};
}

VggtConfig VggtOf(const json& config) {
  VggtConfig vggt;
  vggt.dim = config.at("embed_dim");
  vggt.depth = config.at("depth");
  vggt.num_heads = config.at("num_heads");
  vggt.num_camera_heads = config.at("camera_heads");
  vggt.head_layers = config.at("layers");
  vggt.dpt = {.num_features = config.at("features"), .num_channels = config.at("out_channels")};
  vggt.encoder.reset();
  if (config.at("patch_embed") == "dinov2") vggt.encoder = EncoderOf(config, "embed_dim");
  if (config.contains("lora_r")) {
    vggt.lora = LoraConfig{.rank = config.at("lora_r"), .alpha = config.at("lora_alpha")};
    vggt.has_distractor_head = true;
  }
  return vggt;
}

Pi3Config Pi3Of(const json& config) {
  Pi3Config pi3;
  pi3.encoder = EncoderOf(config, "enc_dim");
  pi3.depth = config.at("dec_depth");
  pi3.head_dim = config.at("head_dim_embed");
  pi3.num_head_heads = config.at("head_heads");
  pi3.camera_dim = config.at("camera_dim");
  return pi3;
}

// The published sizes by the fixture's name.
std::variant<VggtConfig, Pi3Config> FullConfig(const std::string& fixture) {
  if (fixture.starts_with("pi3")) return Pi3Config{};
  VggtConfig vggt;
  if (fixture.starts_with("vgtw")) {
    vggt.lora = LoraConfig{};
    vggt.has_distractor_head = true;
  }
  return vggt;
}

bool IsNetwork(const std::string& fixture) {
  return fixture.starts_with("vggt") || fixture.starts_with("vgtw") || fixture.starts_with("pi3");
}

void AddMaps(const DenseOutputs& maps, Outputs& outputs) {
  const auto add = [&](const char* name, const at::Tensor& tensor) {
    if (tensor.defined()) outputs[name] = tensor;
  };
  add("depth_mask", maps.distractor_logits);
  if (maps.local_points.defined()) {
    add("local_points", maps.local_points);
    add("conf", maps.depth_conf.unsqueeze(3));
    return;
  }
  add("depth", maps.depth.unsqueeze(3));
  add("depth_conf", maps.depth_conf);
  add("world_points", maps.points);
  add("world_points_conf", maps.points_conf);
}

void AddPi3(const ParityCase& parity_case,
            const Pi3& model,
            const at::Tensor& images,
            const Features& features,
            const CameraOutputs& cameras,
            Outputs& outputs) {
  outputs["encoder"] = model.EncodePatches(images);
  outputs["decoder"] = features.last;
  outputs["camera_hidden"] = model.DecodeCameraTokens(features);
  outputs["pos"] =
      TokenPositions(
          kNumSpecialTokens, parity_case.height / kPatchSize, parity_case.width / kPatchSize)
          .expand({parity_case.num_views, -1, -1});
  const at::Tensor world_from_cam = InvertPoses(cameras.cam_from_world);
  const at::Tensor bottom = at::tensor({0.0f, 0.0f, 0.0f, 1.0f}).expand({images.size(0), 1, 4});
  outputs["camera_poses"] = at::cat({world_from_cam, bottom}, 1);
  const at::Tensor local = outputs.at("local_points");
  const at::Tensor rotated =
      at::bmm(local.flatten(1, 2), world_from_cam.slice(2, 0, 3).transpose(1, 2));
  outputs["points"] = (rotated + world_from_cam.select(2, 3).unsqueeze(1)).view(local.sizes());
}

void AddVggt(const Vggt& model,
             const at::Tensor& images,
             const CameraOutputs& cameras,
             Outputs& outputs) {
  const bool is_vgtw = outputs.contains("depth_mask");
  outputs["pose_enc"] = is_vgtw ? cameras.pose_encodings[-1] : cameras.pose_encodings;
  outputs["extrinsic"] = cameras.cam_from_world;
  outputs["intrinsic"] = cameras.intrinsics;
  outputs["world_points_from_depth"] =
      Unproject(outputs.at("depth").squeeze(3), {cameras.cam_from_world, cameras.intrinsics});
  const auto& encoder = model.aggregator().encoder();
  if (!encoder) return;
  const at::Tensor normalised = NormaliseImages(images);
  outputs["dino.x_prenorm"] = encoder->EncodeWithoutNorm(normalised);
  outputs["dino.x_norm_patchtokens"] = (*encoder)(normalised);
}

}  // namespace

void PrintTo(const ParityCase& parity_case, std::ostream* stream) {
  *stream << parity_case.Label();
}

std::vector<ParityCase> ReadParityCases(const std::filesystem::path& folder, bool is_full) {
  std::vector<ParityCase> cases;
  const json manifest = json::parse(ReadFile(folder / "manifest.json"));
  for (const auto& [fixture, entry] : manifest.items()) {
    if (!IsNetwork(fixture) || entry.contains("config") == is_full) continue;
    ParityCase parity_case;
    parity_case.fixture = fixture;
    parity_case.is_full = is_full;
    const auto add = [&](const std::string& name, const json& input) {
      parity_case.name = name;
      parity_case.num_views = input.at("S");
      parity_case.height = input.at("H");
      parity_case.width = input.at("W");
      cases.push_back(parity_case);
    };
    if (is_full) {
      parity_case.config = FullConfig(fixture);
      add("full", entry);
      continue;
    }
    const json& config = entry.at("config");
    if (config.contains("enc_dim")) {
      parity_case.config = Pi3Of(config);
    } else {
      parity_case.config = VggtOf(config);
    }
    for (const auto& [name, input] : entry.at("cases").items()) add(name, input);
  }
  return cases;
}

at::Tensor FormulaSource::Get(const std::string& name, const Shape& shape, at::ScalarType type) {
  if (!shapes_.emplace(name, shape).second) throw Error(name + ": asked for twice");
  // Buffers keep their constants.
  if (name == "image_mean") return ImageNetStatistics(at::kCPU).mean;
  if (name == "image_std") return ImageNetStatistics(at::kCPU).deviation;
  const std::vector<float> values = ParityWeights(name, shape);
  return at::tensor(values).view(shape).to(type);
}

ParityModel MakeParityModel(const ParityCase& parity_case) {
  FormulaSource source;
  const ParameterScope scope(source);
  ParityModel made;
  if (const auto* pi3 = std::get_if<Pi3Config>(&parity_case.config)) {
    made.model = std::make_unique<Pi3>(scope, *pi3);
  } else {
    made.model = std::make_unique<Vggt>(scope, std::get<VggtConfig>(parity_case.config));
  }
  made.shapes = source.shapes();
  return made;
}

at::Tensor MakeParityImages(const ParityCase& parity_case) {
  std::vector<uint8_t> bytes =
      ParityImages(parity_case.name, parity_case.num_views, parity_case.height, parity_case.width);
  return at::tensor(bytes, at::kByte)
             .view({parity_case.num_views, 3, parity_case.height, parity_case.width})
             .to(at::kFloat) /
         255.0f;
}

Outputs RunParityCase(const ParityCase& parity_case, const Model& model) {
  const at::Tensor images = MakeParityImages(parity_case);
  Outputs outputs;
  EncodeOptions options;
  options.on_layer = [&](int64_t layer, const at::Tensor& tokens) {
    outputs["tokens." + std::to_string(layer)] = tokens;
  };
  const Features features = model.Encode(images, options);
  const CameraOutputs cameras = model.PredictCameras(features);
  AddMaps(model.PredictMaps(features, 0, features.num_views(), {}), outputs);
  if (const auto* pi3 = dynamic_cast<const Pi3*>(&model)) {
    AddPi3(parity_case, *pi3, images, features, cameras, outputs);
  } else {
    AddVggt(dynamic_cast<const Vggt&>(model), images, cameras, outputs);
  }
  return outputs;
}

double RatioToTolerance(const at::Tensor& a, const at::Tensor& b) {
  const at::Tensor expected = b.to(at::kDouble);
  const at::Tensor found = a.to(at::kDouble).reshape(expected.sizes());
  const at::Tensor magnitude = expected.abs();
  const at::Tensor tolerance = 1e-4 * magnitude + 1e-4 * magnitude.mean();
  return ((found - expected).abs() / tolerance).max().item<double>();
}

std::map<std::string, at::Tensor> ReadParityTensors(const std::filesystem::path& path) {
  const SafetensorsFile file(path);
  std::map<std::string, at::Tensor> tensors;
  for (const auto& [name, stored] : file.tensors()) {
    const at::ScalarType type = stored.type == TensorType::kF32   ? at::kFloat
                                : stored.type == TensorType::kF64 ? at::kDouble
                                : stored.type == TensorType::kI64 ? at::kLong
                                                                  : at::kByte;
    VGTW_CHECK(SizeInBytes(stored.type) == c10::elementSize(type), "type of " + name);
    const std::vector<int64_t> shape(stored.shape.begin(), stored.shape.end());
    tensors[name] =
        at::from_blob(const_cast<std::byte*>(stored.bytes.data()), shape, at::dtype(type)).clone();
  }
  return tensors;
}

}  // namespace vgtw
