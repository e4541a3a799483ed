// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/base64.h"

#include <array>
#include <string_view>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

std::string Encode(std::string_view text) {
  return Base64(std::as_bytes(std::span(text.data(), text.size())));
}

// RFC 4648, section 10.
TEST(Base64, GivesTheVectorsOfTheStandard) {
  EXPECT_EQ(Encode(""), "");
  EXPECT_EQ(Encode("f"), "Zg==");
  EXPECT_EQ(Encode("fo"), "Zm8=");
  EXPECT_EQ(Encode("foo"), "Zm9v");
  EXPECT_EQ(Encode("foob"), "Zm9vYg==");
  EXPECT_EQ(Encode("fooba"), "Zm9vYmE=");
  EXPECT_EQ(Encode("foobar"), "Zm9vYmFy");
}

TEST(Base64, KeepsBytesAbove127) {
  constexpr std::array bytes = {std::byte{0xfb}, std::byte{0xff}, std::byte{0x00}};
  EXPECT_EQ(Base64(bytes), "+/8A");
}

}  // namespace
}  // namespace vgtw
