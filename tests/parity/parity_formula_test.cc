// SPDX-License-Identifier: BSD-3-Clause
#include "tests/parity/parity_formula.h"

#include "tests/scene/raw_png.h"
#include "tests/support/shared_data.h"

#include <bit>
#include <cstring>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// CRC-32 of the little-endian bytes, as 8 hexadecimal digits.
std::string Crc32(const std::vector<float>& values) {
  static_assert(std::endian::native == std::endian::little);
  std::string bytes(values.size() * sizeof(float), '\0');
  std::memcpy(bytes.data(), values.data(), bytes.size());
  const std::string chunk = PngChunk("", bytes);  // ends with the CRC of what it holds
  std::ostringstream digits;
  for (const char c : chunk.substr(chunk.size() - 4)) {
    digits << std::hex << (static_cast<uint8_t>(c) >> 4) << (static_cast<uint8_t>(c) & 15);
  }
  return digits.str();
}

struct Row {
  std::string name;
  std::vector<int64_t> shape;
  ParityRule rule;
  std::string crc;
};

// The parameters of a network, as the Python program listed them.
std::vector<Row> ReadRows(const std::filesystem::path& path) {
  std::vector<Row> rows;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with('#')) continue;
    Row& row = rows.emplace_back();
    std::string sizes;
    std::string first_value;
    std::istringstream fields(line);
    fields >> row.name >> sizes >> row.rule.offset >> row.rule.scale >> first_value >> row.crc;
    std::istringstream numbers(sizes);
    for (std::string number; std::getline(numbers, number, 'x');) {
      row.shape.push_back(std::stoll(number));
    }
  }
  return rows;
}

class ParityFormula : public testing::TestWithParam<const char*> {};

TEST_P(ParityFormula, GivesTheBytesOfEveryParameter) {
  VGTW_NEED_PARITY_DATA();
  const std::vector<Row> rows = ReadRows(ParityData() / (std::string(GetParam()) + ".params.tsv"));
  EXPECT_GT(rows.size(), 100u);
  for (const Row& row : rows) {
    const ParityRule rule = ParityRuleOf(row.name, row.shape);
    EXPECT_EQ(rule.offset, row.rule.offset) << row.name;
    EXPECT_EQ(rule.scale, row.rule.scale) << row.name;
    EXPECT_EQ(Crc32(ParityWeights(row.name, row.shape)), row.crc) << row.name;
  }
}

INSTANTIATE_TEST_SUITE_P(SmallNetworks,
                         ParityFormula,
                         testing::Values("vggt_conv", "vgtw_dino", "pi3_dino"));

TEST(Fnv1a, GivesPublishedHashes) {
  EXPECT_EQ(Fnv1a(""), 0xcbf29ce484222325u);
  EXPECT_EQ(Fnv1a("a"), 0xaf63dc4c8601ec8cu);
}

// First values as the Python program printed them.
TEST(ParityFormula, StartsWithTheListedValues) {
  EXPECT_EQ(ParityWeights("aggregator.camera_token", {1, 2, 1, 48})[0], -0x1.a5c9p-14f);
  EXPECT_EQ(ParityWeights("encoder.cls_token", {1, 1, 48})[0], 0x1.0f212cp-4f);
  // The rule scales the same random number.
  EXPECT_EQ(ParityRandom("encoder.cls_token", 48)[0], 0x1.0f212cp-2f);
}

// Two pixels at the start and one at the end, where every term of the wave counts.
TEST(ParityFormula, DrawsAWaveWithNoise) {
  const std::vector<uint8_t> pixels = ParityImages("a", 2, 7, 60);
  ASSERT_EQ(pixels.size(), 2u * 3u * 7u * 60u);
  EXPECT_EQ(pixels[0], 24);
  EXPECT_EQ(pixels[1], 59);
  EXPECT_EQ(pixels.back(), 74);
  EXPECT_EQ(pixels, ParityPixels("images.a", 2, 7, 60));
  EXPECT_NE(pixels, ParityPixels("a", 2, 7, 60));
}

}  // namespace
}  // namespace vgtw
