// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_surface.h"

#include "scene/scene_stream_noise.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

SurfaceSample SampleAt(float y, float z, float footprint) {
  SurfaceSample sample;
  sample.face = 1;
  sample.point_in_local = {1.0f, y, z};
  sample.footprint = footprint;
  return sample;
}

Surface MakeTwoColoured(Pattern pattern) {
  Surface surface;
  surface.pattern = pattern;
  surface.texture.faces.fill({Eigen::Vector3f::Zero(), Eigen::Vector3f::Ones()});
  surface.period = {0.5f, 0.25f};
  surface.joint = 0.3f;
  return surface;
}

// 0.3 of a period is dark: sharp close by, 0.7 on the average from afar, and in between the share
// of the footprint [0.1, 0.2] that lies in [0, 0.15).
TEST(SurfaceColour, StripesAreAveragedOverTheFootprint) {
  const Surface stripes = MakeTwoColoured(Pattern::kStripes);
  EXPECT_NEAR(SurfaceColour(stripes, SampleAt(0.1f, 0.0f, 1e-3f))[0], 0.0f, 1e-5f);
  EXPECT_NEAR(SurfaceColour(stripes, SampleAt(0.2f, 0.0f, 1e-3f))[0], 1.0f, 1e-5f);
  EXPECT_NEAR(SurfaceColour(stripes, SampleAt(0.15f, 0.0f, 0.1f))[0], 0.5f, 1e-5f);
  EXPECT_NEAR(SurfaceColour(stripes, SampleAt(0.1f, 0.0f, 2.0f))[0], 0.7f, 1e-5f);
}

// From afar every place of a face looks like the mean of what is seen close by. Sampling 64 x 64
// places leaves 1 %, patterns whose mean is approximated another 6 %.
TEST(SurfaceColour, FarSurfacesShowTheirMean) {
  for (const Pattern pattern : {Pattern::kStripes, Pattern::kBricks, Pattern::kTiles}) {
    const Surface surface = MakeTwoColoured(pattern);
    double sum = 0.0;
    for (int i = 0; i < 64; ++i) {
      for (int j = 0; j < 64; ++j) {
        sum += SurfaceColour(
            surface,
            SampleAt(0.1f * static_cast<float>(i), 0.07f * static_cast<float>(j), 0.004f))[1];
      }
    }
    for (const float y : {0.0f, 0.21f, 1.3f}) {
      EXPECT_NEAR(SurfaceColour(surface, SampleAt(y, 0.3f, 5.0f))[1], sum / (64 * 64), 0.07);
    }
  }
}

TEST(TableNoise, HasTheSpreadOfFractalNoiseAndNoneFromAfar) {
  double sum = 0.0;
  double sum_of_squares = 0.0;
  double truth_of_squares = 0.0;
  constexpr int n = 20000;
  for (int i = 0; i < n; ++i) {
    const float u = 0.37f * static_cast<float>(i % 173);
    const float v = 0.41f * static_cast<float>(i / 173);
    const float noise = TableNoise(u, v, 0.05f, 77);
    const float truth = FractalNoise({u, v}, 0.05, 1);
    sum += noise;
    sum_of_squares += noise * noise;
    truth_of_squares += truth * truth;
    EXPECT_LT(std::abs(TableNoise(u, v, 100.0f, 77)), 0.1f);
  }
  // The table holds 16 x 16 of the largest cells: a standard error of 0.3 / 16 at the mean.
  EXPECT_NEAR(sum / n, 0.0, 0.06);
  EXPECT_NEAR(std::sqrt(sum_of_squares / n), std::sqrt(truth_of_squares / n), 0.05);
}

// Columns of 0 and 255, 8 pixels wide each, as one unit of length.
TEST(PhotoTexture, IsBilinearMirroredAndAveraged) {
  RgbImage photo(16, 16);
  for (int y = 0; y < 16; ++y) {
    for (int x = 8; x < 16; ++x) photo(x, y) = {255, 255, 255};
  }
  const PhotoTexture texture(photo);
  const auto grey = [&](float x, float footprint) {
    return texture.ColourAt({x, 0.5f}, footprint)[0];
  };
  EXPECT_FLOAT_EQ(grey(0.2f, 0.01f), 0.0f);
  EXPECT_FLOAT_EQ(grey(0.8f, 0.01f), 1.0f);
  EXPECT_FLOAT_EQ(grey(0.5f, 0.01f), 0.5f);
  EXPECT_FLOAT_EQ(grey(1.2f, 0.01f), 1.0f);
  EXPECT_FLOAT_EQ(grey(-0.2f, 0.01f), 0.0f);
  EXPECT_FLOAT_EQ(grey(1.8f, 0.01f), 0.0f);
  EXPECT_NEAR(grey(0.2f, 4.0f), 0.5f, 0.003f);
}

}  // namespace
}  // namespace vgtw
