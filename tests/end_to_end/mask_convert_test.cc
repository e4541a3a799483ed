// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_conventions.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

TEST(MaskConvert, SaysWhatToSetInTheToolAndComesBack) {
  const TemporaryFolder folder;
  const std::string root = folder.path().string();
  WriteImage(folder / "photos/a b.jpg", GrayImage(8, 4, 90));
  WriteImage(folder / "photos/c.jpg", GrayImage(8, 4, 90));
  StaticMask static_mask(8, 4, 255);
  for (int x = 0; x < 8; ++x) static_mask(x, 2) = 0;
  WriteImage(folder / "masks/a b.jpg.png", static_mask);
  const ColmapRun there = RunVgtw({"mask",
                                   "convert",
                                   "--image_path",
                                   root + "/photos",
                                   "--mask_path",
                                   root + "/masks",
                                   "--to",
                                   "instant-ngp",
                                   "--output_path",
                                   root + "/ngp"});
  ASSERT_EQ(there.exit_code, 0) << there.output;
  EXPECT_THAT(there.output, HasSubstr("a b.jpg              25.00"));
  EXPECT_THAT(there.output, HasSubstr("c.jpg    no mask, all kept"));
  EXPECT_THAT(there.output, HasSubstr("for instant-ngp: copy the files beside the photos"));
  const ColmapRun back = RunVgtw({"mask",
                                  "convert",
                                  "--image_path",
                                  root + "/photos",
                                  "--mask_path",
                                  root + "/ngp",
                                  "--from",
                                  "instant-ngp",
                                  "--output_path",
                                  root + "/back"});
  ASSERT_EQ(back.exit_code, 0) << back.output;
  EXPECT_EQ(ReadFile(folder / "back/a b.jpg.png"), ReadFile(folder / "masks/a b.jpg.png"));
  EXPECT_EQ(ReadStaticMask(folder / "back/c.jpg.png"), StaticMask(8, 4, 255));
}

TEST(MaskConvert, ListsEveryConvention) {
  const TemporaryFolder folder;
  const std::string json_path = (folder / "list.json").string();
  const ColmapRun run = RunVgtw({"mask", "convert", "--list", "--json", json_path});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const auto conventions = ReadJson(json_path).at("conventions");
  ASSERT_EQ(conventions.size(), MaskConventions().size());
  for (size_t i = 0; i < conventions.size(); ++i) {
    const std::string id(MaskConventions()[i].id);
    EXPECT_EQ(conventions[i].at("id"), id);
    EXPECT_THAT(run.output, HasSubstr("\n" + id + " "));
  }
}

TEST(MaskConvert, WrongUseIsOneLine) {
  const ColmapRun no_photos = RunVgtw({"mask", "convert"});
  EXPECT_EQ(no_photos.exit_code, 1);
  EXPECT_THAT(no_photos.output, HasSubstr("no --image_path, expected the photos"));
  const ColmapRun unknown = RunVgtw({"mask", "convert", "--to", "sam2"});
  EXPECT_EQ(unknown.exit_code, 2);
}

}  // namespace
}  // namespace vgtw
