// SPDX-License-Identifier: BSD-3-Clause
// Photos and a file of weights to predictions, against what the model itself says.
#include "network/predict.h"

#include "bridge/predictions.h"
#include "network/preprocess.h"
#include "network/vggt.h"
#include "scene/safetensors.h"
#include "scene/synthetic.h"
#include "tests/parity/parity_fixture.h"
#include "tests/support/bytes.h"
#include "tests/support/colmap.h"
#include "tests/support/temporary_folder.h"

#include <map>
#include <memory>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

VggtConfig TinyVgtw() {
  VggtConfig config;
  config.encoder = EncoderConfig{.dim = 64, .depth = 1, .num_heads = 2, .grid_size = 3};
  config.dim = 64;
  config.depth = 4;
  config.num_heads = 2;
  config.head_layers = {0, 1, 2, 3};
  config.dpt = {.num_features = 8, .num_channels = {8, 8, 8, 8}};
  config.lora = LoraConfig{.rank = 2};
  config.has_distractor_head = true;
  return config;
}

// Formula weights as a file; their network is returned, too.
std::unique_ptr<Model> WriteTinyVgtw(const std::filesystem::path& path) {
  FormulaSource source;
  auto model = std::make_unique<Vggt>(ParameterScope(source), TinyVgtw());
  std::map<std::string, at::Tensor> values;
  StoredTensors tensors;
  for (const auto& [name, shape] : source.shapes()) {
    FormulaSource again;
    const at::Tensor& value = values[name] = again.Get(name, shape, at::kFloat).contiguous();
    tensors[name] = {TensorType::kF32,
                     {shape.begin(), shape.end()},
                     {reinterpret_cast<const std::byte*>(value.data_ptr<float>()),
                      static_cast<size_t>(value.numel()) * sizeof(float)}};
  }
  WriteSafetensors(path, tensors);
  return model;
}

struct TinyScene {
  TemporaryFolder folder;
  std::vector<std::string> names;
  std::vector<ImageSize> sizes;

  explicit TinyScene(int num_views) {
    SyntheticOptions options;
    options.num_views = num_views;
    options.width = 120;
    options.height = 84;
    const SyntheticScene scene(options);
    for (size_t i = 0; i < scene.views().size(); ++i) {
      names.push_back(scene.views()[i].name);
      sizes.push_back({120, 84});
      WriteImage(folder / names.back(), scene.Render(i).image);
    }
  }

  at::Tensor Images(const PreprocessOptions& options) const {
    const std::vector<PhotoPlacement> placements = PlacePhotos(sizes, options);
    std::vector<at::Tensor> images;
    for (size_t i = 0; i < names.size(); ++i) {
      const RgbImage image =
          MakeNetworkImage(ReadRgbImage(folder.path() / names[i]), placements[i], options);
      std::vector<float> values;
      for (size_t channel = 0; channel < 3; ++channel) {
        for (const Rgb& pixel : image.data()) values.push_back(pixel[channel] / 255.0f);
      }
      images.push_back(at::tensor(values).view({3, image.height(), image.width()}));
    }
    return at::stack(images);
  }
};

// Predictions of the scene's photos against what the model itself says about them. Files hold
// probabilities in float16, hence `distractor_rounding`.
void ExpectEqualsTheModel(const TinyScene& scene,
                          const Model& model,
                          const std::vector<ViewPrediction>& views,
                          double distractor_rounding) {
  ASSERT_EQ(views.size(), scene.names.size());
  const auto num_views = static_cast<int64_t>(views.size());
  const c10::InferenceMode inference;
  PreprocessOptions loader;
  loader.side_px = 70;
  const Features features = model.Encode(scene.Images(loader), {});
  const CameraOutputs cameras = model.PredictCameras(features);
  const DenseOutputs maps = model.PredictMaps(features, 0, num_views);
  for (int64_t i = 0; i < num_views; ++i) {
    const ViewPrediction& view = views[static_cast<size_t>(i)];
    EXPECT_EQ(view.view.name, scene.names[static_cast<size_t>(i)]);
    // The heads run on one view at a time here, whose products are summed in another order.
    EXPECT_TRUE(at::allclose(at::tensor(view.depth.data()), maps.depth[i].flatten(), 1e-5));
    EXPECT_TRUE(at::allclose(at::tensor(view.distractor.data()),
                             maps.distractor_logits[i].sigmoid().flatten(),
                             0.0,
                             distractor_rounding));
    const double fx = cameras.intrinsics[i][0][0].item().toDouble();
    EXPECT_NEAR(view.view.camera.FocalLengthX(), fx * 120.0 / 70.0, 1e-4 * fx);
    EXPECT_NEAR(view.view.camera.PrincipalPoint().x(), 60.0, 1e-9);
    const at::Tensor pose = cameras.cam_from_world[i].to(at::kDouble);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) {
        EXPECT_NEAR(view.view.cam_from_world.ToMatrix()(row, column),
                    pose[row][column].item().toDouble(),
                    1e-5);
      }
    }
  }
}

TEST(Predictor, GivesTheNumbersOfTheModelForOneViewAndForSome) {
  for (const int num_views : {1, 3}) {
    const TinyScene scene(num_views);
    const std::unique_ptr<Model> model = WriteTinyVgtw(scene.folder / "weights.safetensors");
    PredictOptions options;
    options.side_px = 70;
    options.kind = NetworkKind::kVgtw;
    const Predictor predictor({scene.folder / "weights.safetensors"}, options);
    EXPECT_EQ(predictor.kind(), NetworkKind::kVgtw);
    std::vector<ViewPrediction> views;
    const auto keep = [&](const ViewPrediction& view) { views.push_back(view); };
    const PredictSummary summary = predictor.Run(scene.folder.path(), scene.names, keep);
    EXPECT_TRUE(summary.rejected_views.empty());
    EXPECT_GT(summary.peak_memory_gib, 0.01);
    ExpectEqualsTheModel(scene, *model, views, 1e-6);
  }
}

TEST(PredictCommand, WritesTheNumbersOfTheModel) {
  const TinyScene scene(2);
  const TemporaryFolder folder;
  const std::unique_ptr<Model> model = WriteTinyVgtw(folder / "weights.safetensors");
  const ColmapRun run = RunColmap({"predict",
                                   "--image_path",
                                   scene.folder.path(),
                                   "--weights_path",
                                   folder / "weights.safetensors",
                                   "--output_path",
                                   folder / "predictions",
                                   "--side_px",
                                   "70"},
                                  VGTW_NETWORK_PROGRAM);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("2 views at 70x56"));
  EXPECT_THAT(run.output, HasSubstr("Next: vgtw run --image_path"));
  const Prediction written = ReadPrediction(folder / "predictions");
  EXPECT_EQ(written.producer, "vgtw");
  EXPECT_EQ(written.weights_hash.size(), 64u);
  ExpectEqualsTheModel(scene, *model, written.views, 5e-4);
}

TEST(Predictor, TellsWhichDevicesThereAre) {
  const TemporaryFolder folder;
  WriteTinyVgtw(folder / "weights.safetensors");
  PredictOptions options;
  options.device = "tpu";
  EXPECT_THAT(ErrorOf([&] { Predictor({folder / "weights.safetensors"}, options); }),
              HasSubstr("expected cpu, cuda"));
  options.device = "cpu";
  options.precision = Precision::kFloat16;
  EXPECT_THAT(ErrorOf([&] { Predictor({folder / "weights.safetensors"}, options); }),
              HasSubstr("use fp32 or bf16"));
}

}  // namespace
}  // namespace vgtw
