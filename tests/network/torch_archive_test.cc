// SPDX-License-Identifier: BSD-3-Clause
#include "network/torch_archive.h"

#include "scene/error.h"
#include "tests/network/torch_files.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using namespace torch_files;
using testing::AllOf;
using testing::HasSubstr;

const std::filesystem::path kPath = "a.pt";
const std::vector<ZipEntry> kEntries = {{"w/data.pkl", "pickle"},
                                        {"w/byteorder", "little"},
                                        {"w/data/0", std::string(8, 'x')},
                                        {"w/data/1", ""},
                                        {"w/version", "3\n"}};

std::string StringOf(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string ErrorOfFile(const std::string& file) {
  return ErrorOf([&] { ParseTorchArchive(AsBytes(file), kPath); });
}

std::string ErrorOfEntries(const std::vector<ZipEntry>& entries) {
  return ErrorOfFile(Zip(entries));
}

// `file` with the bytes at `position` replaced.
std::string Patched(std::string file, size_t position, const std::string& bytes) {
  return file.replace(position, bytes.size(), bytes);
}

TEST(TorchArchive, FindsEveryEntryInPlace) {
  for (const bool is_zip64 : {false, true}) {
    const std::string file = Zip(kEntries, is_zip64);
    const TorchArchive archive = ParseTorchArchive(AsBytes(file), kPath);
    EXPECT_EQ(StringOf(archive.pickle), "pickle");
    ASSERT_EQ(archive.storages.size(), 2u);
    EXPECT_EQ(StringOf(archive.storages.at("0")), "xxxxxxxx");
    EXPECT_TRUE(archive.storages.at("1").empty());
    // Not a copy, and aligned as torch aligns.
    const auto* begin = reinterpret_cast<const std::byte*>(file.data());
    EXPECT_EQ((archive.storages.at("0").data() - begin) % 64, 0);
  }
}

TEST(TorchArchive, EveryTruncationIsAnError) {
  for (const bool is_zip64 : {false, true}) {
    const std::string file = Zip(kEntries, is_zip64);
    ASSERT_EQ(ErrorOfFile(file), "");
    for (size_t length = 0; length < file.size(); ++length) {
      EXPECT_THAT(ErrorOfFile(file.substr(0, length)), HasSubstr("truncated")) << length;
    }
    EXPECT_THAT(ErrorOfFile(file + "x"), HasSubstr("does not end"));
  }
}

// Whatever a flipped bit makes of the records, spans stay inside the file and apart.
TEST(TorchArchive, NoFlippedBitLeadsOutOfTheFile) {
  for (const bool is_zip64 : {false, true}) {
    const std::string file = Zip(kEntries, is_zip64);
    ASSERT_EQ(ErrorOfFile(file), "");
    size_t num_accepted = 0;
    for (size_t bit = 0; bit < file.size() * 8; ++bit) {
      std::string damaged = file;
      damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ 1 << bit % 8);
      try {
        const TorchArchive archive = ParseTorchArchive(AsBytes(damaged), kPath);
        ++num_accepted;
        for (const auto& [key, data] : archive.storages) {
          ASSERT_GE(reinterpret_cast<const char*>(data.data()), damaged.data());
          ASSERT_LE(reinterpret_cast<const char*>(data.data()) + data.size(),
                    damaged.data() + damaged.size());
        }
      } catch (const Error&) {
      }
    }
    EXPECT_GT(num_accepted, 0u);
  }
}

TEST(TorchArchive, AbsurdSizesAndOffsetsAreErrors) {
  const std::string file = Zip(kEntries);
  const size_t entry = file.find("PK\x01\x02");
  const size_t end = file.size() - 22;
  for (const uint32_t absurd : {0xffffffffu, 0xfffffffeu, 0x7fffffffu, 100000u}) {
    const std::string bytes = Bytes(absurd);
    EXPECT_NE(ErrorOfFile(Patched(file, entry + 20, bytes + bytes)), "");  // both sizes
    EXPECT_NE(ErrorOfFile(Patched(file, entry + 42, bytes)), "");          // offset
    EXPECT_NE(ErrorOfFile(Patched(file, end + 12, bytes)), "");            // directory's size
    EXPECT_NE(ErrorOfFile(Patched(file, end + 16, bytes)), "");            // directory's offset
  }
  EXPECT_NE(ErrorOfFile(Patched(file, end + 10, Bytes(uint16_t{0xffff}))), "");
  EXPECT_NE(ErrorOfFile(Patched(file, end + 10, Bytes(uint16_t{4}))), "");

  const std::string large = Zip(kEntries, true);
  ASSERT_EQ(ErrorOfFile(large), "");
  const size_t fields = large.find("w/data.pklZZ") + 10 + 9;  // behind an extra field and an id
  const size_t record = large.find("PK\x06\x06");
  for (const uint64_t absurd : {UINT64_MAX, UINT64_MAX - 30, uint64_t{1} << 63, uint64_t{100000}}) {
    const std::string bytes = Bytes(absurd);
    EXPECT_NE(ErrorOfFile(Patched(large, fields, bytes + bytes)), "");
    EXPECT_NE(ErrorOfFile(Patched(large, fields + 16, bytes)), "");
    for (const size_t field : {32u, 40u, 48u}) {
      EXPECT_NE(ErrorOfFile(Patched(large, record + field, bytes)), "") << field;
    }
    EXPECT_NE(ErrorOfFile(Patched(large, large.size() - 22 - 12, bytes)), "");
  }
}

