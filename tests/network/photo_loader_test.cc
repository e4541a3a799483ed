// SPDX-License-Identifier: BSD-3-Clause
#include "network/photo_loader.h"

#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <ATen/ATen.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

// 2 x 2 patches.
class PhotoLoaderTest : public testing::Test {
 protected:
  PhotoLoader Loader(int width, int height) {
    WriteImage(folder_.path() / "a.png", RgbImage(width, height, Rgb{51, 102, 255}));
    PreprocessOptions options;
    options.side_px = 28;
    return {path_, names_, options, 1};
  }
  static StaticMask MaskWithout(int width, int height, int x_end, int y_begin, int y_end) {
    StaticMask mask(width, height, 255);
    for (int y = y_begin; y < y_end; ++y) {
      for (int x = 0; x < x_end; ++x) mask(x, y) = 0;
    }
    return mask;
  }
  static at::Tensor Patches(const PhotoLoader& loader, const StaticMask& mask) {
    return ExcludedPatches(loader.LoadExcluded(0, 1, [&](const std::string&) { return mask; }));
  }
  static at::Tensor Bools(std::vector<int64_t> values) {
    return at::tensor(values).to(at::kBool).view({1, -1});
  }

  const TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_.path();
  const std::vector<std::string> names_ = {"a.png"};
};

TEST_F(PhotoLoaderTest, ChannelsAreSharesOf255) {
  const at::Tensor image = Loader(28, 28).Load(0, 1);
  EXPECT_EQ(image.sizes(), (std::vector<int64_t>{1, 3, 28, 28}));
  EXPECT_TRUE(at::equal(image[0].amax({1, 2}), at::tensor({51.0f, 102.0f, 255.0f}).div(255.0f)));
  EXPECT_TRUE(at::equal(image.amin({2, 3}), image.amax({2, 3})));
}

TEST_F(PhotoLoaderTest, APatchIsExcludedFromHalfOfItsPixels) {
  const PhotoLoader loader = Loader(28, 28);
  EXPECT_TRUE(at::equal(Patches(loader, MaskWithout(28, 28, 6, 0, 28)), Bools({0, 0, 0, 0})));
  EXPECT_TRUE(at::equal(Patches(loader, MaskWithout(28, 28, 7, 0, 28)), Bools({1, 0, 1, 0})));
  EXPECT_TRUE(at::equal(Patches(loader, MaskWithout(28, 28, 28, 0, 7)), Bools({1, 1, 0, 0})));
  EXPECT_TRUE(at::equal(Patches(loader, {}), Bools({0, 0, 0, 0})));
}

// The loader keeps the rows 14 .. 41 of 56.
TEST_F(PhotoLoaderTest, MasksAreCroppedAsTheirPhoto) {
  const PhotoLoader loader = Loader(28, 56);
  EXPECT_TRUE(at::equal(Patches(loader, MaskWithout(28, 56, 28, 0, 14)), Bools({0, 0, 0, 0})));
  EXPECT_TRUE(at::equal(Patches(loader, MaskWithout(28, 56, 14, 14, 28)), Bools({1, 0, 0, 0})));
}

TEST_F(PhotoLoaderTest, AMaskOfAnotherSizeIsAnError) {
  const PhotoLoader loader = Loader(28, 28);
  EXPECT_THAT(ErrorOf([&] { Patches(loader, StaticMask(14, 28, 255)); }),
              HasSubstr("mask of a.png: 14x28 pixels, expected the photo's 28x28"));
}

}  // namespace
}  // namespace vgtw
