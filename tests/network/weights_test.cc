// SPDX-License-Identifier: BSD-3-Clause
#include "network/weights.h"

#include "network/checkpoint_convert.h"
#include "network/weights_audit.h"
#include "scene/files.h"
#include "tests/network/tiny_network.h"
#include "tests/parity/parity_fixture.h"
#include "tests/parity/parity_formula.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <cmath>
#include <cstring>
#include <map>

#include <ATen/ATen.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

const std::map<std::string, std::string> kTinyMetadata = {{kCameraHeadsKey, "2"},
                                                          {kLoraAlphaKey, "1"}};

NetworkDescription TinyVgtwNetwork() {
  VggtConfig config = TinyVgtw(16);
  config.num_camera_heads = 2;
  config.lora->alpha = 1.0;
  return {NetworkKind::kVgtw, config};
}

NetworkDescription TinyPi3() {
  Pi3Config config;
  config.encoder = {.dim = 16, .depth = 1, .num_heads = 2, .grid_size = 3};
  config.depth = 4;
  config.head_dim = 16;
  config.num_head_heads = 2;
  config.camera_dim = 8;
  return {NetworkKind::kPi3, config};
}

bool IsOfExtension(const std::string& name) {
  return name.starts_with("mask_head.") || name.find("lora_") != std::string::npos;
}

// Tensors to be written, with their bytes.
class Weights {
 public:
  Weights() = default;
  // The formula's, of this network.
  explicit Weights(const NetworkDescription& description) {
    FormulaSource source;
    BuildModel(ParameterScope(source), description);
    for (const auto& [name, shape] : source.shapes()) {
      const at::Tensor tensor = FormulaSource().Get(name, shape, at::kFloat);
      Set(name,
          TensorType::kF32,
          {shape.begin(), shape.end()},
          std::string(static_cast<const char*>(tensor.data_ptr()), tensor.nbytes()));
    }
  }

  void Set(const std::string& name,
           TensorType type,
           const std::vector<uint64_t>& shape,
           const std::string& bytes) {
    rows_[name] = {type, shape, bytes};
  }
  void SetFloat(const std::string& name, size_t index, float value) {
    std::memcpy(rows_.at(name).bytes.data() + index * sizeof(value), &value, sizeof(value));
  }
  void Erase(const std::string& name) { EXPECT_EQ(rows_.erase(name), 1u) << name; }

  template <typename IsWanted>
  Weights Only(const IsWanted& is_wanted) const {
    Weights part = *this;
    std::erase_if(part.rows_, [&](const auto& named) { return !is_wanted(named.first); });
    return part;
  }
  StoredTensors tensors() const {
    StoredTensors tensors;
    for (const auto& [name, row] : rows_) {
      tensors[name] = {row.type, row.shape, AsBytes(row.bytes)};
    }
    return tensors;
  }

 private:
  struct Row {
    TensorType type = TensorType::kF32;
    std::vector<uint64_t> shape;
    std::string bytes;
  };
  std::map<std::string, Row> rows_;
};

class LoadNetworkTest : public testing::Test {
 protected:
  std::filesystem::path Write(const std::string& name,
                              const Weights& weights,
                              const std::map<std::string, std::string>& metadata = kTinyMetadata) {
    WriteSafetensors(folder_ / name, weights.tensors(), metadata);
    return folder_ / name;
  }
  std::string ErrorFor(const Weights& weights, const LoadOptions& options = {}) {
    const auto path = Write("bad.safetensors", weights);
    return ErrorOf([&] { LoadNetwork({path}, options); });
  }

  TemporaryFolder folder_;
  const Weights vgtw_ = Weights(TinyVgtwNetwork());
};

// Of two views of 28 x 42 pixels: everything that a network predicts.
std::vector<at::Tensor> OutputsOf(const Model& model) {
  const at::NoGradGuard no_gradient;
  const at::Tensor images =
      at::tensor(ParityPixels("images.weights", 2, 28, 42)).view({2, 3, 28, 42}).to(at::kFloat) /
      255.0f;
  const Features features = model.Encode(images, {});
  const DenseOutputs maps = model.PredictMaps(features, 0, 2, {});
  std::vector<at::Tensor> outputs = {model.PredictCameras(features).cam_from_world};
  for (const at::Tensor& map : {maps.depth, maps.depth_conf, maps.distractor_logits}) {
    if (map.defined()) outputs.push_back(map);
  }
  return outputs;
}

