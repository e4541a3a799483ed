// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_photos.h"

#include "scene/error.h"
#include "tests/bridge/numpy_files.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Indices = std::vector<size_t>;

std::vector<Photo> Photos(const std::vector<std::string>& names) {
  std::vector<Photo> photos;
  for (const std::string& name : names) photos.push_back({name, {4, 3}});
  return photos;
}

TEST(ListPhotos, SortsByBytesAndReadsSizes) {
  const TemporaryFolder folder;
  WritePhotos(folder.path(), {"img10.png", "img2.png", "sub/a.png"}, 40, 30);
  const std::vector<Photo> photos = ListPhotos(folder.path(), 2);
  ASSERT_EQ(photos.size(), 3u);
  EXPECT_EQ(photos[0].name, "img10.png");
  EXPECT_EQ(photos[1].name, "img2.png");
  EXPECT_EQ(photos[2].name, "sub/a.png");
  EXPECT_EQ(photos[2].size, (ImageSize{40, 30}));
}

TEST(PhotoIndex, PrefersTheWholeName) {
  const auto photos = Photos({"a.png", "x/a.png", "x/b.png"});
  const PhotoIndex index(photos);
  EXPECT_EQ(index.Find("a.png"), 0u);
  EXPECT_EQ(index.Find("x/a.png"), 1u);
  EXPECT_EQ(index.Find("b.png"), 2u);
  EXPECT_EQ(index.Find("old/b.png"), 2u);
  EXPECT_EQ(index.Find("old/a.png"), std::nullopt);  // two photos have that base name
  EXPECT_EQ(index.Find("c.png"), std::nullopt);
}

TEST(PhotoIndex, FindsNamesWithoutExtensionOnRequest) {
  const auto photos = Photos({"a.jpg", "a.png", "v1.5.jpg", "x/b.png"});
  const PhotoIndex index(photos);
  EXPECT_EQ(index.Find("b"), std::nullopt);
  EXPECT_EQ(index.Find("b", true), 3u);
  EXPECT_EQ(index.Find("x/b", true), 3u);
  EXPECT_EQ(index.Find("v1.5", true), 2u);
  EXPECT_EQ(index.Find("a", true), std::nullopt);  // a.jpg or a.png
}

TEST(PhotoIndex, FindAllNamesWhatIsMissing) {
  const auto photos = Photos({"a.png", "b.png"});
  const PhotoIndex index(photos);
  EXPECT_EQ(index.FindAll("model", {"b.png", "a.png"}), (Indices{1, 0}));
  try {
    index.FindAll("model", {"a.png", "p.png", "q.png", "r.png", "s.png"});
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what())
                  .find("4 of 5 names match no photo or several (p.png, q.png, r.png, ...)"),
              std::string::npos)
        << error.what();
  }
}

TEST(PhotoIndex, TwoNamesOfOnePhotoAreAnError) {
  const auto photos = Photos({"a.png", "b.png"});
  EXPECT_THROW(PhotoIndex(photos).FindAll("model", {"left/a.png", "right/a.png"}), Error);
}

}  // namespace
}  // namespace vgtw
