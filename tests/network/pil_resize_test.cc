// SPDX-License-Identifier: BSD-3-Clause
#include "network/pil_resize.h"

#include "tests/parity/parity_photo.h"

#include <algorithm>
#include <ostream>
#include <stdexcept>
#include <string_view>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

RgbImage MakeGray(int width, int height, const std::vector<uint8_t>& values) {
  RgbImage image(width, height);
  std::transform(values.begin(), values.end(), image.data().begin(), [](uint8_t value) -> Rgb {
    return {value, value, value};
  });
  return image;
}

constexpr PilResizeOptions kLanczos = {.filter = PilFilter::kLanczos};

// One row: the kernel is 0.8671875 at 1/4, 0.2265625 at 3/4 and -0.0703125 at 5/4; the two weights
// of each pixel are normalized to sum 1, so that 100 and 200 become 91.18, 120.71, 179.29, 208.82.
TEST(PilResize, EnlargesByTheCubic) {
  EXPECT_EQ(PilResize(MakeGray(2, 1, {100, 200}), 4, 1), MakeGray(4, 1, {91, 121, 179, 209}));
}

// The same with 0.890067, 0.270190 and -0.132871: 82.45, 123.29, 176.71, 217.55.
TEST(PilResize, EnlargesByLanczos) {
  EXPECT_EQ(PilResize(MakeGray(2, 1, {100, 200}), 4, 1, kLanczos),
            MakeGray(4, 1, {82, 123, 177, 218}));
}

// Overshoot: 1.0882 * 255 and -0.0882 * 255.
TEST(PilResize, ClampsToBytes) {
  EXPECT_EQ(PilResize(MakeGray(1, 2, {255, 0}), 1, 4), MakeGray(1, 4, {255, 202, 53, 0}));
}

TEST(PilResize, HalvesBySymmetricWeightsAndRoundsHalvesUp) {
  for (const PilResizeOptions& options : {PilResizeOptions{}, kLanczos}) {
    EXPECT_EQ(PilResize(MakeGray(2, 1, {10, 20}), 1, 1, options), MakeGray(1, 1, {15}));
    EXPECT_EQ(PilResize(MakeGray(2, 1, {0, 255}), 1, 1, options), MakeGray(1, 1, {128}));
  }
}

// Columns first: (0, 1) and (0, 3) become 1 and 2, and these 2. Rows first would end at 1.
TEST(PilResize, RoundsBetweenTheAxes) {
  EXPECT_EQ(PilResize(MakeGray(2, 2, {0, 1, 0, 3}), 1, 1), MakeGray(1, 1, {2}));
}

TEST(PilResize, KeepsAnImageOfTheSameSize) {
  const RgbImage photo = ParityPhoto("photo", 31, 17);
  EXPECT_EQ(PilResize(photo, 31, 17), photo);
}

// Rounded weights sum to 1 within taps / 2^23, too little for a byte.
TEST(PilResize, KeepsConstantsAndChannelsApart) {
  const Rgb colour = {3, 128, 255};
  for (const auto& [width, height] : {std::pair(300, 200), {7, 5}, {1, 1}, {97, 1}}) {
    for (const PilResizeOptions& options : {PilResizeOptions{}, kLanczos}) {
      EXPECT_EQ(PilResize(RgbImage(97, 61, colour), width, height, options),
                RgbImage(width, height, colour));
    }
  }
}

struct PillowCase {
  int old_width, old_height, width, height;
  uint64_t bicubic_hash, lanczos_hash;
};
void PrintTo(const PillowCase& sizes, std::ostream* stream) {
  *stream << sizes.old_width << "x" << sizes.old_height << " to " << sizes.width << "x"
          << sizes.height;
}
class PillowParity : public testing::TestWithParam<PillowCase> {};

uint64_t HashOf(const RgbImage& image) {
  std::string bytes;
  for (const Rgb& pixel : image.data()) bytes.append(pixel.begin(), pixel.end());
  return Fnv1a(bytes);
}