TEST(TorchArchive, CompressedAndEncryptedEntriesAreRefused) {
  auto entries = kEntries;
  entries[2].method = 8;
  EXPECT_THAT(ErrorOfEntries(entries), AllOf(HasSubstr("'w/data/0'"), HasSubstr("compressed")));
  entries[2].method = 0;
  for (const int bit : {0, 6, 13}) {
    entries[2].flags = static_cast<uint16_t>(1 << bit);
    EXPECT_THAT(ErrorOfEntries(entries), HasSubstr("encrypted"));
  }
  // Larger than it is stored, without a method that would explain it.
  const std::string file = Zip(kEntries);
  const size_t size = file.find("PK\x01\x02") + 24;
  EXPECT_THAT(ErrorOfFile(Patched(file, size, Bytes(uint32_t{9}))), HasSubstr("compressed"));
}

TEST(TorchArchive, OverlappingAndRepeatedEntriesAreRefused) {
  auto entries = kEntries;
  entries[3].name = "w/data/0";
  EXPECT_THAT(ErrorOfEntries(entries), AllOf(HasSubstr("'w/data/0'"), HasSubstr("twice")));
  // Two directory entries for one place, and one entry that holds the next.
  const std::string file = Zip({{"w/data.pkl", "p"}, {"w/data/00", "x"}, {"w/data/00", "x"}});
  const size_t third = file.rfind("PK\x01\x02");
  const size_t offset = file.rfind("PK\x01\x02", third - 1) + 42;
  EXPECT_THAT(ErrorOfFile(Patched(file, third + 42, file.substr(offset, 4))), HasSubstr("overlap"));
  EXPECT_THAT(ErrorOfFile(Patched(file, offset - 22, Bytes(uint32_t{80}, uint32_t{80}))),
              HasSubstr("overlap"));
}

TEST(TorchArchive, HeadersMustAgreeWithTheDirectory) {
  const std::string file = Zip(kEntries);
  EXPECT_THAT(ErrorOfFile(Patched(file, 30, "W")), HasSubstr("another header"));
  EXPECT_THAT(ErrorOfFile(Patched(file, 8, "\x08")), HasSubstr("another header"));
  EXPECT_THAT(ErrorOfFile(Patched(file, 0, "XX")), HasSubstr("no header"));
}

TEST(TorchArchive, OtherProgramsFilesAreNamed) {
  EXPECT_THAT(ErrorOfFile("\x80\x02\x8a\x0al\xfc\x9c\x46\xf9\x20\x6a\xa8P\x19."),
              AllOf(HasSubstr("torch before 1.6"), HasSubstr("torch.save(torch.load(")));
  EXPECT_THAT(ErrorOfEntries({{"m/data.pkl", "p"}, {"m/code/__torch__.py", "x", 8}}),
              AllOf(HasSubstr("TorchScript"), HasSubstr("state_dict()")));
  EXPECT_THAT(ErrorOfEntries({{"m/data.pkl", "p"}, {"m/constants.pkl", "x"}}),
              HasSubstr("TorchScript"));
  EXPECT_THAT(ErrorOfEntries({{"a.npy", "x"}, {"b.npy", "x"}}), HasSubstr("no common folder"));
  EXPECT_THAT(ErrorOfEntries({{"w/data.pkl", "p"}, {"v/data/0", "x"}}),
              HasSubstr("no common folder"));
  EXPECT_THAT(ErrorOfEntries({{"w/a", "p"}}), HasSubstr("without data.pkl"));
  EXPECT_THAT(ErrorOfEntries({}), HasSubstr("no common folder"));
}

TEST(TorchArchive, OnlyLittleEndianDataIsRead) {
  auto entries = kEntries;
  for (const char* order : {"big", "", "littleX", "Little"}) {
    entries[1].data = order;
    EXPECT_THAT(ErrorOfEntries(entries), HasSubstr("not little-endian")) << order;
  }
}

}  // namespace
}  // namespace vgtw
