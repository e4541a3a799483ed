// SPDX-License-Identifier: BSD-3-Clause
#include "network/identify.h"

#include "tests/parity/parity_formula.h"
#include "tests/support/bytes.h"
#include "tests/support/shared_data.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using Metadata = std::map<std::string, std::string>;

NetworkDescription Identify(const TensorShapes& shapes, const Metadata& metadata = {}) {
  return IdentifyNetwork(shapes, metadata, "w.safetensors");
}

std::string ErrorFor(const TensorShapes& shapes, const Metadata& metadata = {}) {
  return ErrorOf([&] { Identify(shapes, metadata); });
}

TensorShapes ReadShapes(const std::filesystem::path& path) {
  TensorShapes shapes;
  for (const auto& [name, shape] : ReadParityShapes(path)) {
    shapes[name] = {shape.begin(), shape.end()};
  }
  return shapes;
}

void AddDpt(const std::string& head, TensorShapes& shapes) {
  const std::array<uint64_t, 4> channels = {16, 24, 32, 40};
  for (size_t k = 0; k < channels.size(); ++k) {
    shapes[head + "scratch.layer" + std::to_string(k + 1) + "_rn.weight"] = {8, channels[k], 3, 3};
  }
}

// The tensors that tell sizes: 48 channels in 3 heads, 6 layers, an encoder of 2.
TensorShapes SmallVggt() {
  TensorShapes shapes = {{"aggregator.camera_token", {1, 2, 1, 48}},
                         {"aggregator.frame_blocks.0.attn.q_norm.weight", {16}},
                         {"aggregator.global_blocks.5.norm1.bias", {48}},
                         {"aggregator.patch_embed.blocks.1.norm1.bias", {48}},
                         {"aggregator.patch_embed.patch_embed.proj.bias", {48}},
                         {"aggregator.patch_embed.pos_embed", {1, 122, 48}}};
  AddDpt("depth_head.", shapes);
  return shapes;
}

TensorShapes SmallPi3() {
  return {{"register_token", {1, 1, 5, 48}},
          {"decoder.0.attn.q_norm.weight", {16}},
          {"decoder.5.norm1.bias", {48}},
          {"encoder.blocks.1.norm1.bias", {48}},
          {"encoder.pos_embed", {1, 122, 48}},
          {"point_decoder.projects.weight", {64, 96}},
          {"camera_decoder.linear_out.weight", {32, 64}}};
}

TensorShapes WithLora(TensorShapes shapes, const std::string& first_block) {
  shapes[first_block + "attn.lora_A_q"] = {4, 48};
  AddDpt("mask_head.", shapes);
  return shapes;
}

TEST(IdentifyNetwork, ReadsTheSizesOfVggt) {
  const NetworkDescription found = Identify(SmallVggt());
  EXPECT_EQ(found.kind, NetworkKind::kVggt);
  const auto& config = std::get<VggtConfig>(found.config);
  EXPECT_EQ(config.dim, 48);
  EXPECT_EQ(config.depth, 6);
  EXPECT_EQ(config.num_heads, 3);
  EXPECT_EQ(config.num_camera_heads, 16);
  // Ends at 5, 12, 18 and 24 of 24 layers: 1.25, 3, 4.5 and 6 of 6, rounded half up.
  EXPECT_THAT(config.head_layers, ElementsAre(0, 2, 4, 5));
  EXPECT_EQ(config.dpt.num_features, 8);
  EXPECT_THAT(config.dpt.num_channels, ElementsAre(16, 24, 32, 40));
  ASSERT_TRUE(config.encoder);
  EXPECT_EQ(config.encoder->dim, 48);
  EXPECT_EQ(config.encoder->depth, 2);
  EXPECT_EQ(config.encoder->num_heads, 3);
  EXPECT_EQ(config.encoder->grid_size, 11);
  EXPECT_FALSE(config.lora);
  EXPECT_FALSE(config.has_distractor_head);
}

TEST(IdentifyNetwork, SeesThatPatchesAreEmbeddedByOneConvolution) {
  TensorShapes shapes = {{"aggregator.camera_token", {1, 2, 1, 64}},
                         {"aggregator.patch_embed.proj.weight", {64, 3, 14, 14}}};
  EXPECT_FALSE(std::get<VggtConfig>(Identify(shapes).config).encoder);
}

TEST(IdentifyNetwork, TellsVgtwByItsLoraAndItsDistractorHead) {
  const NetworkDescription found = Identify(WithLora(SmallVggt(), "aggregator.frame_blocks.0."));
  EXPECT_EQ(found.kind, NetworkKind::kVgtw);
  const auto& config = std::get<VggtConfig>(found.config);
  ASSERT_TRUE(config.lora);
  EXPECT_EQ(config.lora->rank, 4);
  EXPECT_EQ(config.lora->alpha, 16.0);
  EXPECT_TRUE(config.has_distractor_head);
}