void ExpectBitEqual(const Model& found, const Model& expected) {
  const std::vector<at::Tensor> a = OutputsOf(found);
  const std::vector<at::Tensor> b = OutputsOf(expected);
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) EXPECT_TRUE(at::equal(a[i], b[i])) << i;
}

std::unique_ptr<Model> ModelOfFormula(const NetworkDescription& description) {
  FormulaSource source;
  return BuildModel(ParameterScope(source), description);
}

TEST_F(LoadNetworkTest, GivesTheNetworkThatWasWritten) {
  const LoadedNetwork vgtw = LoadNetwork({Write("vgtw.safetensors", vgtw_)}, {});
  EXPECT_EQ(vgtw.description.kind, NetworkKind::kVgtw);
  EXPECT_THAT(vgtw.ignored, ElementsAre());
  ExpectBitEqual(*vgtw.model, *ModelOfFormula(TinyVgtwNetwork()));
  const auto pi3_path = Write("pi3.safetensors", Weights(TinyPi3()), {});
  ExpectBitEqual(*LoadNetwork({pi3_path}, {}).model, *ModelOfFormula(TinyPi3()));
}

TEST_F(LoadNetworkTest, ReleasedPagesComeBack) {
  const LoadedNetwork network = LoadNetwork({Write("vgtw.safetensors", vgtw_)}, {});
  const std::vector<at::Tensor> before = OutputsOf(*network.model);
  network.ReleasePages();
  const std::vector<at::Tensor> after = OutputsOf(*network.model);
  for (size_t i = 0; i < before.size(); ++i) EXPECT_TRUE(at::equal(before[i], after[i]));
}

TEST_F(LoadNetworkTest, ALaterFileExtendsAndReplacesAnEarlierOne) {
  Weights base = vgtw_.Only([](const std::string& name) { return !IsOfExtension(name); });
  const std::string bias = "depth_head.norm.bias";
  Weights extension =
      vgtw_.Only([&](const std::string& name) { return IsOfExtension(name) || name == bias; });
  base.SetFloat(bias, 0, 77.0f);
  const auto base_path = Write("base.safetensors", base, {{kCameraHeadsKey, "2"}});
  const auto extension_path =
      Write("lora.safetensors", extension, {{kLoraAlphaKey, "1"}, {kCameraHeadsKey, "2"}});
  EXPECT_EQ(LoadNetwork({base_path}, {}).description.kind, NetworkKind::kVggt);
  const LoadedNetwork both = LoadNetwork({base_path, extension_path}, {});
  ExpectBitEqual(*both.model, *ModelOfFormula(TinyVgtwNetwork()));

  ConvertCheckpoint(OpenWeights({base_path, extension_path}),
                    TensorType::kF32,
                    folder_ / "merged.safetensors",
                    /*overwrite=*/false);
  EXPECT_EQ(ReadFile(folder_ / "merged.safetensors"), ReadFile(Write("one.safetensors", vgtw_)));
}

TEST_F(LoadNetworkTest, TensorsOfTheTrackerAreIgnoredAndListed) {
  Weights weights = vgtw_;
  weights.Set("track_head.corr.weight", TensorType::kF32, {1}, Bytes(NAN));
  const LoadedNetwork network = LoadNetwork({Write("t.safetensors", weights)}, {});
  EXPECT_THAT(network.ignored, ElementsAre("track_head.corr.weight"));
}

TEST_F(LoadNetworkTest, EveryProblemIsToldInOneLine) {
  Weights weights = vgtw_;
  for (const char* layer : {"norm1.bias", "norm1.weight", "norm2.bias", "norm2.weight"}) {
    weights.Erase("aggregator.frame_blocks.2." + std::string(layer));
  }
  weights.Set("aggregator.frame_blocks.0.norm1.bias", TensorType::kF32, {4, 4}, std::string(64, 0));
  weights.Set("aggregator.frame_blocks.0.norm2.bias", TensorType::kI64, {16}, std::string(128, 0));
  weights.SetFloat("camera_head.token_norm.bias", 31, NAN);
  weights.SetFloat("camera_head.token_norm.weight", 5, -INFINITY);
  weights.Set("extra\n.bias", TensorType::kF32, {1}, Bytes(1.0f));
  EXPECT_THAT(
      ErrorFor(weights),
      testing::EndsWith(
          "bad.safetensors: lacks 4 tensors (aggregator.frame_blocks.2.norm1.bias, "
          "aggregator.frame_blocks.2.norm1.weight, aggregator.frame_blocks.2.norm2.bias, ...); "
          "has another shape for 1 tensor (aggregator.frame_blocks.0.norm1.bias is 4x4, not 16); "
          "has no floating-point numbers in 1 tensor (aggregator.frame_blocks.0.norm2.bias is "
          "I64); has NaN or infinity in 2 tensors (camera_head.token_norm.bias, "
          "camera_head.token_norm.weight); has 1 tensor (extra?.bias) that the network does not "
          "know, expected exactly the weights of vgtw; download the official file again"));
}

