// SPDX-License-Identifier: BSD-3-Clause
// With a network that knows the truth and gives it in another frame for every reference view.
#include "network/predict_run.h"

#include "network/predict_chunks.h"
#include "network/predict_memory.h"
#include "scene/synthetic.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include <ATen/ATen.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 56;
constexpr int kHeight = 42;

// Photos of one gray value, from which the network below knows which view it sees.
std::vector<std::string> WriteGrayPhotos(const std::filesystem::path& folder, int num_views) {
  std::vector<std::string> names;
  for (int i = 0; i < num_views; ++i) {
    const auto gray = static_cast<uint8_t>(10 * i);
    names.push_back("view_0" + std::to_string(i) + ".png");
    WriteImage(folder / names.back(), RgbImage(kWidth, kHeight, Rgb{gray, gray, gray}));
  }
  return names;
}

// Where the frame of a pass with this reference lies: another one for each.
Sim3d PassFromWorld(int64_t reference) {
  const auto r = static_cast<double>(reference);
  const Eigen::Vector3d axis = Eigen::Vector3d(1.0, 0.3 * r, -0.5).normalized();
  return {1.0 + 0.25 * r,
          RotationAboutAxis(axis, 20.0 * r),
          Eigen::Vector3d(0.5 * r, -0.25 * r, 0.125 * r)};
}

Prediction MakeTruth(int num_views) {
  SyntheticOptions options;
  options.num_views = num_views;
  options.width = kWidth;
  options.height = kHeight;
  return MakeTruePrediction(SyntheticScene(options), kWidth);
}

at::Tensor FromGrid(const Grid<float>& grid) {
  return at::tensor(grid.data()).view({1, grid.height(), grid.width()});
}

class TrueModel : public Model {
 public:
  explicit TrueModel(const Prediction& truth) : truth_(truth) {}

  // A token is the index of its view; the first view is the reference.
  Features Encode(const at::Tensor& images, const EncodeOptions& options) const override {
    Features features;
    features.height = images.size(2);
    features.width = images.size(3);
    features.last = (images.select(1, 0).select(1, 0).select(1, 0) * 25.5).round().view({-1, 1, 1});
    pass_sizes.push_back(features.num_views());
    excluded_patches = options.excluded_patches;
    for (int block = 0; block < 2 && options.on_block; ++block) options.on_block();
    return features;
  }

  CameraOutputs PredictCameras(const Features& features) const override {
    CameraOutputs outputs;
    std::vector<at::Tensor> poses;
    std::vector<at::Tensor> intrinsics;
    for (int64_t i = 0; i < features.num_views(); ++i) {
      const View view = InPass(features, i).view;
      const Eigen::Matrix<double, 3, 4> pose = view.cam_from_world.ToMatrix();
      poses.push_back(at::from_blob(const_cast<double*>(pose.data()), {4, 3}, at::kDouble).t());
      poses.back() = poses.back().to(at::kFloat, false, /*copy=*/true);
      const std::vector<double>& k = view.camera.params;
      const bool is_lost = lost_view == IndexOf(features, i);
      intrinsics.push_back(
          at::tensor({is_lost ? 1e6 : k[0], 0.0, k[2], 0.0, k[1], k[3], 0.0, 0.0, 1.0})
              .view({3, 3}));
    }
    outputs.cam_from_world = at::stack(poses);
    outputs.intrinsics = at::stack(intrinsics);
    return outputs;
  }

  DenseOutputs PredictMaps(const Features& features,
                           int64_t begin,
                           int64_t end,
                           const MapChoice&) const override {
    EXPECT_EQ(end, begin + 1);
    const ViewPrediction view = InPass(features, begin);
    DenseOutputs outputs;
    outputs.depth = FromGrid(view.depth);
    outputs.depth_conf = FromGrid(view.depth_conf);
    outputs.distractor_logits = at::logit(FromGrid(view.distractor), 1e-4);
    return outputs;
  }

  const TransformerBlock& GlobalBlock(int64_t) const override {
    throw std::out_of_range("a model without blocks");
  }

  mutable std::vector<int64_t> pass_sizes;
  mutable at::Tensor excluded_patches;  // of the last pass
  std::optional<int64_t> lost_view;     // whose field of view is nearly 0

