// SPDX-License-Identifier: BSD-3-Clause
// Photos and a file of weights to predictions, against what the model itself says.
#include "network/predict.h"

#include "bridge/predictions.h"
#include "network/preprocess.h"
#include "tests/network/tiny_network.h"
#include "tests/support/bytes.h"
#include "tests/support/colmap.h"
#include "tests/support/temporary_folder.h"

#include <memory>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

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
  const DenseOutputs maps = model.PredictMaps(features, 0, num_views, {});
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

// bfloat16 keeps 8 bits: a rounding is off by up to 0.2 %, and some tens of layers add theirs up at
// random to about 1 or 2 %. What is wrong is off by its own size.
TEST(Predictor, Bfloat16OnTheCpuStaysNearFloat32) {
  const TinyScene scene(2);
  WriteTinyVgtw(scene.folder / "weights.safetensors");
  const auto predict = [&](Precision precision) {
    PredictOptions options;
    options.side_px = 70;
    options.precision = precision;
    std::vector<ViewPrediction> views;
    Predictor({scene.folder / "weights.safetensors"}, options)
        .Run(scene.folder.path(), scene.names, [&](const ViewPrediction& view) {
          views.push_back(view);
        });
    return views;
  };
  const auto rms_difference = [](const Grid<float>& a, const Grid<float>& b) {
    return (at::tensor(a.data()) - at::tensor(b.data())).square().mean().sqrt().item<float>();
  };
  const std::vector<ViewPrediction> floats = predict(Precision::kFloat32);
  const std::vector<ViewPrediction> brains = predict(Precision::kBfloat16);
  ASSERT_EQ(floats.size(), 2u);
  ASSERT_EQ(brains.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    const float mean_depth = at::tensor(floats[i].depth.data()).mean().item<float>();
    EXPECT_LT(rms_difference(brains[i].depth, floats[i].depth), 0.03f * mean_depth);
    EXPECT_LT(rms_difference(brains[i].distractor, floats[i].distractor), 0.03f);
    EXPECT_GT(rms_difference(brains[i].distractor, floats[i].distractor), 0.0f);
    const Eigen::Matrix<double, 3, 4> change =
        brains[i].view.cam_from_world.ToMatrix() - floats[i].view.cam_from_world.ToMatrix();
    EXPECT_LT(change.norm(), 0.05);
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