TEST_F(LoadNetworkTest, ATensorThatTellsASizeIsExpectedByItsName) {
  Weights weights(TinyPi3());
  weights.Set("encoder.pos_embed", TensorType::kF32, {1, 12, 16}, std::string(12 * 64, 0));
  EXPECT_THAT(ErrorFor(weights), HasSubstr("encoder.pos_embed is 1x12x16, not 1x10x16"));
  weights.Set("encoder.pos_embed", TensorType::kF32, {10, 16}, std::string(10 * 64, 0));
  EXPECT_THAT(ErrorFor(weights), HasSubstr("encoder.pos_embed is 10x16, not 1x1370x16"));
}

TEST_F(LoadNetworkTest, NanIsFoundInEveryType) {
  const std::string name = "camera_head.token_norm.bias";  // of 32
  const auto with = [&](TensorType type, const std::string& number) {
    Weights weights = vgtw_;
    const size_t num_zeros = 31 * SizeInBytes(type);
    weights.Set(name, type, {32}, std::string(num_zeros, 0) + number);
    return ErrorFor(weights);
  };
  const std::string expected = "has NaN or infinity in 1 tensor (camera_head.token_norm.bias)";
  EXPECT_THAT(with(TensorType::kF64, Bytes(double{INFINITY})), HasSubstr(expected));
  EXPECT_THAT(with(TensorType::kF32, Bytes(float{-NAN})), HasSubstr(expected));
  EXPECT_THAT(with(TensorType::kF16, Bytes(uint16_t{0x7c00})), HasSubstr(expected));
  EXPECT_THAT(with(TensorType::kBF16, Bytes(uint16_t{0xff80})), HasSubstr(expected));
  // The largest finite numbers.
  EXPECT_EQ(with(TensorType::kF16, Bytes(uint16_t{0x7bff})), "");
  EXPECT_EQ(with(TensorType::kBF16, Bytes(uint16_t{0xff7f})), "");
  EXPECT_EQ(with(TensorType::kF32, Bytes(3.4028235e38f)), "");
}

TEST_F(LoadNetworkTest, ValuesAreNotLookedAtUnlessWanted) {
  Weights weights = vgtw_;
  weights.SetFloat("camera_head.token_norm.bias", 0, NAN);
  EXPECT_EQ(ErrorFor(weights, {.check_values = false}), "");
}

TEST_F(LoadNetworkTest, AnotherKindThanWantedIsAnError) {
  const Weights base = vgtw_.Only([](const std::string& name) { return !IsOfExtension(name); });
  EXPECT_THAT(ErrorFor(base, {.kind = NetworkKind::kVgtw}),
              AllOf(HasSubstr("holds the weights of vggt, expected those of vgtw"),
                    HasSubstr("--lora_path")));
  EXPECT_THAT(ErrorFor(base, {.kind = NetworkKind::kPi3}), testing::EndsWith("those of pi3"));
  EXPECT_EQ(ErrorFor(base, {.kind = NetworkKind::kVggt}), "");
}

TEST_F(LoadNetworkTest, FilesThatAreNoWeightsAreErrors) {
  const Weights lora = vgtw_.Only(IsOfExtension);
  EXPECT_THAT(ErrorFor(lora), HasSubstr("without the network that it extends"));
  const auto error_of_bytes = [&](const std::string& bytes) {
    WriteFileAtomically(folder_ / "bytes", bytes);
    return ErrorOf([&] { LoadNetwork({folder_ / "bytes"}, {}); });
  };
  const std::string good = ReadFile(Write("good.safetensors", vgtw_));
  EXPECT_THAT(error_of_bytes(""), HasSubstr("is of no known format (0 bytes)"));
  EXPECT_THAT(error_of_bytes(good.substr(0, good.size() / 2)), HasSubstr("truncated or damaged"));
  EXPECT_THAT(error_of_bytes(good.substr(0, good.size() - 1)), HasSubstr("truncated or damaged"));
  EXPECT_THAT(ErrorOf([&] { LoadNetwork({folder_ / "none"}, {}); }), HasSubstr("cannot be read"));
}