 private:
  static int64_t IndexOf(const Features& features, int64_t i) {
    return features.last[i].item().to<int64_t>();
  }
  ViewPrediction InPass(const Features& features, int64_t i) const {
    ViewPrediction view = truth_.views[static_cast<size_t>(IndexOf(features, i))];
    TransformPrediction(PassFromWorld(IndexOf(features, 0)), view);
    return view;
  }

  const Prediction& truth_;
};

struct TrueRun {
  std::vector<ViewPrediction> views;
  PredictSummary summary;
};

TrueRun RunTrue(const TrueModel& model,
                int num_views,
                PredictOptions options,
                const std::function<at::Tensor(const at::Tensor&)>& describe_views = {}) {
  const TemporaryFolder folder;
  const std::vector<std::string> names = WriteGrayPhotos(folder.path(), num_views);
  VggtConfig config;
  config.depth = 1;
  config.encoder.reset();
  ReadyNetwork network = {&model, {NetworkKind::kVgtw, config}};
  network.describe_views = describe_views;
  options.side_px = kWidth;
  TrueRun run;
  int64_t last_done = 0;
  int64_t last_total = 0;
  run.summary = PredictViews(
      network,
      options,
      folder.path(),
      names,
      [&](const ViewPrediction& view) { run.views.push_back(view); },
      [&](int64_t done, int64_t total) {
        EXPECT_GT(done, last_done);
        last_done = done;
        last_total = total;
      });
  EXPECT_EQ(last_done, last_total);
  return run;
}

// Poses and depths pass through float32, whose rounding is 6e-8 of values up to 10.
constexpr double kFloatRounding = 4e-6;

void ExpectTruth(const ViewPrediction& predicted, ViewPrediction truth, int64_t reference) {
  TransformPrediction(PassFromWorld(reference), truth);
  const Eigen::Matrix<double, 3, 4> difference =
      predicted.view.cam_from_world.ToMatrix() - truth.view.cam_from_world.ToMatrix();
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), kFloatRounding) << predicted.view.name;
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(predicted.view.camera.params[i], truth.view.camera.params[i], 1e-4);
  }
  ASSERT_EQ(predicted.depth.size(), truth.depth.size());
  for (size_t i = 0; i < truth.depth.size(); ++i) {
    const float expected = truth.depth.data()[i];
    if (std::isfinite(expected)) {
      EXPECT_NEAR(predicted.depth.data()[i] / expected, 1.0f, kFloatRounding);
    } else {
      EXPECT_TRUE(std::isnan(predicted.depth.data()[i]));
    }
    EXPECT_NEAR(predicted.distractor.data()[i], truth.distractor.data()[i], 2e-4f);
  }
}

TEST(Predict, OnePassKeepsTheFrameOfTheNetwork) {
  const Prediction truth = MakeTruth(3);
  const TrueModel model(truth);
  const TrueRun run = RunTrue(model, 3, {});
  ASSERT_EQ(run.views.size(), 3u);
  EXPECT_EQ(model.pass_sizes, std::vector<int64_t>{3});
  EXPECT_TRUE(run.summary.alignments.empty());
  for (size_t i = 0; i < 3; ++i) ExpectTruth(run.views[i], truth.views[i], 0);
}

TEST(Predict, ChunksEndUpInTheFrameOfTheFirst) {
  const Prediction truth = MakeTruth(9);
  const TrueModel model(truth);
  PredictOptions options;
  options.max_views_at_once = 4;
  options.num_overlap_views = 1;
  const TrueRun run = RunTrue(model, 9, options);
  EXPECT_EQ(model.pass_sizes, (std::vector<int64_t>{3, 4, 4}));
  ASSERT_EQ(run.views.size(), 9u);
  for (size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(run.views[i].view.name, "view_0" + std::to_string(i) + ".png");
    ExpectTruth(run.views[i], truth.views[i], 0);
  }
  ASSERT_EQ(run.summary.alignments.size(), 3u);
  EXPECT_EQ(run.summary.alignments[1].first_view, 2);
  EXPECT_EQ(run.summary.alignments[1].num_shared_views, 1);
  EXPECT_NEAR(run.summary.alignments[1].scale, 1.0 / PassFromWorld(2).scale, 1e-6);
  EXPECT_LT(run.summary.alignments[2].depth_median_percent, 1e-3);
}

