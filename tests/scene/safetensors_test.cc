// SPDX-License-Identifier: BSD-3-Clause
#include "scene/safetensors.h"

#include "scene/error.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const std::filesystem::path kPath = "a.safetensors";

std::string File(const std::string& header, const std::string& data) {
  return Bytes(uint64_t{header.size()}, header, data);
}

template <typename T>
std::string StringOf(std::span<const T> values) {
  return {reinterpret_cast<const char*>(values.data()), values.size_bytes()};
}

TEST(Safetensors, WritesTheBytesOfTheFormat) {
  const TemporaryFolder folder;
  const std::array<float, 2> floats = {1.0f, -2.5f};
  const std::array<uint8_t, 3> bytes = {7, 0, 255};
  const std::array<double, 1> doubles = {0.1};
  // "b" is larger per element than "a" and "c", so its data comes first.
  WriteSafetensors(folder / "a.safetensors",
                   {{"a", {TensorType::kU8, {3, 1}, std::as_bytes(std::span(bytes))}},
                    {"b", {TensorType::kF64, {}, std::as_bytes(std::span(doubles))}},
                    {"c", {TensorType::kF32, {1, 2}, std::as_bytes(std::span(floats))}}},
                   {{"key", "value"}});
  std::string header = R"({"__metadata__":{"key":"value"},)"
                       R"("a":{"data_offsets":[16,19],"dtype":"U8","shape":[3,1]},)"
                       R"("b":{"data_offsets":[0,8],"dtype":"F64","shape":[]},)"
                       R"("c":{"data_offsets":[8,16],"dtype":"F32","shape":[1,2]}})";
  header.resize((header.size() + 7) / 8 * 8, ' ');
  EXPECT_EQ(ReadFile(folder / "a.safetensors"),
            File(header, Bytes(0.1, 1.0f, -2.5f, uint8_t{7}, uint8_t{0}, uint8_t{255})));
}

TEST(Safetensors, ReadsHandMadeFileOfAnyAlignment) {
  const std::string file =
      File(R"({"h":{"dtype":"F16","shape":[3],"data_offsets":[1,7]},"flag":{"dtype":"BOOL",)"
           R"("shape":[1,1],"data_offsets":[0,1]},"none":{"dtype":"I64","shape":[0,9],)"
           R"("data_offsets":[7,7]},"__metadata__":{"format":"pt"}})",
           // 1, -0.5 and the largest half, 65504
           Bytes(uint8_t{1}, uint16_t{0x3c00}, uint16_t{0xb800}, uint16_t{0x7bff}));
  const SafetensorsContent content = ParseSafetensors(AsBytes(file), kPath);
  ASSERT_EQ(content.tensors.size(), 3u);
  EXPECT_EQ(content.metadata.at("format"), "pt");
  EXPECT_THAT(ToFloats(content.tensors.at("h")), ElementsAre(1.0f, -0.5f, 65504.0f));
  EXPECT_THAT(content.tensors.at("flag").shape, ElementsAre(1, 1));
  EXPECT_EQ(content.tensors.at("none").NumElements(), 0u);
}

TEST(Safetensors, ConvertsEveryFloatingType) {
  const std::string data = Bytes(uint16_t{0x3f80}, uint16_t{0xc0a0});  // 1, -5 as BF16
  EXPECT_THAT(ToFloats({TensorType::kBF16, {2}, AsBytes(data)}), ElementsAre(1.0f, -5.0f));
  const std::string doubles = Bytes(0.1, -1e300);
  EXPECT_THAT(ToFloats({TensorType::kF64, {2}, AsBytes(doubles)}),
              ElementsAre(0.1f, -std::numeric_limits<float>::infinity()));
  const std::string halves = Bytes(uint16_t{0x7e00}, uint16_t{0x0001});
  const std::vector<float> values = ToFloats({TensorType::kF16, {2}, AsBytes(halves)});
  EXPECT_TRUE(std::isnan(values[0]));
  EXPECT_EQ(values[1], std::ldexp(1.0f, -24));
  EXPECT_THROW(ToFloats({TensorType::kU8, {4}, AsBytes(halves)}), std::invalid_argument);
}

