// SPDX-License-Identifier: BSD-3-Clause
#include "network/checkpoint_convert.h"

#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::AllOf;
using testing::HasSubstr;

template <typename T>
std::string Packed(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

class ConvertCheckpointTest : public testing::Test {
 protected:
  // `bytes` of one tensor "w" after conversion.
  std::string Converted(TensorType from, const std::string& bytes, TensorType to) {
    Write({{"w", {from, {bytes.size() / SizeInBytes(from)}, AsBytes(bytes)}}});
    ConvertCheckpoint(Checkpoint(folder_ / "in"), to, folder_ / "out", /*overwrite=*/true);
    const SafetensorsFile file(folder_ / "out");
    const StoredTensor& tensor = file.tensors().at("w");
    EXPECT_EQ(tensor.type, to);
    return {reinterpret_cast<const char*>(tensor.bytes.data()), tensor.bytes.size()};
  }

  std::vector<uint16_t> Narrowed(TensorType from, const std::string& bytes, TensorType to) {
    const std::string converted = Converted(from, bytes, to);
    std::vector<uint16_t> narrow(converted.size() / 2);
    std::memcpy(narrow.data(), converted.data(), converted.size());
    return narrow;
  }

  void Write(const StoredTensors& tensors) {
    WriteSafetensors(folder_ / "in", tensors, {{"format", "pt"}});
  }

  TemporaryFolder folder_;
};

// The value of a finite number with `num_bits` of fraction below 16 - 1 - num_bits of exponent.
double ValueOf(uint16_t bits, int num_bits) {
  const int bias = (1 << (14 - num_bits)) - 1;
  const int exponent = bits >> num_bits & ((1 << (15 - num_bits)) - 1);
  const double fraction = bits & ((1 << num_bits) - 1);
  const double value = exponent == 0
                           ? std::ldexp(fraction, 1 - bias - num_bits)
                           : std::ldexp(fraction + (1 << num_bits), exponent - bias - num_bits);
  return bits >> 15 != 0 ? -value : value;
}

// Every neighbouring pair of 16-bit numbers, the middle between them, and the doubles next to it:
// a middle goes to the even one, others to the nearer one. Rounding twice would fail the latter.
TEST_F(ConvertCheckpointTest, DoublesAreRoundedOnceToNearestEven) {
  for (const auto& [type, num_bits, infinity] :
       {std::tuple(TensorType::kF16, 10, 0x7c00), std::tuple(TensorType::kBF16, 7, 0x7f80)}) {
    std::vector<double> inputs;
    std::vector<uint16_t> expected;
    const auto add = [&](double value, int bits) {
      for (const int sign : {0, 0x8000}) {
        inputs.push_back(sign == 0 ? value : -value);
        expected.push_back(static_cast<uint16_t>(bits | sign));
      }
    };
    for (int bits = 0; bits + 1 < infinity; ++bits) {
      const double low = ValueOf(static_cast<uint16_t>(bits), num_bits);
      const double high = ValueOf(static_cast<uint16_t>(bits + 1), num_bits);
      const double middle = (low + high) / 2;
      add(low, bits);
      add(std::nextafter(middle, low), bits);
      add(middle, bits + bits % 2);
      add(std::nextafter(middle, high), bits + 1);
    }
    EXPECT_EQ(Narrowed(TensorType::kF64, Packed(inputs), type), expected);
  }
}

TEST_F(ConvertCheckpointTest, FloatsAreRoundedToNearestEven) {
  // 1 + 2^-11 is the middle of 1 and the next half; 1 + 3 2^-11 that of the next two. 2^-25 is the
  // middle of 0 and the smallest half.
  const std::string inputs = Bytes(1.0f,
                                   1 + 0x1p-11f,
                                   1 + 0x3p-11f,
                                   1 + 0x1p-11f + 0x1p-23f,
                                   -0.0f,
                                   0x1p-25f,
                                   0x1.8p-24f,
                                   65519.0f);
  EXPECT_THAT(Narrowed(TensorType::kF32, inputs, TensorType::kF16),
              testing::ElementsAre(0x3c00, 0x3c00, 0x3c02, 0x3c01, 0x8000, 0x0000, 0x0002, 0x7bff));
  const std::string brains = Bytes(1.0f, 1 + 0x1p-8f, 1 + 0x3p-8f, 1 + 0x1p-8f + 0x1p-23f, -0.0f);
  EXPECT_THAT(Narrowed(TensorType::kF32, brains, TensorType::kBF16),
              testing::ElementsAre(0x3f80, 0x3f80, 0x3f82, 0x3f81, 0x8000));
  const std::string doubles = Bytes(1 + 0x1p-24, 1 + 0x3p-24, 0.1);
  EXPECT_EQ(Converted(TensorType::kF64, doubles, TensorType::kF32),
            Bytes(1.0f, 1 + 0x1p-22f, 0.1f));
}

TEST_F(ConvertCheckpointTest, WideningIsExactAndUndone) {
  std::vector<uint16_t> all(1 << 16);
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<uint16_t>(i);
  for (const TensorType type : {TensorType::kF16, TensorType::kBF16}) {
    const int num_bits = type == TensorType::kF16 ? 10 : 7;
    const std::string wide = Converted(type, Packed(all), TensorType::kF32);
    const auto narrow = Narrowed(TensorType::kF32, wide, type);
    ASSERT_EQ(narrow.size(), all.size());
    const int infinity = type == TensorType::kF16 ? 0x7c00 : 0x7f80;
    for (size_t i = 0; i < all.size(); ++i) {
      float value = 0;
      std::memcpy(&value, wide.data() + i * sizeof(value), sizeof(value));
      const int magnitude = all[i] & 0x7fff;
      if (magnitude > infinity) {
        ASSERT_TRUE(std::isnan(value) && (narrow[i] & 0x7fff) > infinity) << i;
        continue;
      }
      ASSERT_EQ(narrow[i], all[i]);
      if (magnitude == infinity) continue;
      ASSERT_EQ(value, ValueOf(all[i], num_bits)) << i;
    }
  }
}

TEST_F(ConvertCheckpointTest, OverflowIsAnErrorThatNamesTheTensor) {
  const float float_max = std::numeric_limits<float>::max();
  const std::tuple<TensorType, std::string, TensorType> cases[] = {
      {TensorType::kF32, Bytes(1.0f, 65520.0f), TensorType::kF16},
      {TensorType::kF32, Bytes(-1e30f), TensorType::kF16},
      {TensorType::kBF16, Bytes(uint16_t{0x7f00}), TensorType::kF16},
      {TensorType::kF64, Bytes(65520.0), TensorType::kF16},
      {TensorType::kF64, Bytes(1e300), TensorType::kF16},
      {TensorType::kF64, Bytes(-1e39), TensorType::kBF16},
      {TensorType::kF64, Bytes(1e39), TensorType::kF32},
      {TensorType::kF32, Bytes(float_max), TensorType::kBF16}};
  for (const auto& [from, bytes, to] : cases) {
    EXPECT_THAT(ErrorOf([&, from = from, &bytes = bytes, to = to] { Converted(from, bytes, to); }),
                AllOf(HasSubstr("'w'"), HasSubstr("too large for"), HasSubstr(TensorTypeName(to))));
    EXPECT_THAT(Snapshot(folder_.path()), testing::SizeIs(1));  // the input alone
  }
  constexpr float kInf = std::numeric_limits<float>::infinity();
  EXPECT_THAT(Narrowed(TensorType::kF32, Bytes(kInf, -kInf), TensorType::kF16),
              testing::ElementsAre(0x7c00, 0xfc00));
  EXPECT_THAT(Narrowed(TensorType::kF64, Bytes(double{kInf}, -double{kInf}), TensorType::kBF16),
              testing::ElementsAre(0x7f80, 0xff80));
  // A NaN whose upper half looks like an infinity stays a NaN.
  const std::string nan = Bytes(uint32_t{0x7f800001});
  EXPECT_THAT(Narrowed(TensorType::kF32, nan, TensorType::kBF16), testing::ElementsAre(0x7fc0));
}

TEST_F(ConvertCheckpointTest, OtherTensorsNamesShapesAndMetadataStay) {
  const std::string floats = Bytes(1.0f, 2.0f, 3.0f, 4.0f);
  const std::string ints = Bytes(int64_t{-5}, int64_t{1} << 60);
  const std::string bools = Bytes(uint8_t{1});
  Write({{"f", {TensorType::kF32, {2, 1, 2}, AsBytes(floats)}},
         {"i", {TensorType::kI64, {2}, AsBytes(ints)}},
         {"b", {TensorType::kBool, {}, AsBytes(bools)}},
         {"e", {TensorType::kF32, {0, 4}, {}}}});
  std::vector<int64_t> done;
  ConvertCheckpoint(Checkpoint(folder_ / "in"),
                    TensorType::kBF16,
                    folder_ / "out",
                    false,
                    [&](int64_t bytes, int64_t total) {
                      done.push_back(bytes);
                      EXPECT_EQ(total, 33);
                    });
  EXPECT_EQ(done.back(), 33);
  const SafetensorsFile file(folder_ / "out");
  EXPECT_EQ(file.metadata().at("format"), "pt");
  ASSERT_EQ(file.tensors().size(), 4u);
  EXPECT_THAT(file.tensors().at("f").shape, testing::ElementsAre(2, 1, 2));
  EXPECT_THAT(ToFloats(file.tensors().at("f")), testing::ElementsAre(1, 2, 3, 4));
  EXPECT_EQ(std::memcmp(file.tensors().at("i").bytes.data(), ints.data(), ints.size()), 0);
  EXPECT_EQ(file.tensors().at("b").bytes[0], std::byte{1});
  EXPECT_THAT(file.tensors().at("e").shape, testing::ElementsAre(0, 4));
}

TEST_F(ConvertCheckpointTest, ChunksMeetWithoutASeam) {
  std::vector<double> inputs((1 << 18) * 2 + 17);
  for (size_t i = 0; i < inputs.size(); ++i) inputs[i] = static_cast<double>(i);
  std::vector<float> expected(inputs.begin(), inputs.end());  // exact below 2^24
  EXPECT_EQ(Converted(TensorType::kF64, Packed(inputs), TensorType::kF32), Packed(expected));
}

TEST_F(ConvertCheckpointTest, NothingIsReplacedUnasked) {
  const std::string floats = Bytes(1.0f);
  Write({{"w", {TensorType::kF32, {1}, AsBytes(floats)}}});
  WriteFileAtomically(folder_ / "out", "precious");
  const Checkpoint checkpoint(folder_ / "in");
  const auto before = Snapshot(folder_.path());
  EXPECT_THAT(
      ErrorOf([&] { ConvertCheckpoint(checkpoint, TensorType::kF32, folder_ / "out", false); }),
      HasSubstr("--overwrite"));
  EXPECT_EQ(Snapshot(folder_.path()), before);
  EXPECT_THROW(ConvertCheckpoint(checkpoint, TensorType::kF64, folder_ / "new", false),
               std::invalid_argument);
  EXPECT_THROW(ConvertCheckpoint(checkpoint, TensorType::kU8, folder_ / "new", false),
               std::invalid_argument);
  // A file may replace itself: it is mapped until the last byte is written.
  ConvertCheckpoint(checkpoint, TensorType::kF16, folder_ / "in", true);
  EXPECT_EQ(SafetensorsFile(folder_ / "in").tensors().at("w").type, TensorType::kF16);
}

}  // namespace
}  // namespace vgtw