// Of four views: the mean direction is at 63 degrees, 23 from that of view 2, 27 from that of
// view 1.
at::Tensor DescribeByAngle(const at::Tensor& images) {
  const int idx = (images.select(1, 0).mean() * 25.5).round().item().toInt();
  const double angle = std::array{0.0, 90.0, 40.0, 120.0}[static_cast<size_t>(idx)];
  const double angle_rad = angle * std::numbers::pi / 180.0;
  return at::tensor({std::cos(angle_rad), std::sin(angle_rad)}).view({1, 2}) * (1.0 + idx);
}

TEST(Predict, MostConnectedReferenceLeavesTheOrder) {
  const Prediction truth = MakeTruth(4);
  const TrueModel model(truth);
  PredictOptions options;
  options.reference = ReferenceChoice::kMostConnected;
  const TrueRun run = RunTrue(model, 4, options, DescribeByAngle);
  ASSERT_EQ(run.views.size(), 4u);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(run.views[i].view.name, "view_0" + std::to_string(i) + ".png");
    ExpectTruth(run.views[i], truth.views[i], 2);
  }
}

// With view 2 in front, the network sees the views in the order 2, 0, 1, 3.
TEST(Predict, MasksAreThoseOfTheirOwnView) {
  const Prediction truth = MakeTruth(4);
  const TrueModel model(truth);
  StaticMask left_half(kWidth, kHeight, 255);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) left_half(x, y) = 0;
  }
  PredictOptions options;
  options.reference = ReferenceChoice::kMostConnected;
  options.read_static_mask = [&](const std::string& name) {
    return name == "view_01.png" ? left_half : StaticMask();
  };
  const TrueRun run = RunTrue(model, 4, options, DescribeByAngle);
  const at::Tensor left_columns = at::tensor({1, 1, 0, 0}).to(at::kBool).repeat({3});
  EXPECT_TRUE(at::equal(model.excluded_patches[2], left_columns));
  EXPECT_EQ(model.excluded_patches.sum().item().toInt(), 6);
  ASSERT_EQ(run.views.size(), 4u);
  for (size_t i = 0; i < 4; ++i) {
    ViewPrediction expected = truth.views[i];
    for (int y = 0; i == 1 && y < kHeight; ++y) {
      for (int x = 0; x < kWidth / 2; ++x) expected.distractor(x, y) = 1.0f;
    }
    ExpectTruth(run.views[i], expected, 2);
  }
}

TEST(Predict, ViewsWithoutAUsableCameraAreNamed) {
  const Prediction truth = MakeTruth(3);
  TrueModel model(truth);
  model.lost_view = 1;
  const TrueRun run = RunTrue(model, 3, {});
  ASSERT_EQ(run.views.size(), 2u);
  EXPECT_EQ(run.views[1].view.name, "view_02.png");
  ASSERT_EQ(run.summary.rejected_views.size(), 1u);
  EXPECT_THAT(run.summary.rejected_views[0], HasSubstr("view_01.png: its field of view"));
}

TEST(Predict, ChunkWithoutUsableSharedViewIsAnError) {
  const Prediction truth = MakeTruth(5);
  TrueModel model(truth);
  model.lost_view = 2;
  PredictOptions options;
  options.max_views_at_once = 3;
  options.num_overlap_views = 1;
  EXPECT_THAT(ErrorOf([&] { RunTrue(model, 5, options); }), HasSubstr("raise --overlap"));
}

TEST(Predict, TooLittleMemoryIsAnError) {
  const Prediction truth = MakeTruth(2);
  const TrueModel model(truth);
  PredictOptions options;
  options.max_memory_gib = 1e-6;
  EXPECT_THAT(ErrorOf([&] { RunTrue(model, 2, options); }), HasSubstr("raise --max_memory"));
}

TEST(MemoryEstimate, IsThatOfTheLayersAtHand) {
  // VGGT at 518 x 392: 37 x 28 patches and 5 tokens; (2 * 4 + 2 + 15) widths of 1024 floats each.
  const MemoryEstimate estimate = EstimateMemory({NetworkKind::kVggt, VggtConfig{}}, 518, 392);
  EXPECT_EQ(estimate.per_view, 4 * (25 * 1024 * 1041 + 9 * 518 * 392));
  EXPECT_EQ(estimate.fixed, 4 * 518 * 392 * 4 * (256 + 32));
}

}  // namespace
}  // namespace vgtw
