// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/photo_order.h"

#include "scene/random.h"

#include <algorithm>
#include <numeric>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr size_t kNumViews = 7;
constexpr int kSide = 40;

// Views of one surface: view i is the same random texture moved by 3 i pixels, plus its own noise.
std::vector<PhotoDetail> Photos(uint64_t seed) {
  RandomStream random(HashKey({seed}));
  Grid<float> texture(kSide + 3 * static_cast<int>(kNumViews), kSide);
  for (float& value : texture.data()) value = static_cast<float>(random.Normal());
  std::vector<PhotoDetail> photos;
  for (size_t i = 0; i < kNumViews; ++i) {
    PhotoDetail photo(kSide, kSide);
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        photo(x, y) = texture(x + 3 * static_cast<int>(i), y) + static_cast<float>(random.Normal());
      }
    }
    photos.push_back(photo);
  }
  return photos;
}

std::vector<ViewFlow> Flows() {
  std::vector<ViewFlow> flows;
  for (size_t a = 0; a < kNumViews; ++a) {
    for (size_t b = a + 1; b < kNumViews; ++b) {
      ViewFlow flow{a, b, {}, {}};
      const int shift = 3 * static_cast<int>(b - a);
      for (int y = 0; y < kSide; y += 2) {
        for (int x = shift; x < kSide; x += 2) {
          flow.positions_a.emplace_back((x + 0.5) / kSide, (y + 0.5) / kSide);
          flow.positions_b.emplace_back((x - shift + 0.5) / kSide, (y + 0.5) / kSide);
        }
      }
      flows.push_back(flow);
    }
  }
  return flows;
}

std::vector<const PhotoDetail*> InOrder(const std::vector<PhotoDetail>& photos,
                                        const std::vector<size_t>& order) {
  std::vector<const PhotoDetail*> details;
  for (const size_t idx : order) details.push_back(&photos[idx]);
  return details;
}

std::vector<size_t> Identity() {
  std::vector<size_t> order(kNumViews);
  std::iota(order.begin(), order.end(), size_t{0});
  return order;
}

TEST(FindBetterPhotoOrder, TheRightOrderIsLeftAlone) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const auto photos = Photos(seed);
    EXPECT_FALSE(FindBetterPhotoOrder(Flows(), kNumViews, InOrder(photos, Identity()), {}));
  }
}

TEST(FindBetterPhotoOrder, EveryShuffleIsUndone) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const auto photos = Photos(seed);
    std::vector<size_t> shuffled = Identity();
    RandomStream random(HashKey({seed, 1}));
    while (shuffled == Identity()) {
      for (size_t i = kNumViews - 1; i > 0; --i) {
        std::swap(shuffled[i], shuffled[random.Bits() % (i + 1)]);
      }
    }
    const auto better = FindBetterPhotoOrder(Flows(), kNumViews, InOrder(photos, shuffled), {});
    ASSERT_TRUE(better) << seed;
    for (size_t i = 0; i < kNumViews; ++i) EXPECT_EQ(shuffled[better->photo_of_view[i]], i);
    // Signal and noise have the same variance, so 0.5. The photos share their texture, so that
    // errors of the pairs do not average out: the largest deviation of these seeds is 0.055.
    EXPECT_NEAR(better->correlation, 0.5, 0.1);
  }
}

TEST(FindBetterPhotoOrder, FurtherPhotosComeInByCandidates) {
  // The views read photos 0..5 and a stranger, but saw 0..6.
  const auto photos = Photos(3);
  const auto stranger = Photos(4);
  std::vector<const PhotoDetail*> details = InOrder(photos, Identity());
  details.push_back(details[6]);
  details[6] = &stranger[0];
  std::vector<size_t> candidate = Identity();
  candidate[6] = 7;
  const auto better = FindBetterPhotoOrder(Flows(), kNumViews, details, {candidate});
  ASSERT_TRUE(better);
  EXPECT_EQ(better->photo_of_view, candidate);
}

TEST(FindBetterPhotoOrder, UnrelatedPhotosDecideNothing) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    std::vector<PhotoDetail> photos;
    for (size_t i = 0; i < kNumViews; ++i) photos.push_back(Photos(100 * seed + i)[0]);
    EXPECT_FALSE(FindBetterPhotoOrder(Flows(), kNumViews, InOrder(photos, Identity()), {}));
  }
  EXPECT_FALSE(FindBetterPhotoOrder({}, kNumViews, InOrder(Photos(0), Identity()), {}));
}

TEST(NaturalOrder, ComparesRunsOfDigitsAsNumbers) {
  const std::vector<std::string> names = {"img10.png", "img2.png", "img002b.png", "a", "img1/9"};
  EXPECT_EQ(NaturalOrder(names), (std::vector<size_t>{3, 4, 1, 2, 0}));
  EXPECT_EQ(NaturalOrder({"7", "07", "x99999999999999999999999", "x9"}),
            (std::vector<size_t>{0, 1, 3, 2}));
}

}  // namespace
}  // namespace vgtw
