// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/colmap.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/support/colmap.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

// A stand-in whose help and output are known.
std::filesystem::path WriteFakeColmap(const TemporaryFolder& folder, const std::string& help) {
  const std::filesystem::path path = folder / "fake-colmap";
  WriteFileAtomically(path,
                      "#!/bin/sh\n"
                      "case \"$*\" in\n"
                      "  -h) echo 'COLMAP 9.7 -- Structure-from-Motion' ;;\n"
                      "  *-h) echo '" +
                          help +
                          "' ;;\n"
                          "  *) echo 'Processed file [1/2]'; echo 'Processed file [2/2]';\n"
                          "     echo \"got $*\"; exit 3 ;;\n"
                          "esac\n");
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  return path;
}

TEST(Colmap, TranslatesOptionsToTheVersionAtHand) {
  const TemporaryFolder folder;
  const Colmap colmap(WriteFakeColmap(folder, "  --FeatureExtraction.use_gpu arg (=1)"));
  EXPECT_EQ(colmap.version(), "9.7");
  EXPECT_EQ(colmap.Translate("feature_extractor", "SiftExtraction.use_gpu"),
            "FeatureExtraction.use_gpu");
  EXPECT_EQ(colmap.Translate("feature_extractor", "SiftExtraction.unheard_of"), "");
}

TEST(Colmap, RunsFeedsProgressAndReportsTheExitCode) {
  const TemporaryFolder folder;
  const Colmap colmap(WriteFakeColmap(folder, "  --database_path arg"));
  std::vector<std::pair<int64_t, int64_t>> progress;
  std::string last_words;
  testing::internal::CaptureStderr();
  const int exit_code = colmap.Run(
      "matcher",
      {{"database_path", "a b.db"}, {"unheard_of", "1"}},
      folder / "log",
      [&](int64_t done, int64_t total) { progress.emplace_back(done, total); },
      &last_words);
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              testing::HasSubstr("fake-colmap matcher --database_path 'a b.db'\n"));
  EXPECT_EQ(exit_code, 3);
  EXPECT_EQ(progress, (std::vector<std::pair<int64_t, int64_t>>{{1, 2}, {2, 2}}));
  EXPECT_THAT(last_words, testing::HasSubstr("got matcher --database_path a b.db"));
  EXPECT_THAT(ReadFile(folder / "log"), testing::HasSubstr("Processed file [2/2]"));
}

TEST(Colmap, MissingExecutableNamesThePackage) {
  try {
    const Colmap colmap("/nonexistent/colmap");
    FAIL() << "found a colmap that does not exist";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("install the package 'colmap'"));
  }
}

TEST(Colmap, RefusesAnotherProgram) { EXPECT_THROW(Colmap("/bin/true"), Error); }

TEST(Colmap, KnowsTheRealOnesOptions) {
  VGTW_NEED_COLMAP();
  const Colmap colmap(ColmapExecutable());
  EXPECT_GE(std::stod(colmap.version()), 3.0);
  for (const char* option : {"SiftExtraction.use_gpu",
                             "SiftExtraction.num_threads",
                             "SiftExtraction.max_image_size",
                             "SiftExtraction.max_num_features",
                             "ImageReader.mask_path",
                             "image_list_path"}) {
    EXPECT_NE(colmap.Translate("feature_extractor", option), "") << option;
  }
  for (const char* option : {"SiftMatching.use_gpu", "SiftMatching.num_threads"}) {
    EXPECT_NE(colmap.Translate("exhaustive_matcher", option), "") << option;
  }
  for (const char* option : {"clear_points",
                             "Mapper.tri_ignore_two_view_tracks",
                             "Mapper.tri_create_max_angle_error",
                             "Mapper.filter_max_reproj_error"}) {
    EXPECT_NE(colmap.Translate("point_triangulator", option), "") << option;
  }
}

TEST(Colmap, KnowsTheOptionsOfAnotherVersion) {
  VGTW_NEED_OTHER_COLMAP();
  const Colmap colmap(OtherColmapExecutable());
  EXPECT_NE(colmap.Translate("feature_extractor", "SiftExtraction.use_gpu"), "");
  EXPECT_NE(colmap.Translate("sequential_matcher", "SequentialMatching.overlap"), "");
}

}  // namespace
}  // namespace vgtw
