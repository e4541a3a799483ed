// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/npz.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/bridge/numpy_files.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

std::vector<float> Read(NpyReader reader, size_t count) {
  std::vector<float> values(count);
  reader.Read(std::span<float>(values));
  return values;
}

TEST(Npz, ReadsStoredAndCompressedArchives) {
  const TemporaryFolder folder;
  for (const bool compressed : {false, true}) {
    const auto path = folder / "a.npz";
    WriteNpz(path, {{"b", NpyFloats("(2,)", {3, 4})}, {"a", NpyFloats("(1,)", {1})}}, compressed);
    const auto store = OpenArrayStore(path);
    EXPECT_EQ(store->keys(), (std::vector<std::string>{"a", "b"}));
    EXPECT_TRUE(store->Contains("a"));
    EXPECT_FALSE(store->Contains("a.npy"));
    EXPECT_EQ(Read(store->Open("a"), 1), std::vector<float>{1});
    EXPECT_EQ(Read(store->Open("b"), 2), (std::vector<float>{3, 4}));
  }
}

TEST(Npz, SeveralArraysAreReadAtTheSameTime) {
  const TemporaryFolder folder;
  WriteNpz(folder / "a.npz",
           {{"a", NpyFloats("(2,)", {1, 2})}, {"b", NpyFloats("(2,)", {3, 4})}},
           /*compressed=*/true);
  auto store = OpenArrayStore(folder / "a.npz");
  NpyReader a = store->Open("a");
  NpyReader b = store->Open("b");
  store.reset();  // readers hold the archive
  std::vector<float> values(4);
  a.Read(std::span(values).subspan(0, 1));
  b.Read(std::span(values).subspan(1, 1));
  a.Read(std::span(values).subspan(2, 1));
  b.Read(std::span(values).subspan(3, 1));
  EXPECT_EQ(values, (std::vector<float>{1, 3, 2, 4}));
}

TEST(Npz, AFolderOfNpyFilesIsAStore) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "depth.npy", NpyFloats("(2,)", {5, 6}));
  WriteFileAtomically(folder / "readme.txt", "no array");
  const auto store = OpenArrayStore(folder.path());
  EXPECT_EQ(store->keys(), std::vector<std::string>{"depth"});
  EXPECT_EQ(Read(store->Open("depth"), 2), (std::vector<float>{5, 6}));
}

TEST(Npz, AMissingKeyNamesThoseThatExist) {
  const TemporaryFolder folder;
  WriteNpz(folder / "a.npz", {{"poses", NpyFloats("(1,)", {1})}});
  try {
    OpenArrayStore(folder / "a.npz")->Open("extrinsic");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("'extrinsic' (it has: poses)"), std::string::npos)
        << error.what();
  }
}

TEST(Npz, AnUnreadableKeyDoesNoHarmToOthers) {
  const TemporaryFolder folder;
  WriteNpz(folder / "a.npz",
           {{"pose_enc_list", NpyBytes("|O", "()", "pickle")},
            {"../../up", NpyFloats("(1,)", {8})},
            {"depth", NpyFloats("(1,)", {7})}});
  const auto store = OpenArrayStore(folder / "a.npz");
  EXPECT_EQ(Read(store->Open("depth"), 1), std::vector<float>{7});
  EXPECT_THROW(store->Open("pose_enc_list"), Error);
  EXPECT_EQ(Snapshot(folder.path()).size(), 1u);
}

TEST(Npz, EveryTruncationIsAnError) {
  const TemporaryFolder folder;
  WriteNpz(folder / "a.npz", {{"a", NpyFloats("(2,)", {1, 2})}});
  const std::string bytes = ReadFile(folder / "a.npz");
  EXPECT_EQ(Read(OpenArchive(bytes, "memory")->Open("a"), 2), (std::vector<float>{1, 2}));
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_THROW(Read(OpenArchive(bytes.substr(0, size), "memory")->Open("a"), 2), Error) << size;
  }
}

TEST(Npz, ADamagedEntryIsAnError) {
  const TemporaryFolder folder;
  WriteNpz(folder / "a.npz", {{"a", NpyFloats("(2,)", {1, 2})}}, /*compressed=*/true);
  std::string bytes = ReadFile(folder / "a.npz");
  for (size_t i = 40; i < 60; ++i) bytes[i] = static_cast<char>(~bytes[i]);
  EXPECT_THROW(Read(OpenArchive(bytes, "memory")->Open("a"), 2), Error);
}

TEST(Npz, ShapesLargerThanTheEntryAreRefusedBeforeMemoryIsTaken) {
  const TemporaryFolder folder;
  // 2^60 values in a small file.
  WriteNpz(folder / "a.npz", {{"a", NpyFloats("(1152921504606846976,)", {1, 2})}}, true);
  EXPECT_THROW(OpenArrayStore(folder / "a.npz")->Open("a"), Error);
}

TEST(Npz, OtherFilesAreErrors) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "a.npz", "no archive");
  EXPECT_THROW(OpenArrayStore(folder / "a.npz"), Error);
  EXPECT_THROW(OpenArrayStore(folder / "missing.npz"), Error);
  EXPECT_THROW(OpenNpyFile(folder / "missing.npy"), Error);
  EXPECT_THROW(OpenNpyFile(folder / "a.npz"), Error);
  EXPECT_THROW(OpenNpyFile(folder.path()), Error);
}

}  // namespace
}  // namespace vgtw
