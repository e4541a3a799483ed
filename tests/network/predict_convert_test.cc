// SPDX-License-Identifier: BSD-3-Clause
#include "network/predict_convert.h"

#include "bridge/import.h"
#include "bridge/predictions.h"
#include "tests/bridge/numpy_files.h"
#include "tests/support/temporary_folder.h"

#include <cmath>
#include <limits>
#include <vector>

#include <ATen/ATen.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

PhotoPlacement PlaceOne(const ImageSize& size, ResizePolicy policy) {
  PreprocessOptions options;
  options.policy = policy;
  options.side_px = 28;
  options.max_pixels = 28 * 28;
  return PlacePhotos({size}, options).front();
}

RawView SampleRaw(int64_t height, int64_t width) {
  RawView raw;
  raw.cam_from_world =
      at::tensor({0.0f, -1.0f, 0.0f, 0.5f, 1.0f, 0.0f, 0.0f, -0.25f, 0.0f, 0.0f, 1.0f, 2.0f})
          .view({3, 4});
  raw.intrinsics = at::tensor({30.0f,
                               0.0f,
                               0.5f * static_cast<float>(width),
                               0.0f,
                               31.0f,
                               0.5f * static_cast<float>(height),
                               0.0f,
                               0.0f,
                               1.0f})
                       .view({3, 3});
  raw.maps.depth = 1.0 + at::arange(height * width, at::kFloat).view({height, width}) / 64.0;
  raw.maps.depth_conf = 1.0 + raw.maps.depth;
  raw.maps.distractor_logits = raw.maps.depth - 5.0;
  return raw;
}

std::vector<float> Values(const at::Tensor& tensor) {
  const at::Tensor values = tensor.to(at::kFloat).contiguous();
  return {values.data_ptr<float>(), values.data_ptr<float>() + values.numel()};
}

// The very arrays that the official demo would save give the same view through the importer.
TEST(ConvertView, AgreesWithTheImporterOfTheNetworksFiles) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "photos");
  WritePhotos(folder / "photos", {"a.png"}, 120, 84);
  const PhotoPlacement placement = PlaceOne({120, 84}, ResizePolicy::kCrop);
  const int64_t height = placement.geometry.network_height;
  const RawView raw = SampleRaw(height, 28);
  const std::string shape = "(1, " + std::to_string(height) + ", 28)";
  WriteNpz(folder / "predictions.npz",
           {{"extrinsic", NpyFloats("(1, 3, 4)", Values(raw.cam_from_world))},
            {"intrinsic", NpyFloats("(1, 3, 3)", Values(raw.intrinsics))},
            {"depth", NpyFloats(shape, Values(raw.maps.depth))},
            {"depth_conf", NpyFloats(shape, Values(raw.maps.depth_conf))},
            {"depth_mask", NpyFloats(shape, Values(raw.maps.distractor_logits))}});
  ImportOptions import;
  import.resize = ImportResize::kCrop;
  Import(folder / "predictions.npz", folder / "photos", folder / "out", import);
  const ViewPrediction imported = PredictionReader(folder / "out").Load(0);

  const ConvertedView converted = ConvertView("a.png", placement, raw, false);
  ASSERT_EQ(converted.fault, "");
  const ViewPrediction& predicted = converted.prediction;
  EXPECT_EQ(predicted.view.camera.params, imported.view.camera.params);
  EXPECT_TRUE(predicted.view.original_from_network.isApprox(imported.view.original_from_network));
  EXPECT_LT(
      (predicted.view.cam_from_world.ToMatrix() - imported.view.cam_from_world.ToMatrix()).norm(),
      1e-12);
  EXPECT_EQ(predicted.depth, imported.depth);
  EXPECT_EQ(predicted.depth_conf, imported.depth_conf);
  for (size_t i = 0; i < predicted.distractor.size(); ++i) {
    // Files hold probabilities in float16.
    EXPECT_NEAR(predicted.distractor.data()[i], imported.distractor.data()[i], 5e-4f);
  }
}

