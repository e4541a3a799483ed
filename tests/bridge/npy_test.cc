// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/npy.h"

#include "scene/error.h"
#include "tests/bridge/numpy_files.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

NpyReader ReaderOf(const std::string& bytes) {
  auto position = std::make_shared<size_t>(0);
  return NpyReader(
      [bytes, position](std::span<std::byte> target) {
        const size_t count = std::min(target.size(), bytes.size() - *position);
        if (count > 0) std::memcpy(target.data(), bytes.data() + *position, count);
        *position += count;
        return count;
      },
      bytes.size(),
      "test.npy");
}

std::vector<double> Values(const std::string& bytes) {
  NpyReader reader = ReaderOf(bytes);
  size_t count = 1;
  for (const uint64_t length : reader.shape()) count *= length;
  std::vector<double> values(count);
  reader.Read(std::span<double>(values));
  return values;
}

std::string MessageOf(const std::string& bytes) {
  try {
    Values(bytes);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

using Doubles = std::vector<double>;

TEST(Npy, ReadsBytesThatNumpyWrites) {
  // numpy.save of numpy.array([[1.5, -2.0]], dtype='<f4'), NumPy 1.24: 128 bytes of header.
  std::string bytes("\x93NUMPY\x01\x00\x76\x00", 10);
  bytes += "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }";
  bytes += std::string(127 - bytes.size(), ' ') + '\n';
  bytes += std::string("\x00\x00\xc0\x3f\x00\x00\x00\xc0", 8);
  EXPECT_EQ(ReaderOf(bytes).shape(), (std::vector<uint64_t>{1, 2}));
  EXPECT_EQ(Values(bytes), (Doubles{1.5, -2.0}));
}

TEST(Npy, ConvertsEveryType) {
  EXPECT_EQ(Values(NpyBytes("|b1", "(3,)", std::string("\x00\x01\x02", 3))), (Doubles{0, 1, 1}));
  EXPECT_EQ(Values(NpyBytes("|u1", "(2,)", "\x07\xff")), (Doubles{7, 255}));
  EXPECT_EQ(Values(NpyBytes("<i4", "(2,)", RawBytes<int32_t>({-3, 1 << 30}))),
            (Doubles{-3, 1 << 30}));
  EXPECT_EQ(Values(NpyBytes("<i8", "(1,)", RawBytes<int64_t>({-(int64_t{1} << 40)}))),
            (Doubles{-std::ldexp(1.0, 40)}));
  EXPECT_EQ(Values(NpyFloats("(1,)", {0.1f})), (Doubles{0.1f}));
  EXPECT_EQ(Values(NpyDoubles("(1,)", {0.1})), (Doubles{0.1}));
}

TEST(Npy, ConvertsHalfPrecisionExactly) {
  // one, -2, the largest (65504), the smallest subnormal 2^-24, infinity.
  const std::string bytes =
      NpyBytes("<f2", "(5,)", RawBytes<uint16_t>({0x3c00, 0xc000, 0x7bff, 0x0001, 0x7c00}));
  EXPECT_EQ(Values(bytes),
            (Doubles{1, -2, 65504, std::ldexp(1.0, -24), std::numeric_limits<double>::infinity()}));
  EXPECT_TRUE(std::isnan(Values(NpyBytes("<f2", "(1,)", RawBytes<uint16_t>({0x7e00})))[0]));
}

TEST(Npy, FortranOrderComesInCOrder) {
  // [[0, 1, 2], [3, 4, 5]] stored column by column.
  const std::string bytes =
      NpyBytes("<f4", "(2, 3)", RawBytes<float>({0, 3, 1, 4, 2, 5}), /*is_fortran_order=*/true);
  EXPECT_EQ(Values(bytes), (Doubles{0, 1, 2, 3, 4, 5}));
  // a[i][j][k] = 100 i + 10 j + k of shape (2, 1, 2), first index fastest.
  EXPECT_EQ(Values(NpyBytes("<f4", "(2, 1, 2)", RawBytes<float>({0, 100, 1, 101}), true)),
            (Doubles{0, 1, 100, 101}));
}

TEST(Npy, ReadsVersionsTwoAndThree) {
  for (const int version : {1, 2, 3}) {
    EXPECT_EQ(Values(NpyBytes("<f4", "(2,)", RawBytes<float>({4, 5}), false, version)),
              (Doubles{4, 5}));
  }
}

TEST(Npy, ReadsAScalarAndAnEmptyArray) {
  EXPECT_EQ(Values(NpyFloats("()", {3.0f})), Doubles{3.0});
  EXPECT_TRUE(Values(NpyFloats("(0, 5)", {})).empty());
}

TEST(Npy, ReadsPieceByPiece) {
  // More values than one internal chunk, so that pieces cross its border.
  std::vector<float> truth(200000);
  for (size_t i = 0; i < truth.size(); ++i) truth[i] = static_cast<float>(i);
  NpyReader reader = ReaderOf(NpyFloats("(200000,)", truth));
  std::vector<float> read(truth.size());
  reader.Read(std::span(read).first(70001));
  reader.Read(std::span(read).subspan(70001));
  EXPECT_EQ(read, truth);
  float beyond = 0.0f;
  EXPECT_THROW(reader.Read(std::span(&beyond, 1)), std::invalid_argument);
}

TEST(Npy, EveryTruncationIsAnError) {
  const std::string bytes = NpyFloats("(2, 3)", {0, 1, 2, 3, 4, 5});
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_THROW(Values(bytes.substr(0, size)), Error) << size;
  }
}

TEST(Npy, AbsurdShapesAreErrors) {
  for (const char* shape : {"(4294967296, 4294967296, 2)",
                            "(18446744073709551615,)",
                            "(99999999999999999999999,)",
                            "(-1,)",
                            "(2, 3",
                            "(1,1,1,1,1,1,1,1,1)",
                            "7"}) {
    EXPECT_NE(MessageOf(NpyBytes("<f4", shape, std::string(24, 'x'))), "") << shape;
  }
}

TEST(Npy, OtherTypesAreNamed) {
  EXPECT_NE(MessageOf(NpyBytes("|O", "(1,)", "x")).find("'|O'"), std::string::npos);
  EXPECT_NE(MessageOf(NpyBytes(">f4", "(1,)", "xxxx")).find("'>f4'"), std::string::npos);
  const std::string structured =
      NpyWithHeader("{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (1,), }", "xxxx");
  EXPECT_NE(MessageOf(structured).find("structured"), std::string::npos);
}

TEST(Npy, DamagedHeadersAreErrors) {
  for (const char* header :
       {"",
        "{}",
        "{'descr': '<f4', 'fortran_order': False, }",
        "{'descr': '<f4', 'descr': '<f4', 'shape': (1,), }",
        "{'descr': '<f4', 'fortran_order': Maybe, 'shape': (1,), }",
        "{'descr': '<f4, 'fortran_order': False, 'shape': (1,), }",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (1,), } x",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (1,), 'more': 1}"}) {
    EXPECT_NE(MessageOf(NpyWithHeader(header, "xxxx")), "") << header;
  }
  std::string version = NpyFloats("(1,)", {1});
  version[6] = 9;
  EXPECT_NE(MessageOf(version).find("version 9"), std::string::npos);
  std::string length = NpyFloats("(1,)", {1});
  length[9] = '\x7f';
  EXPECT_NE(MessageOf(length), "");
}

}  // namespace
}  // namespace vgtw