class CheckpointSourceTest : public testing::Test {
 protected:
  Checkpoint Stored(TensorType type, const std::string& bytes, size_t num_padding = 0) {
    const std::string header = R"({"a": {"dtype": ")" + std::string(TensorTypeName(type)) +
                               R"(", "shape": [3], "data_offsets": [0, )" +
                               std::to_string(bytes.size()) + "]}}" + std::string(num_padding, ' ');
    WriteFileAtomically(folder_ / "a", Bytes(uint64_t{header.size()}, header, bytes));
    return Checkpoint(folder_ / "a");
  }
  static at::Tensor Get(const Checkpoint& checkpoint, at::ScalarType type) {
    return CheckpointSource(checkpoint).Get("a", {3}, type);
  }

  TemporaryFolder folder_;
};

TEST_F(CheckpointSourceTest, FloatsAreTheBytesOfTheFileWhereTheyAreAligned) {
  const std::string bytes = Bytes(1.5f, -2.25f, 1e-30f);
  int num_views = 0;
  for (size_t num_padding = 0; num_padding < 4; ++num_padding) {
    const Checkpoint checkpoint = Stored(TensorType::kF32, bytes, num_padding);
    const at::Tensor tensor = Get(checkpoint, at::kFloat);
    EXPECT_TRUE(at::equal(tensor, at::tensor({1.5f, -2.25f, 1e-30f})));
    EXPECT_EQ(reinterpret_cast<uintptr_t>(tensor.data_ptr()) % alignof(float), 0u);
    if (tensor.data_ptr() == checkpoint.tensors().at("a").bytes.data()) ++num_views;
  }
  EXPECT_EQ(num_views, 1);
}

TEST_F(CheckpointSourceTest, OtherTypesAreConverted) {
  const at::Tensor expected = at::tensor({1.5f, -2.25f, 0.125f});
  const auto get = [&](TensorType type, const std::string& bytes) {
    return Get(Stored(type, bytes), at::kFloat);
  };
  EXPECT_TRUE(at::equal(get(TensorType::kF64, Bytes(1.5, -2.25, 0.125)), expected));
  EXPECT_TRUE(
      at::equal(get(TensorType::kF16, Bytes(uint16_t{0x3e00}, uint16_t{0xc080}, uint16_t{0x3000})),
                expected));
  EXPECT_TRUE(
      at::equal(get(TensorType::kBF16, Bytes(uint16_t{0x3fc0}, uint16_t{0xc010}, uint16_t{0x3e00})),
                expected));
  const Checkpoint floats = Stored(TensorType::kF32, Bytes(1.5f, -2.25f, 0.125f));
  EXPECT_TRUE(at::equal(Get(floats, at::kBFloat16), expected.to(at::kBFloat16)));
}

TEST_F(CheckpointSourceTest, ValuesThatATypeCannotHoldAreAnError) {
  const Checkpoint large = Stored(TensorType::kF32, Bytes(0.0f, 65520.0f, 1.0f));
  EXPECT_THAT(ErrorOf([&] { Get(large, at::kHalf); }),
              HasSubstr("tensor 'a' has values too large for Half"));
  EXPECT_EQ(Get(large, at::kBFloat16)[1].item<float>(), 65536.0f);
  const Checkpoint brain =
      Stored(TensorType::kBF16, Bytes(uint16_t{0x7f00}, uint16_t{0}, uint16_t{0}));
  EXPECT_THAT(ErrorOf([&] { Get(brain, at::kHalf); }), HasSubstr("too large"));
}

TEST_F(CheckpointSourceTest, WhatWasNotAuditedBreaksTheContract) {
  const Checkpoint checkpoint = Stored(TensorType::kF32, Bytes(1.0f, 2.0f, 3.0f));
  CheckpointSource source(checkpoint);
  EXPECT_THROW(source.Get("b", {3}, at::kFloat), std::invalid_argument);
  EXPECT_THROW(source.Get("a", {1, 3}, at::kFloat), std::invalid_argument);
  const Checkpoint bytes = Stored(TensorType::kU8, "abc");
  EXPECT_THROW(Get(bytes, at::kFloat), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