TEST(ConvertView, BarsAndWhatIsNotFiniteBecomeUnknown) {
  PreprocessOptions options;
  options.side_px = 28;
  const PhotoPlacement placement = PlacePhotos({{56, 28}, {56, 56}}, options).front();
  RawView raw = SampleRaw(28, 28);
  raw.maps.depth[10][3] = std::numeric_limits<float>::infinity();
  raw.maps.depth[10][4] = -1.0f;
  const ConvertedView converted = ConvertView("a.png", placement, raw, false);
  ASSERT_EQ(converted.fault, "");
  const DepthMap& depth = converted.prediction.depth;
  for (int y = 0; y < 28; ++y) EXPECT_EQ(std::isfinite(depth(0, y)), y >= 7 && y < 21) << y;
  EXPECT_TRUE(std::isnan(depth(3, 10)));
  EXPECT_TRUE(std::isnan(depth(4, 10)));
  EXPECT_TRUE(std::isnan(converted.prediction.distractor(5, 6)));
}

TEST(ConvertView, RejectsCamerasThatCannotBe) {
  const PhotoPlacement placement = PlaceOne({56, 56}, ResizePolicy::kCrop);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  RawView raw = SampleRaw(28, 28);
  raw.intrinsics[0][0] = 1e-3f;  // 2 atan(14 / 0.001) = pi - 1.4e-4
  EXPECT_THAT(ConvertView("a", placement, raw, false).fault, HasSubstr("field of view"));
  raw = SampleRaw(28, 28);
  raw.intrinsics[1][1] = 1e5f;  // 2 atan(14 / 1e5) = 2.8e-4
  EXPECT_THAT(ConvertView("a", placement, raw, false).fault, HasSubstr("field of view"));
  raw = SampleRaw(28, 28);
  raw.cam_from_world[0][3] = nan;
  EXPECT_THAT(ConvertView("a", placement, raw, false).fault, HasSubstr("pose"));
  raw = SampleRaw(28, 28);
  raw.maps.depth.fill_(nan);
  EXPECT_THAT(ConvertView("a", placement, raw, false).fault, HasSubstr("depth"));
}

// Rays of a pinhole through the centres of pixels, at any depth, give back the pinhole; distractors
// that are elsewhere do not count.
TEST(ConvertView, Pi3sIntrinsicsComeFromItsStaticRays) {
  const PhotoPlacement placement = PlaceOne({56, 56}, ResizePolicy::kStretch);
  ASSERT_EQ(placement.geometry.network_width, 28);
  const at::Tensor u = (at::arange(28, at::kDouble) + 0.5 - 13.0) / 40.0;
  const at::Tensor v = (at::arange(28, at::kDouble) + 0.5 - 15.0) / 42.0;
  const at::Tensor z = 2.0 + at::arange(28 * 28, at::kDouble).view({28, 28}) / 100.0;
  RawView raw = SampleRaw(28, 28);
  raw.intrinsics = at::Tensor();
  raw.maps.local_points = at::stack({u.unsqueeze(0) * z, v.unsqueeze(1) * z, z}, 2).to(at::kFloat);
  raw.maps.depth = z.to(at::kFloat);
  raw.maps.depth_conf = at::zeros({28, 28});
  raw.maps.distractor_logits = at::Tensor();
  const ViewPrediction exact = ConvertView("a", placement, raw, true).prediction;
  // Photos of 56 pixels: twice the network's.
  const std::vector<double> expected = {80.0, 84.0, 26.0, 30.0};
  for (size_t i = 0; i < 4; ++i) EXPECT_NEAR(exact.view.camera.params[i], expected[i], 1e-4);
  EXPECT_EQ(exact.depth_conf(3, 3), 0.5f);
  // The point map is what depth and camera say.
  const auto point = UnprojectPixel(exact.view, exact.depth, 20, 5);
  ASSERT_TRUE(point);
  EXPECT_LT((*point - exact.points(20, 5).cast<double>()).norm(), 1e-5);
}

}  // namespace
}  // namespace vgtw
