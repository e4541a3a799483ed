// SPDX-License-Identifier: BSD-3-Clause
// Single operations against the official ones, and the laws that whole networks cannot show.
#include "network/layers.h"

#include "network/attention.h"
#include "network/camera_geometry.h"
#include "network/dpt_head.h"
#include "network/rotary_embedding.h"
#include "network/vision_transformer.h"
#include "tests/parity/parity_fixture.h"
#include "tests/parity/parity_formula.h"
#include "tests/support/shared_data.h"

#include <cmath>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

class Operations : public testing::Test {
 protected:
  void SetUp() override {
    VGTW_NEED_PARITY_DATA();
    expected_ = ReadParityTensors(ParityData() / "ops.safetensors");
  }
  void Expect(const std::string& name, const at::Tensor& found) {
    const at::Tensor& expected = expected_.at(name);
    ASSERT_EQ(found.numel(), expected.numel()) << name;
    EXPECT_LE(RatioToTolerance(found, expected), 1.0) << name;
  }
  std::map<std::string, at::Tensor> expected_;
};

at::Tensor Random(const std::string& name, const Shape& shape) {
  int64_t count = 1;
  for (const int64_t length : shape) count *= length;
  return at::tensor(ParityRandom(name, static_cast<size_t>(count))).view(shape);
}

TEST_F(Operations, RotaryEmbedding) {
  EXPECT_TRUE(at::equal(TokenPositions(5, 4, 6).expand({2, -1, -1}), expected_.at("rope.pos")));
  const RotaryTable table = MakeRotaryTable(5, 4, 6, 16, at::kCPU);
  Expect("rope.out", Rotate(Random("ops.rope.x", {2, 3, 29, 16}), table));
}

TEST_F(Operations, PositionEmbeddingsOfOtherGrids) {
  for (const int64_t grid : {11, 37}) {
    const std::string number = std::to_string(grid);
    const at::Tensor positions = Random("ops.pos_embed." + number, {1, 1 + grid * grid, 8});
    const std::vector<std::pair<int64_t, int64_t>> sizes = {
        {grid, grid}, {4, 6}, {7, 5}, {3, 13}, {28, 37}, {37, 28}, {16, 16}};
    for (const auto& [rows, columns] : sizes) {
      Expect("pos_embed." + number + "." + std::to_string(rows) + "x" + std::to_string(columns),
             ResizePositions(positions, rows, columns));
    }
  }
}

TEST_F(Operations, PositionMaps) {
  struct Case {
    int64_t width, height, image_width, image_height, num_channels;
  };
  for (const Case& c :
       std::vector<Case>{{6, 4, 84, 56, 16}, {37, 28, 518, 392, 32}, {5, 7, 70, 98, 24}}) {
    const std::string label = std::to_string(c.width) + "x" + std::to_string(c.height) + "." +
                              std::to_string(c.image_width) + "x" + std::to_string(c.image_height);
    const double aspect = static_cast<double>(c.image_width) / static_cast<double>(c.image_height);
    Expect("uv." + label, PositionGrid(c.height, c.width, aspect));
    Expect("uv_embed." + label + "." + std::to_string(c.num_channels),
           PositionMap(c.num_channels, c.height, c.width, aspect));
  }
}

TEST_F(Operations, FusionAddsTheActivatedInput) {
  FormulaSource source;
  const ParameterScope scope = ParameterScope(source)["block"];
  const FusionBlock block(scope, 8, /*has_side=*/true);
  const at::Tensor x = Random("ops.fusion.x0", {1, 8, 5, 7});
  Expect("fusion.out", block(x, Random("ops.fusion.x1", {1, 8, 5, 7}), 9, 13));
  FormulaSource again;
  Expect("resconv.out", ResidualUnit(ParameterScope(again)["block"]["resConfUnit2"], 8)(x));
}

TEST_F(Operations, Poses) {
  const at::Tensor encodings = expected_.at("pose.enc")[0];
  const CameraMatrices cameras = DecodePoses(encodings, 392, 518);
  Expect("pose.ext", cameras.cam_from_world);
  Expect("pose.intr", cameras.intrinsics);
  Expect("pose.roundtrip", EncodePoses(cameras, 392, 518));
  const at::Tensor rotations = RotationsFromQuaternions(encodings.slice(1, 3, 7));
  Expect("pose.quat_to_mat", rotations);
  Expect("pose.mat_to_quat", QuaternionsFromRotations(rotations));
  const at::Tensor inverse = InvertPoses(cameras.cam_from_world);
  EXPECT_LE(RatioToTolerance(inverse, expected_.at("pose.inverse_se3").slice(1, 0, 3)), 1.0);
  const at::Tensor depth = Random("ops.depth", {6, 8, 10}).abs() + 0.5;
  Expect("unproject.out",
         Unproject(depth, {cameras.cam_from_world, expected_.at("unproject.intr")}));
}

TEST_F(Operations, Pi3Rotations) {
  Expect("pi3.svd_orthogonalize", NearestRotations(Random("ops.pi3.rot", {6, 9})));
}

// 1200 keys are more than one chunk of rows at the smallest budget; a chunk's softmax is complete.
TEST(Attend, EqualsTheWholeMatrix) {
  const at::Tensor q = Random("q", {2, 3, 1200, 8}).to(at::kDouble) * 3.0;
  const at::Tensor k = Random("k", {2, 3, 1200, 8}).to(at::kDouble) * 3.0;
  const at::Tensor v = Random("v", {2, 3, 1200, 5}).to(at::kDouble);
  const at::Tensor logits = at::matmul(q, k.transpose(2, 3)) / std::sqrt(8.0);
  const at::Tensor expected = at::matmul(at::softmax(logits, 3), v);
  EXPECT_LT((Attend(q, k, v) - expected).abs().max().item<double>(), 1e-13);
}

TEST(Attend, ExcludedKeysHaveNoInfluence) {
  const at::Tensor q = Random("q", {1, 2, 6, 4});
  at::Tensor k = Random("k", {1, 2, 6, 4});
  at::Tensor v = Random("v", {1, 2, 6, 4});
  const at::Tensor excluded = at::tensor({0, 1, 0, 0, 1, 0}).to(at::kBool).unsqueeze(0);
  const at::Tensor kept = at::tensor({0, 2, 3, 5});
  const at::Tensor without = Attend(q, k.index_select(2, kept), v.index_select(2, kept));
  EXPECT_LT((Attend(q, k, v, excluded) - without).abs().max().item<double>(), 1e-6);
}

// Norms that golden outputs cannot tell apart because 1e-5 and 1e-6 differ too little there.
TEST(LayerNorm, UsesItsEps) {
  FormulaSource source;
  const ParameterScope scope = ParameterScope(source)["norm"];
  const at::Tensor x = 1e-3 * Random("x", {4, 16});
  const at::Tensor centred = x - x.mean(1, true);
  const at::Tensor variance = centred.square().mean(1, true);
  const at::Tensor weight = at::tensor(ParityWeights("norm.weight", {16}));
  const at::Tensor bias = at::tensor(ParityWeights("norm.bias", {16}));
  const at::Tensor expected = centred / (variance + 1e-6).sqrt() * weight + bias;
  EXPECT_LT((LayerNorm(scope, 16, 1e-6)(x) - expected).abs().max().item<double>(), 1e-6);
}

}  // namespace
}  // namespace vgtw