TEST(Safetensors, EveryTypeSurvivesWriteReadWrite) {
  const TemporaryFolder folder;
  const std::string data(48, 'x');
  StoredTensors tensors;
  for (const TensorType type : {TensorType::kF64,
                                TensorType::kI64,
                                TensorType::kF32,
                                TensorType::kI32,
                                TensorType::kF16,
                                TensorType::kBF16,
                                TensorType::kU8,
                                TensorType::kBool}) {
    const uint64_t size = SizeInBytes(type);
    tensors[std::string(TensorTypeName(type))] = {type, {3, 1}, AsBytes(data).first(3 * size)};
  }
  WriteSafetensors(folder / "1", tensors, {{"a", "b"}});
  const SafetensorsFile first(folder / "1");
  EXPECT_EQ(first.tensors().size(), tensors.size());
  for (const auto& [name, tensor] : first.tensors()) {
    EXPECT_EQ(TensorTypeName(tensor.type), name);
    EXPECT_EQ(StringOf(tensor.bytes), data.substr(0, tensor.bytes.size()));
    // The law of the writer: aligned elements.
    EXPECT_EQ(reinterpret_cast<uintptr_t>(tensor.bytes.data()) % SizeInBytes(tensor.type), 0u);
  }
  WriteSafetensors(folder / "2", first.tensors(), first.metadata());
  EXPECT_EQ(ReadFile(folder / "1"), ReadFile(folder / "2"));
}

TEST(Safetensors, StreamingGivesTheSameFile) {
  const TemporaryFolder folder;
  const std::string data = "0123456789abcdef";
  const StoredTensors tensors = {{"a", {TensorType::kU8, {3}, AsBytes(data).first(3)}},
                                 {"b", {TensorType::kF32, {2, 2}, AsBytes(data)}},
                                 {"c", {TensorType::kF32, {0}, {}}}};
  TensorLayouts layouts;
  for (const auto& [name, tensor] : tensors) layouts[name] = {tensor.type, tensor.shape};
  std::vector<std::string> asked;
  const TensorSource by_bytes = [&](const std::string& name, const ByteSink& sink) {
    asked.push_back(name);
    const auto bytes = tensors.at(name).bytes;
    for (size_t i = 0; i < bytes.size(); ++i) sink(bytes.subspan(i, 1));
  };
  StreamSafetensors(folder / "streamed", layouts, by_bytes, {{"key", "value"}});
  EXPECT_THAT(asked, ElementsAre("b", "c", "a"));  // larger elements first
  WriteSafetensors(folder / "written", tensors, {{"key", "value"}});
  EXPECT_EQ(ReadFile(folder / "streamed"), ReadFile(folder / "written"));
}

TEST(Safetensors, StreamingRefusesOtherNumbersOfBytes) {
  const TemporaryFolder folder;
  const TensorLayouts layouts = {{"a", {TensorType::kF32, {2}}}};
  for (const size_t num_bytes : {0u, 7u, 9u}) {
    const std::string data(num_bytes, 'x');
    EXPECT_THROW(
        StreamSafetensors(folder / "a",
                          layouts,
                          [&](const std::string&, const ByteSink& sink) { sink(AsBytes(data)); }),
        std::invalid_argument);
  }
  constexpr uint64_t kHuge = uint64_t{1} << 62;
  const TensorSource none = [](const std::string&, const ByteSink&) {};
  EXPECT_THROW(StreamSafetensors(folder / "a", {{"a", {TensorType::kF32, {kHuge}}}}, none),
               std::invalid_argument);
  EXPECT_THROW(
      StreamSafetensors(folder / "a",
                        {{"a", {TensorType::kU8, {kHuge}}}, {"b", {TensorType::kU8, {kHuge, 3}}}},
                        none),
      std::invalid_argument);
  EXPECT_TRUE(Snapshot(folder.path()).empty());
}

TEST(Safetensors, EveryTruncationIsAnError) {
  const std::string file = File(R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[0,8]},)"
                                R"("b":{"dtype":"U8","shape":[1],"data_offsets":[8,9]}})",
                                std::string(9, 'x'));
  for (size_t length = 0; length < file.size(); ++length) {
    const std::string prefix = file.substr(0, length);
    EXPECT_THAT(ErrorOf([&] { ParseSafetensors(AsBytes(prefix), kPath); }), HasSubstr("a.safet"))
        << length;
  }
  EXPECT_EQ(ErrorOf([&] { ParseSafetensors(AsBytes(file), kPath); }), "");
}

