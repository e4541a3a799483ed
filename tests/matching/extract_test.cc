// SPDX-License-Identifier: BSD-3-Clause
#include "matching/extract.h"

#include "scene/random.h"
#include "tests/support/bytes.h"

#include <stdexcept>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core/utility.hpp>

namespace vgtw {
namespace {

// Photo i is 40 + 20 i pixels wide, so that they take different times.
GrayImage Photo(size_t photo_idx) {
  GrayImage image(40 + 20 * static_cast<int>(photo_idx), 100);
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      image(x, y) = static_cast<uint8_t>(
          HashKey({photo_idx, static_cast<uint64_t>(x / 7), static_cast<uint64_t>(y / 7)}) % 256);
    }
  }
  return image;
}

// The larger ones first, so that the order of the end is not that of the beginning.
MaskedPhoto Load(size_t photo_idx) { return {Photo(7 - photo_idx), {}}; }

TEST(ExtractAll, GivesWhatExtractSiftGivesInOrder) {
  for (const int num_threads : {1, 4}) {
    std::vector<Features> all;
    const auto sink = [&](size_t photo_idx, Features features) {
      ASSERT_EQ(photo_idx, all.size());
      all.push_back(std::move(features));
    };
    int64_t num_done = 0;
    ExtractAll(8, Load, sink, {.num_threads = num_threads}, [&](int64_t done, int64_t total) {
      EXPECT_EQ(done, ++num_done);
      EXPECT_EQ(total, 8);
    });
    EXPECT_EQ(num_done, 8);
    ASSERT_EQ(all.size(), 8u);
    for (size_t i = 0; i < all.size(); ++i) {
      const Features expected = ExtractSift(Load(i).image, {}, {});
      EXPECT_GT(expected.keypoints.rows, 0u);
      EXPECT_EQ(all[i].keypoints.data, expected.keypoints.data);
      EXPECT_EQ(all[i].descriptors.data, expected.descriptors.data);
    }
  }
}

TEST(ExtractAll, HeedsMasks) {
  const auto load = [](size_t photo_idx) {
    MaskedPhoto photo = Load(photo_idx);
    if (photo_idx == 1) photo.static_mask = StaticMask(photo.image.width(), 100, 0);
    return photo;
  };
  std::vector<uint32_t> rows;
  ExtractAll(3,
             load,
             [&](size_t, const Features& features) { rows.push_back(features.keypoints.rows); },
             {});
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_GT(rows[0], 0u);
  EXPECT_EQ(rows[1], 0u);
  EXPECT_GT(rows[2], 0u);
}

// With less memory than one photo takes they go one by one, each with all threads waiting.
TEST(ExtractAll, EndsWithTooLittleMemory) {
  size_t num_photos = 0;
  ExtractAll(
      8, Load, [&](size_t, const Features&) { ++num_photos; }, {.num_threads = 4, .max_memory = 1});
  EXPECT_EQ(num_photos, 8u);
}

TEST(ExtractAll, EndsAtTheFirstExceptionWithoutAGap) {
  for (const bool in_sink : {false, true}) {
    std::vector<size_t> idxs;
    const auto load = [&](size_t photo_idx) {
      if (!in_sink && photo_idx == 3) throw Error("photo 3");
      return Load(photo_idx);
    };
    const auto sink = [&](size_t photo_idx, const Features&) {
      if (in_sink && photo_idx == 3) throw Error("photo 3");
      idxs.push_back(photo_idx);
    };
    // One byte: the others wait at the gate when it fails.
    const ExtractOptions options{.num_threads = 4, .max_memory = 1};
    EXPECT_EQ(ErrorOf([&] { ExtractAll(8, load, sink, options); }), "photo 3");
    EXPECT_LE(idxs.size(), 3u);
    for (size_t i = 0; i < idxs.size(); ++i) EXPECT_EQ(idxs[i], i);
  }
}

TEST(ExtractAll, LeavesOpenCvsThreadsAsTheyWere) {
  const int num_threads = cv::getNumThreads();
  const auto sink = [](size_t, const Features&) { EXPECT_EQ(cv::getNumThreads(), 1); };
  ExtractAll(2, Load, sink, {});
  EXPECT_EQ(cv::getNumThreads(), num_threads);
}

TEST(ExtractAll, RefusesBadOptions) {
  const auto sink = [](size_t, const Features&) {};
  EXPECT_THROW(ExtractAll(1, Load, sink, {.max_memory = -1}), std::invalid_argument);
  EXPECT_THROW(ExtractAll(1, Load, sink, {.sift = {.max_num_features = 0}}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