// Hashes of what Pillow 9.4 made of the same photos.
TEST_P(PillowParity, GivesTheSameBytes) {
  const PillowCase& sizes = GetParam();
  const RgbImage photo = ParityPhoto("photo", sizes.old_width, sizes.old_height);
  EXPECT_EQ(HashOf(PilResize(photo, sizes.width, sizes.height)), sizes.bicubic_hash);
  EXPECT_EQ(HashOf(PilResize(photo, sizes.width, sizes.height, kLanczos)), sizes.lanczos_hash);
}

INSTANTIATE_TEST_SUITE_P(
    Sizes,
    PillowParity,
    testing::Values(PillowCase{200, 133, 518, 350, 0x0005b032723555b8u, 0xc571641dc1121152u},
                    PillowCase{133, 200, 14, 28, 0x2bed3ce0e5e18f8au, 0xc91f9041f5b07309u},
                    PillowCase{700, 500, 336, 238, 0x5ff63abd26437b5bu, 0x25b4645caa87208bu},
                    PillowCase{61, 47, 61, 30, 0x4f82c640ca2a5741u, 0x1bd42860d1763300u},
                    PillowCase{61, 47, 30, 47, 0x77a9887837f4062cu, 0x86cde1ede43a789fu},
                    PillowCase{1, 9, 5, 2, 0x861b1377c1fcbe7fu, 0xabf928ba05740c74u},
                    PillowCase{1000, 3, 7, 4, 0x8385ca0638a3e617u, 0x793c5037b15ab897u}));

TEST(PilResize, GivesTheSameRowsAlone) {
  const RgbImage photo = ParityPhoto("photo", 90, 140);
  for (const auto& [width, height] : {std::pair(40, 200), {40, 60}, {40, 140}, {90, 60}}) {
    const RgbImage all = PilResize(photo, width, height);
    const RgbImage some = PilResize(photo, width, height, {.first_row = 13, .num_rows = 29});
    ASSERT_EQ(some.height(), 29);
    EXPECT_TRUE(std::equal(some.data().begin(), some.data().end(), &all(0, 13)));
    EXPECT_EQ(PilResize(photo, width, height, {.first_row = 13}).height(), height - 13);
  }
}

TEST(PilResize, DoesNotDependOnThreads) {
  const RgbImage photo = ParityPhoto("photo", 150, 333);
  EXPECT_EQ(PilResize(photo, 70, 40, {.num_threads = 3}), PilResize(photo, 70, 40));
}

// The most shrinking that is allowed, on extreme pixels; the stripes end as Pillow 9.4 ends them.
TEST(PilResize, DoesNotOverflowWhereItShrinksMost) {
  RgbImage photo(511 * 4, 1, {255, 255, 255});
  EXPECT_EQ(PilResize(photo, 4, 1, kLanczos), RgbImage(4, 1, {255, 255, 255}));
  for (int x = 0; x < photo.width(); x += 2) photo(x, 0) = {0, 0, 0};
  EXPECT_EQ(PilResize(photo, 4, 1, kLanczos), MakeGray(4, 1, {127, 128, 127, 128}));
}

TEST(PilResize, RefusesAbsurdSizes) {
  const RgbImage photo(600, 10);
  EXPECT_THROW(PilResize(RgbImage(), 5, 5), std::invalid_argument);
  EXPECT_THROW(PilResize(photo, 0, 5), std::invalid_argument);
  EXPECT_THROW(PilResize(photo, 5, -1), std::invalid_argument);
  EXPECT_THROW(PilResize(photo, 1, 10), std::invalid_argument);
  EXPECT_THROW(PilResize(photo, 1 << 28, 10), std::invalid_argument);
  EXPECT_THROW(PilResize(photo, 60, 1 << 26), std::invalid_argument);
  EXPECT_THROW(PilResize(photo, 60, 10, {.first_row = 10}), std::invalid_argument);
  EXPECT_THROW(PilResize(photo, 60, 10, {.first_row = -1}), std::invalid_argument);
  EXPECT_THROW(PilResize(photo, 60, 10, {.first_row = 5, .num_rows = 6}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