TEST(Safetensors, WrongHeadersAreErrorsThatTell) {
  struct Case {
    std::string header;
    std::string message;
  };
  const std::vector<Case> cases = {
      {R"([1])", "a JSON array"},
      {R"({"a":1})", "'a' is a number"},
      {R"({"a":{"shape":[8],"data_offsets":[0,8]}})", "no dtype"},
      {R"({"a":{"dtype":"F8_E4M3","shape":[8],"data_offsets":[0,8]}})", "dtype F8_E4M3"},
      {R"({"a":{"dtype":"U8","data_offsets":[0,8]}})", "lacks a shape"},
      {R"({"a":{"dtype":"U8","shape":[-8],"data_offsets":[0,8]}})", "lacks a shape"},
      {R"({"a":{"dtype":"U8","shape":[8.0],"data_offsets":[0,8]}})", "lacks a shape"},
      {R"({"a":{"dtype":"U8","shape":[8],"data_offsets":[0]}})", "lacks a shape"},
      {R"({"a":{"dtype":"U8","shape":[8],"data_offsets":[8,0]}})", "bytes 8 to 0"},
      {R"({"a":{"dtype":"U8","shape":[9],"data_offsets":[0,9]}})", "inside the 8 bytes"},
      {R"({"a":{"dtype":"F32","shape":[3],"data_offsets":[0,8]}})", "product of its shape"},
      {R"({"a":{"dtype":"F64","shape":[2305843009213693953],"data_offsets":[0,8]}})", "product"},
      {R"({"a":{"dtype":"U8","shape":[4294967296,4294967296],"data_offsets":[0,8]}})", "product"},
      {R"({"a":{"dtype":"U8","shape":[7],"data_offsets":[0,7]}})", "hole or an overlap at byte 7"},
      {R"({"a":{"dtype":"U8","shape":[7],"data_offsets":[1,8]}})", "hole or an overlap at byte 0"},
      {R"({"a":{"dtype":"U8","shape":[8],"data_offsets":[0,8]},)"
       R"("b":{"dtype":"U8","shape":[4],"data_offsets":[4,8]}})",
       "hole or an overlap"},
      {R"({"__metadata__":{"a":1}})", "__metadata__"},
      {R"({"a":)", "parse error"},
      {"{\"\xff\":1}", "UTF-8"},
  };
  for (const auto& [header, message] : cases) {
    const std::string file = File(header, std::string(8, 'x'));
    EXPECT_THAT(ErrorOf([&] { ParseSafetensors(AsBytes(file), kPath); }), HasSubstr(message))
        << header;
  }
}

TEST(Safetensors, AbsurdHeaderLengthsAreRefusedBeforeAllocation) {
  for (const uint64_t length :
       {uint64_t{1} << 60, std::numeric_limits<uint64_t>::max(), uint64_t{9}}) {
    const std::string file = Bytes(length, std::string(8, ' '));
    EXPECT_THAT(ErrorOf([&] { ParseSafetensors(AsBytes(file), kPath); }),
                HasSubstr(std::to_string(length)));
  }
  const std::string large = File(std::string((size_t{16} << 20) + 1, ' '), "");
  EXPECT_THAT(ErrorOf([&] { ParseSafetensors(AsBytes(large), kPath); }), HasSubstr("16 MiB"));
}

TEST(Safetensors, WriterRefusesBrokenContracts) {
  const TemporaryFolder folder;
  const auto path = folder / "a.safetensors";
  const std::string data(8, 'x');
  const StoredTensor tensor = {TensorType::kF32, {2}, AsBytes(data)};
  EXPECT_THROW(WriteSafetensors(path, {{"__metadata__", tensor}}), std::invalid_argument);
  EXPECT_THROW(WriteSafetensors(path, {{"\xff", tensor}}), std::invalid_argument);
  EXPECT_THROW(WriteSafetensors(path, {{"a", {TensorType::kF32, {3}, AsBytes(data)}}}),
               std::invalid_argument);
  EXPECT_TRUE(Snapshot(folder.path()).empty());
}

TEST(Safetensors, MissingAndUnwritableFilesAreErrors) {
  const TemporaryFolder folder;
  EXPECT_THAT(ErrorOf([&] { SafetensorsFile(folder / "none"); }), HasSubstr("cannot be read"));
  EXPECT_THAT(ErrorOf([&] { SafetensorsFile(folder.path()); }), HasSubstr("not a file"));
  EXPECT_THAT(ErrorOf([&] { WriteSafetensors(folder / "no/folder", {}); }),
              HasSubstr("cannot be written"));
}

}  // namespace
}  // namespace vgtw