TEST(IdentifyNetwork, ReadsTheSizesOfPi3) {
  const NetworkDescription found = Identify(SmallPi3());
  EXPECT_EQ(found.kind, NetworkKind::kPi3);
  const auto& config = std::get<Pi3Config>(found.config);
  EXPECT_EQ(config.encoder.dim, 48);
  EXPECT_EQ(config.encoder.depth, 2);
  EXPECT_EQ(config.encoder.num_heads, 3);
  EXPECT_EQ(config.encoder.grid_size, 11);
  EXPECT_EQ(config.depth, 6);
  EXPECT_EQ(config.head_dim, 64);
  EXPECT_EQ(config.num_head_heads, 4);  // 16 wide, as the trunk's
  EXPECT_EQ(config.camera_dim, 32);
}

TEST(IdentifyNetwork, TellsVgtwOnPi3) {
  const NetworkDescription found = Identify(WithLora(SmallPi3(), "decoder.0."));
  EXPECT_EQ(found.kind, NetworkKind::kVgtwPi3);
  const auto& config = std::get<Pi3Config>(found.config);
  EXPECT_EQ(config.lora->rank, 4);
  EXPECT_THAT(config.dpt.num_channels, ElementsAre(16, 24, 32, 40));
  // Ends at 4, 9, 14 and 18 of 18 pairs of blocks: 0.67, 1.5, 2.33 and 3 of 3.
  EXPECT_THAT(config.head_layers, ElementsAre(0, 1, 1, 2));
}

TEST(IdentifyNetwork, MetadataTellWhatShapesDoNot) {
  const NetworkDescription found =
      Identify(WithLora(SmallVggt(), "aggregator.frame_blocks.0."),
               {{kCameraHeadsKey, "4"}, {kLoraAlphaKey, "2.5"}, {kHeadLayersKey, "1,2,4,5"}});
  const auto& config = std::get<VggtConfig>(found.config);
  EXPECT_EQ(config.num_camera_heads, 4);
  EXPECT_EQ(config.lora->alpha, 2.5);
  EXPECT_THAT(config.head_layers, ElementsAre(1, 2, 4, 5));
  const auto pi3 = Identify(SmallPi3(), {{kDecoderHeadsKey, "8"}});
  EXPECT_EQ(std::get<Pi3Config>(pi3.config).num_head_heads, 8);
}

TEST(IdentifyNetwork, MetadataThatDoNotFitAreAnError) {
  const TensorShapes vgtw = WithLora(SmallVggt(), "aggregator.frame_blocks.0.");
  for (const char* text : {"", "5", "0", "-4", "4x", "99999999999999999999"}) {
    EXPECT_THAT(ErrorFor(vgtw, {{kCameraHeadsKey, text}}),
                HasSubstr(std::string("w.safetensors: has metadata vgtw.camera_heads '") + text +
                          "', expected a number of attention heads that divides 96 channels"));
  }
  for (const char* text : {"", "1,2,4", "1,2,4,6", "1,2,4,5,5", "-1,2,4,5", "1,,4,5", "1, 2,4,5"}) {
    EXPECT_THAT(ErrorFor(vgtw, {{kHeadLayersKey, text}}), HasSubstr("expected four layers"));
  }
  for (const char* text : {"", "nan", "inf", "1 "}) {
    EXPECT_THAT(ErrorFor(vgtw, {{kLoraAlphaKey, text}}), HasSubstr("expected a number"));
  }
}

TEST(IdentifyNetwork, HeadsThatDoNotDivideTheWidthAreAnError) {
  TensorShapes shapes = SmallVggt();
  shapes["aggregator.frame_blocks.0.attn.q_norm.weight"] = {20};
  EXPECT_THAT(ErrorFor(shapes), HasSubstr("the aggregator has 48 channels"));
  shapes["aggregator.camera_token"] = {1, 2, 1, 20};
  EXPECT_THAT(ErrorFor(shapes), HasSubstr("has no metadata vgtw.camera_heads"));
}

TEST(IdentifyNetwork, SizesThatNothingTellsAreThePublishedOnes) {
  const auto config = std::get<VggtConfig>(Identify({{"aggregator.other", {}}}).config);
  EXPECT_EQ(config.dim, 1024);
  EXPECT_EQ(config.depth, 24);
  EXPECT_EQ(config.num_heads, 16);
  EXPECT_EQ(config.encoder->grid_size, 37);
  EXPECT_THAT(config.head_layers, ElementsAre(4, 11, 17, 23));
}

