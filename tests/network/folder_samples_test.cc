// SPDX-License-Identifier: BSD-3-Clause
#include "network/folder_samples.h"

#include "scene/error.h"
#include "scene/image_io.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>
#include <string>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Black photos with a white distractor, somewhere else in each.
class FolderSamplesTest : public testing::Test {
 protected:
  FolderSamplesTest() {
    for (int i = 0; i < 4; ++i) {
      RgbImage photo(90, 80, Rgb{0, 0, 0});
      StaticMask mask(90, 80, uint8_t{255});
      for (int y = 20; y < 60; ++y) {
        for (int x = 10 + 10 * i; x < 50 + 10 * i; ++x) {
          photo(x, y) = Rgb{255, 255, 255};
          mask(x, y) = 0;
        }
      }
      const std::string name = "photo" + std::to_string(i) + ".png";
      WriteImage(photos() / name, photo);
      WriteImage(masks() / (name + ".png"), mask);
    }
  }

  std::filesystem::path photos() const { return folder_ / "photos"; }
  std::filesystem::path masks() const { return folder_ / "masks"; }
  FolderSampleOptions Options() const {
    return {.folders = {{photos(), masks()}}, .width = 56, .height = 42, .max_views = 3};
  }

  TemporaryFolder folder_;
};

TEST_F(FolderSamplesTest, MasksFollowTheirPhotos) {
  const FolderSamples samples(Options());
  for (uint64_t idx = 0; idx < 10; ++idx) {
    const TrainingSample sample = samples.Get(idx);
    ASSERT_GE(sample.images.size(0), 2);
    ASSERT_LE(sample.images.size(0), 3);
    // One gain for all views, so photo = gain * mask; without contrast's shift of black.
    const at::Tensor bright = sample.images.select(1, 0);
    const double gain = bright.max().item<double>();
    const double black = bright.min().item<double>();
    const at::Tensor expected = black + (gain - black) * sample.distractor;
    // Contrast is changed about the mean of each view, which the crop moves a little.
    EXPECT_LT((bright - expected).abs().mean().item<double>(), 0.05) << idx;
    EXPECT_GT(sample.distractor.mean().item<double>(), 0.05);
  }
}

TEST_F(FolderSamplesTest, AreAFunctionOfTheIndex) {
  const FolderSamples samples(Options());
  EXPECT_TRUE(at::equal(samples.Get(3).images, samples.Get(3).images));
  EXPECT_FALSE(at::equal(samples.Get(3).images.mean(), samples.Get(4).images.mean()));
}

TEST_F(FolderSamplesTest, PhotoWithoutMaskIsNamed) {
  std::filesystem::remove(masks() / "photo2.png.png");
  try {
    FolderSamples samples(Options());
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("photo2.png.png"), std::string::npos);
  }
}

TEST_F(FolderSamplesTest, MaskOfAnotherSizeIsNamed) {
  WriteImage(masks() / "photo1.png.png", StaticMask(45, 40, uint8_t{255}));
  try {
    FolderSamples samples(Options());
    FAIL();
  } catch (const Error& error) {
    const std::string message = error.what();
    EXPECT_NE(message.find("photo1.png.png"), std::string::npos);
    EXPECT_NE(message.find("45x40"), std::string::npos);
    EXPECT_NE(message.find("90x80"), std::string::npos);
  }
}

}  // namespace
}  // namespace vgtw
