// SPDX-License-Identifier: BSD-3-Clause
#include "network/probe_run.h"

#include "network/probe.h"
#include "scene/safetensors.h"
#include "tests/network/tiny_network.h"
#include "tests/support/bytes.h"
#include "tests/support/colmap.h"

#include <numeric>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

// Photos of 120 x 84 become 70 x 56 pixels, 5 x 4 patches of 24 x 21 original pixels: 84 * 70 / 120
// = 49 rows are rounded to 56.
class ProbeRun : public testing::Test {
 protected:
  ProbeRun() : model_(WriteTinyVgtw(weights_)) {}

  ProbeSummary Probe(const ProbeRequest& request, PredictOptions options = {}) const {
    options.side_px = 70;
    return Predictor({weights_}, options).Probe(scene_.folder.path(), scene_.names, request);
  }
  ProbeRequest Request(double x, double y, std::vector<int64_t> layers) const {
    return {scene_.names[1], {x, y}, std::move(layers)};
  }
  at::Tensor Images() const {
    PreprocessOptions loader;
    loader.side_px = 70;
    return scene_.Images(loader);
  }

  const TinyScene scene_{2};
  const TemporaryFolder folder_;
  const std::filesystem::path weights_ = folder_ / "weights.safetensors";
  const std::unique_ptr<Model> model_;
};

void ExpectEqual(const std::vector<Grid<float>>& grids, const at::Tensor& maps) {
  ASSERT_EQ(static_cast<int64_t>(grids.size()), maps.size(0));
  for (size_t i = 0; i < grids.size(); ++i) {
    EXPECT_TRUE(at::allclose(
        at::tensor(grids[i].data()), maps[static_cast<int64_t>(i)].flatten(), 1e-5, 1e-7));
  }
}

TEST_F(ProbeRun, GivesTheMapsOfTheModelForThePatchOfThePixel) {
  const ProbeSummary probed = Probe(Request(3 * 24 + 1.0, 2 * 21 + 1.0, {1, 3}));
  EXPECT_EQ(probed.query_view, 1u);
  EXPECT_EQ(probed.query_row, 2);
  EXPECT_EQ(probed.query_column, 3);
  const Eigen::Vector2d end = Apply(probed.original_from_patch[0], Eigen::Vector2d(5.0, 4.0));
  EXPECT_NEAR((end - Eigen::Vector2d(120.0, 84.0)).norm(), 0.0, 1e-9);
  const c10::InferenceMode inference;
  const std::vector<PatchProbe> expected = ProbePatch(*model_, Images(), {1, 2, 3}, {1, 3});
  ASSERT_EQ(probed.layers.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    ExpectEqual(probed.layers[i].similarity, expected[i].similarity);
    ExpectEqual(probed.layers[i].attention, expected[i].attention);
    EXPECT_EQ(probed.layers[i].distractor_attention, 0.0);
  }
  EXPECT_TRUE(probed.masked_layers.empty());
}

TEST_F(ProbeRun, MasksShowWhatLeaksAndStopIt) {
  PredictOptions options;
  options.read_static_mask = [&](const std::string& name) {
    return StaticMask(120, 84, name == scene_.names[0] ? 0 : 255);
  };
  const ProbeSummary probed = Probe(Request(1.0, 1.0, {}), options);
  ASSERT_EQ(probed.layers.size(), 1u);
  EXPECT_EQ(probed.layers[0].layer, 3);
  const std::vector<float>& leak = probed.layers[0].attention[0].data();
  const double sum = std::accumulate(leak.begin(), leak.end(), 0.0);
  EXPECT_GT(sum, 0.01);
  EXPECT_NEAR(probed.layers[0].distractor_attention, sum, 1e-6);
  ASSERT_EQ(probed.masked_layers.size(), 1u);
  EXPECT_EQ(probed.masked_layers[0].distractor_attention, 0.0);
}

TEST_F(ProbeRun, NamesWhatDoesNotExist) {
  EXPECT_THAT(ErrorOf([&] { Probe(Request(120.0, 1.0, {})); }), HasSubstr("120x84"));
  EXPECT_THAT(ErrorOf([&] { Probe(Request(1.0, 1.0, {4})); }), HasSubstr("layers 0 to 3"));
  EXPECT_THAT(ErrorOf([&] { Probe({"c.png", {1.0, 1.0}, {}}); }), HasSubstr("named c.png"));
}

TEST_F(ProbeRun, TheCommandWritesPicturesAndMaps) {
  const std::filesystem::path out = folder_ / "probe";
  const ColmapRun run = RunColmap({"probe",
                                   "--image_path",
                                   scene_.folder.path(),
                                   "--weights_path",
                                   weights_,
                                   "--layers",
                                   "0,3",
                                   "--query_image",
                                   scene_.names[1],
                                   "--side_px",
                                   "70",
                                   "--output_path",
                                   out},
                                  VGTW_NETWORK_PROGRAM);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const ProbeSummary probed = Probe(Request(60.0, 42.0, {0, 3}));
  const SafetensorsFile maps(out / "maps.safetensors");
  const std::vector<float> values = ToFloats(maps.tensors().at("attention.layer_3"));
  std::vector<float> expected;
  for (const Grid<float>& map : probed.layers[1].attention) {
    expected.insert(expected.end(), map.data().begin(), map.data().end());
  }
  EXPECT_TRUE(at::allclose(at::tensor(values), at::tensor(expected), 1e-5, 1e-7));
  // Two rows of three pictures of 400 x 280.
  const ImageSize size = ReadImageSize(out / "layer_3.png");
  EXPECT_EQ(size, (ImageSize{3 * 400 + 4 * 8, 8 + 2 * (24 + 280 + 8)}));
}

}  // namespace
}  // namespace vgtw