TEST(IdentifyNetwork, AbsurdSizesAreNotBelieved) {
  TensorShapes shapes = SmallVggt();
  shapes["aggregator.camera_token"] = {1, 2, 0, uint64_t{1} << 62};
  shapes["aggregator.frame_blocks.0.attn.q_norm.weight"] = {0};
  shapes["aggregator.frame_blocks.99999999999999999999.norm1.bias"] = {48};
  const auto config = std::get<VggtConfig>(Identify(shapes).config);
  EXPECT_EQ(config.dim, 1024);
  EXPECT_EQ(config.num_heads, 16);
  EXPECT_EQ(config.depth, 6);
}

TEST(IdentifyNetwork, LoraWithoutItsBaseIsAnErrorThatSaysSo) {
  for (const char* block : {"aggregator.frame_blocks.0.", "decoder.0."}) {
    EXPECT_THAT(
        ErrorFor(WithLora({}, block)),
        testing::AllOf(HasSubstr("without the network that it extends"), HasSubstr("--lora_path")));
  }
}

TEST(IdentifyNetwork, OtherNetworksAreAnErrorThatQuotesThem) {
  EXPECT_THAT(ErrorFor({{"conv1.weight", {64, 3, 7, 7}}, {"fc.bias", {10}}}),
              HasSubstr("holds 'conv1.weight' and 1 more tensors of no network known here"));
  EXPECT_THAT(ErrorFor({}), HasSubstr("holds no tensor of a network"));
}

TEST(IdentifyNetwork, KindsHaveNamesAndBack) {
  for (const auto kind :
       {NetworkKind::kVggt, NetworkKind::kVgtw, NetworkKind::kPi3, NetworkKind::kVgtwPi3}) {
    EXPECT_EQ(FindNetworkKind(NetworkKindName(kind)), kind);
  }
  EXPECT_EQ(FindNetworkKind("VGGT"), std::nullopt);
}

// The published state dicts: all sizes are the defaults.
TEST(IdentifyNetwork, PublishedNetworksHaveTheDefaultSizes) {
  VGTW_NEED_PARITY_DATA();
  const auto read = [](const char* name) {
    return Identify(ReadShapes(ParityData() / ("state_dict." + std::string(name) + ".txt")));
  };
  for (const char* name : {"VGGT-1B", "VGTW-LoRA"}) {
    const NetworkDescription found = read(name);
    const auto& config = std::get<VggtConfig>(found.config);
    const VggtConfig expected;
    EXPECT_EQ(config.dim, expected.dim);
    EXPECT_EQ(config.depth, expected.depth);
    EXPECT_EQ(config.num_heads, expected.num_heads);
    EXPECT_EQ(config.num_camera_heads, expected.num_camera_heads);
    EXPECT_EQ(config.head_layers, expected.head_layers);
    EXPECT_EQ(config.dpt.num_features, expected.dpt.num_features);
    EXPECT_EQ(config.dpt.num_channels, expected.dpt.num_channels);
    ASSERT_TRUE(config.encoder);
    EXPECT_EQ(config.encoder->depth, expected.encoder->depth);
    EXPECT_EQ(config.encoder->num_heads, expected.encoder->num_heads);
    EXPECT_EQ(config.encoder->grid_size, expected.encoder->grid_size);
    const bool is_vgtw = found.kind == NetworkKind::kVgtw;
    EXPECT_EQ(is_vgtw, std::string(name) == "VGTW-LoRA");
    EXPECT_EQ(config.lora.has_value(), is_vgtw);
    EXPECT_EQ(config.has_distractor_head, is_vgtw);
    EXPECT_EQ(config.lora.value_or(LoraConfig{}).rank, 32);
  }
  const NetworkDescription found = read("Pi3");
  EXPECT_EQ(found.kind, NetworkKind::kPi3);
  const auto& config = std::get<Pi3Config>(found.config);
  const Pi3Config expected;
  EXPECT_EQ(config.encoder.dim, expected.encoder.dim);
  EXPECT_EQ(config.encoder.depth, expected.encoder.depth);
  EXPECT_EQ(config.encoder.num_heads, expected.encoder.num_heads);
  EXPECT_EQ(config.encoder.grid_size, expected.encoder.grid_size);
  EXPECT_EQ(config.depth, expected.depth);
  EXPECT_EQ(config.head_dim, expected.head_dim);
  EXPECT_EQ(config.num_head_heads, expected.num_head_heads);
  EXPECT_EQ(config.camera_dim, expected.camera_dim);
  EXPECT_EQ(config.head_layers, expected.head_layers);
}

}  // namespace
}  // namespace vgtw
