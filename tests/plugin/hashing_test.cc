// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/hashing.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(Hashing, GivesThePublishedDigestOfAbc) {
  // FIPS 180-2, appendix B.1.
  EXPECT_EQ(HashText("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(Hashing, FileAndTextAgree) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "abc", "abc");
  WriteFileAtomically(folder / "empty", "");
  EXPECT_EQ(HashFile(folder / "abc"), HashText("abc"));
  EXPECT_EQ(HashFile(folder / "empty"), HashText(""));
}

TEST(Hashing, FolderHashSeesContentAndNameButNotThreads) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "b");
  WriteFileAtomically(folder / "a", "1");
  WriteFileAtomically(folder / "b/c", "2");
  const std::vector<std::string> names = ListFiles(folder.path());
  ASSERT_EQ(names, (std::vector<std::string>{"a", "b/c"}));
  const std::string before = HashFiles(folder.path(), names, 1);
  EXPECT_EQ(HashFiles(folder.path(), names, 4), before);
  WriteFileAtomically(folder / "a", "3");
  EXPECT_NE(HashFiles(folder.path(), names, 1), before);
  WriteFileAtomically(folder / "a", "1");
  EXPECT_EQ(HashFiles(folder.path(), names, 1), before);
  std::filesystem::rename(folder / "a", folder / "aa");
  EXPECT_NE(HashFiles(folder.path(), ListFiles(folder.path()), 1), before);
}

TEST(Hashing, MissingFileIsAnError) {
  const TemporaryFolder folder;
  EXPECT_THROW(HashFile(folder / "none"), Error);
}

}  // namespace
}  // namespace vgtw
