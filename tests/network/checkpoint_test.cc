// SPDX-License-Identifier: BSD-3-Clause
#include "network/checkpoint.h"

#include "tests/network/torch_files.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using namespace torch_files;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

std::string Floats(std::initializer_list<float> values) {
  std::string bytes;
  for (const float value : values) bytes += Bytes(value);
  return bytes;
}

const std::string kStorage = Storage("FloatStorage", "0", 6);
const std::string kMatrix = Tensor(kStorage, 0, {2, 3}, {3, 1});
const std::string kSixFloats = Floats({0, 1, 2, 3, 4, 5});

std::vector<std::string> NamesIn(const Checkpoint& checkpoint) {
  std::vector<std::string> names;
  for (const auto& [name, tensor] : checkpoint.tensors()) names.push_back(name);
  return names;
}

class CheckpointFiles : public testing::Test {
 protected:
  std::filesystem::path Written(const std::string& name, const std::string& bytes) {
    WriteFileAtomically(folder_ / name, bytes);
    return folder_ / name;
  }

  std::filesystem::path Torch(const std::string& root, const std::string& storage = kSixFloats) {
    return Written("a.pt", TorchFile(root, {{"0", storage}}));
  }

  std::string ErrorOfFile(const std::filesystem::path& path) {
    return ErrorOf([&] { Checkpoint{path}; });
  }

  // A shard that holds U8 tensors of one byte.
  void WriteShard(const std::string& name, const std::vector<std::string>& tensors) {
    StoredTensors stored;
    const std::string byte = "x";
    for (const std::string& tensor : tensors) stored[tensor] = {TensorType::kU8, {}, AsBytes(byte)};
    WriteSafetensors(folder_ / name, stored, {{"format", "pt"}});
  }

  std::string ErrorOfIndex(const std::string& json) {
    return ErrorOfFile(Written("model.safetensors.index.json", json));
  }

  TemporaryFolder folder_;
};

TEST_F(CheckpointFiles, RowMajorTensorsAreMappedAndOthersCopied) {
  const Checkpoint checkpoint(Torch(Dict(  //
      Text("matrix"),
      kMatrix,  //
      Text("row"),
      Tensor(kStorage, 3, {1, 3}, {77, 1}),
      Text("scalar"),
      Tensor(kStorage, 5, {}, {}),  //
      Text("empty"),
      Tensor(kStorage, 6, {0, 3}, {3, 1}),
      Text("transposed"),
      Tensor(kStorage, 0, {3, 2}, {1, 3}),
      Text("column"),
      Tensor(kStorage, 1, {2}, {3}),
      Text("repeated"),
      Tensor(kStorage, 4, {2, 2}, {0, 1}))));
  EXPECT_EQ(checkpoint.format(), "torch.save");
  const StoredTensors& tensors = checkpoint.tensors();
  const auto values = [&](const char* name) { return ToFloats(tensors.at(name)); };
  EXPECT_THAT(values("matrix"), ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_THAT(values("row"), ElementsAre(3, 4, 5));
  EXPECT_THAT(values("scalar"), ElementsAre(5));
  EXPECT_THAT(values("empty"), ElementsAre());
  EXPECT_THAT(values("transposed"), ElementsAre(0, 3, 1, 4, 2, 5));
  EXPECT_THAT(values("column"), ElementsAre(1, 4));
  EXPECT_THAT(values("repeated"), ElementsAre(4, 5, 4, 5));
  EXPECT_THAT(tensors.at("transposed").shape, ElementsAre(3, 2));
  EXPECT_THAT(tensors.at("empty").shape, ElementsAre(0, 3));
  // Views of one storage share its bytes; a copy does not.
  EXPECT_EQ(tensors.at("row").bytes.data(), tensors.at("matrix").bytes.data() + 12);
  EXPECT_NE(tensors.at("column").bytes.data(), tensors.at("matrix").bytes.data() + 4);
}

TEST_F(CheckpointFiles, ViewsThatMultiplyTheFileAreRefused) {
  for (const int64_t count : {int64_t{1} << 20, int64_t{1} << 59}) {
    EXPECT_THAT(ErrorOfFile(Torch(Dict(Text("a"), Tensor(kStorage, 0, {count}, {0})))),
                HasSubstr("repeats its storage"));
  }
  // Each fits the file, but not a hundred of them: 48 kB of copy for 7 bytes of pickle.
  std::string storage;
  for (int i = 0; i < 2000; ++i) storage += kSixFloats;
  std::string entries = Dict(
      Text("0"), Tensor(Storage("FloatStorage", "0", 12000), 0, {6000, 2}, {1, 6000}), "q\x01");
  for (int i = 1; i < 100; ++i) entries += Text(std::to_string(i)) + "h\x01s";
  EXPECT_THAT(ErrorOfFile(Torch(entries, storage)), HasSubstr("repeats its storage"));
}

TEST_F(CheckpointFiles, StoragesMustBeThereInFull) {
  const auto error = [&](const std::string& storage, const std::string& bytes) {
    return ErrorOfFile(Torch(Dict(Text("a"), Tensor(storage, 0, {1}, {1})), bytes));
  };
  EXPECT_THAT(error(Storage("FloatStorage", "1", 6), kSixFloats), HasSubstr("data/1"));
  EXPECT_THAT(error(Storage("FloatStorage", "../0", 6), kSixFloats), HasSubstr("not there"));
  EXPECT_THAT(error(Storage("FloatStorage", "0", 7), kSixFloats),
              HasSubstr("the 28 that data.pkl"));
  EXPECT_THAT(error(Storage("DoubleStorage", "0", 6), kSixFloats), HasSubstr("the 48"));
  EXPECT_THAT(error(kStorage, ""), HasSubstr("storage of 0 bytes"));
}

TEST_F(CheckpointFiles, EveryTruncationIsAnError) {
  const auto path = Torch(Dict(Text("a"), kMatrix));
  ASSERT_EQ(ErrorOfFile(path), "");
  for (uintmax_t length = std::filesystem::file_size(path); length-- > 0;) {
    std::filesystem::resize_file(path, length);
    EXPECT_NE(ErrorOfFile(path), "") << length;
  }
}

TEST_F(CheckpointFiles, FolderInTheArchiveAndZip64DoNotMatter) {
  for (const char* folder : {"archive", "state_dict", "weird name"}) {
    const std::string file =
        TorchFile(Dict(Text("a"), kMatrix), {{"0", kSixFloats}}, folder, /*is_zip64=*/true);
    EXPECT_THAT(NamesIn(Checkpoint(Written("a.bin", file))), ElementsAre("a"));
  }
}

TEST_F(CheckpointFiles, CommonPrefixesAreDropped) {
  EXPECT_THAT(
      NamesIn(Checkpoint(Torch(Dict(Text("module.a.w"), kMatrix, Text("module.b"), kMatrix)))),
      ElementsAre("a.w", "b"));
  EXPECT_THAT(NamesIn(Checkpoint(Torch(Dict(
                  Text("state_dict"), Dict(Text("module.model.a"), kMatrix), Text("n"), Int(1))))),
              ElementsAre("a"));
  EXPECT_THAT(NamesIn(Checkpoint(Torch(Dict(Text("module.a"), kMatrix, Text("b"), kMatrix)))),
              ElementsAre("b", "module.a"));
  EXPECT_THAT(NamesIn(Checkpoint(Torch(Dict(Text("modules.a"), kMatrix, Text("module"), kMatrix)))),
              ElementsAre("module", "modules.a"));
  EXPECT_THAT(NamesIn(Checkpoint(Torch(Dict(Text("module."), kMatrix)))), ElementsAre("module."));
  WriteShard("a.safetensors", {"module.a", "module.b"});
  EXPECT_THAT(NamesIn(Checkpoint(folder_ / "a.safetensors")), ElementsAre("a", "b"));
}

TEST_F(CheckpointFiles, NamesOfNestedDictsMustNotMeet) {
  EXPECT_THAT(ErrorOfFile(Torch(Dict(Text("a.b"), kMatrix, Text("a"), Dict(Text("b"), kMatrix)))),
              AllOf(HasSubstr("'a.b'"), HasSubstr("twice")));
  EXPECT_THAT(ErrorOfFile(Torch(Dict(Text("__metadata__"), kMatrix))), HasSubstr("reserves"));
}

TEST_F(CheckpointFiles, FormatIsToldByContent) {
  WriteShard("a.pt", {"w"});
  const Checkpoint checkpoint(folder_ / "a.pt");
  EXPECT_EQ(checkpoint.format(), "safetensors");
  EXPECT_THAT(checkpoint.metadata(), ElementsAre(testing::Pair("format", "pt")));
  const auto error = [&](const std::string& bytes) { return ErrorOfFile(Written("x", bytes)); };
  EXPECT_THAT(error(""), HasSubstr("no known format (0 bytes)"));
  EXPECT_THAT(error("<!DOCTYPE html><html>...</html>"), HasSubstr("no known format"));
  EXPECT_THAT(error("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n"),
              HasSubstr("git lfs pull"));
  EXPECT_THAT(error(Bytes(uint64_t{2}, "{}")), HasSubstr("holds no tensors"));
  EXPECT_THAT(error(TorchFile("}", {})), HasSubstr("holds no tensors"));
  EXPECT_THAT(error("\x80\x02\x8a\x0al\xfc"), HasSubstr("torch before 1.6"));
  EXPECT_THAT(ErrorOfFile(folder_ / "none"), HasSubstr("cannot be read"));
  EXPECT_THAT(ErrorOfFile(folder_.path()), HasSubstr("is not a file"));
}

TEST_F(CheckpointFiles, ShardsAreOneCheckpoint) {
  WriteShard("1.safetensors", {"a", "b"});
  WriteShard("2.safetensors", {"c"});
  const Checkpoint checkpoint(Written("model.safetensors.index.json", R"({
    "metadata": {"total_size": 3},
    "weight_map": {"a": "1.safetensors", "b": "1.safetensors", "c": "2.safetensors"}})"));
  EXPECT_EQ(checkpoint.format(), "safetensors, 2 shards");
  EXPECT_THAT(NamesIn(checkpoint), ElementsAre("a", "b", "c"));
  EXPECT_THAT(checkpoint.metadata(), ElementsAre(testing::Pair("format", "pt")));
}

TEST_F(CheckpointFiles, IndexAndShardsMustAgree) {
  WriteShard("1.safetensors", {"a", "b"});
  WriteShard("2.safetensors", {"b"});
  EXPECT_THAT(ErrorOfIndex(R"({"weight_map": {"a": "1.safetensors"}})"),
              AllOf(HasSubstr("holds the tensor 'b'"), HasSubstr("only those of the index")));
  EXPECT_THAT(ErrorOfIndex(R"({"weight_map": {"a": "1.safetensors", "b": "2.safetensors"}})"),
              AllOf(HasSubstr("1.safetensors: holds the tensor 'b'"), HasSubstr("alone")));
  EXPECT_THAT(
      ErrorOfIndex(
          R"({"weight_map": {"a": "1.safetensors", "b": "1.safetensors", "c": "1.safetensors"}})"),
      HasSubstr("lacks the tensor 'c'"));
  EXPECT_THAT(ErrorOfIndex(R"({"weight_map": {"a": "3.safetensors"}})"),
              HasSubstr("cannot be read"));
}

TEST_F(CheckpointFiles, IndexMustNotLeadOutOfItsFolder) {
  for (const char* file : {"../1.safetensors", "/etc/passwd", "a/../../b", "", "."}) {
    EXPECT_THAT(ErrorOfIndex(R"({"weight_map": {"a": ")" + std::string(file) + R"("}})"),
                HasSubstr("no usable weight_map"))
        << file;
  }
  for (const char* json :
       {"{}", R"({"weight_map": 1})", R"({"weight_map": {"a": 1}})", R"({"weight_map": ["a"]})"}) {
    EXPECT_THAT(ErrorOfIndex(json), HasSubstr("no usable weight_map")) << json;
  }
  EXPECT_THAT(ErrorOfIndex("{\"weight_map\":"), HasSubstr("parse error"));
  EXPECT_THAT(ErrorOfIndex(R"({"weight_map": {}})"), HasSubstr("holds no tensors"));
}

// What the real torch 1.13 wrote of one small network in eight ways.
TEST(CheckpointGolden, TorchFilesEqualTheirSafetensors) {
  VGTW_NEED_PARITY_DATA();
  const auto folder = ParityData() / "ckpt";
  const Checkpoint expected(folder / "state_dict.safetensors");
  ASSERT_EQ(expected.tensors().size(), 6u);
  for (const char* name : {"state_dict.pt", "plain_dict.pt", "nested.pt", "parameters.pt"}) {
    const Checkpoint checkpoint(folder / name);
    ASSERT_EQ(NamesIn(checkpoint), NamesIn(expected)) << name;
    for (const auto& [key, tensor] : checkpoint.tensors()) {
      const StoredTensor& other = expected.tensors().at(key);
      EXPECT_EQ(tensor.type, TensorType::kF32);
      EXPECT_EQ(tensor.shape, other.shape) << key;
      EXPECT_TRUE(std::equal(
          tensor.bytes.begin(), tensor.bytes.end(), other.bytes.begin(), other.bytes.end()))
          << name << " " << key;
    }
  }
}

TEST(CheckpointGolden, HalvesAreTheNearestOnes) {
  VGTW_NEED_PARITY_DATA();
  const auto folder = ParityData() / "ckpt";
  const Checkpoint expected(folder / "state_dict.safetensors");
  // Half of the last place: 2^-11 of the value for F16 (whose values are normal here), 2^-8 for
  // BF16.
  const std::pair<const char*, float> files[] = {{"half.pt", 0x1p-11f}, {"bfloat16.pt", 0x1p-8f}};
  for (const auto& [name, tolerance] : files) {
    const Checkpoint checkpoint(folder / name);
    ASSERT_EQ(NamesIn(checkpoint), NamesIn(expected)) << name;
    for (const auto& [key, tensor] : checkpoint.tensors()) {
      const auto values = ToFloats(tensor);
      const auto exact = ToFloats(expected.tensors().at(key));
      ASSERT_EQ(values.size(), exact.size());
      for (size_t i = 0; i < values.size(); ++i) {
        EXPECT_LE(std::abs(values[i] - exact[i]), tolerance * std::abs(exact[i])) << name << key;
      }
    }
  }
}

TEST(CheckpointGolden, ViewsAreWhatTorchSees) {
  VGTW_NEED_PARITY_DATA();
  const Checkpoint checkpoint(ParityData() / "ckpt/views.pt");
  ASSERT_THAT(NamesIn(checkpoint), ElementsAre("base", "count", "tail", "transposed"));
  const auto base = ToFloats(checkpoint.tensors().at("base"));              // [4,6]
  const auto transposed = ToFloats(checkpoint.tensors().at("transposed"));  // [6,4]
  const auto tail = ToFloats(checkpoint.tensors().at("tail"));              // base[1:, 2:]
  ASSERT_EQ(base.size(), 24u);
  ASSERT_EQ(transposed.size(), 24u);
  ASSERT_EQ(tail.size(), 12u);
  for (size_t i = 0; i < 24; ++i) EXPECT_EQ(transposed[i], base[i % 4 * 6 + i / 4]);
  for (size_t i = 0; i < 12; ++i) EXPECT_EQ(tail[i], base[(i / 4 + 1) * 6 + i % 4 + 2]);
  const StoredTensor& count = checkpoint.tensors().at("count");
  const std::string expected = Bytes(int64_t{0}, int64_t{1}, int64_t{2});
  ASSERT_EQ(count.type, TensorType::kI64);
  ASSERT_EQ(count.bytes.size(), expected.size());
  EXPECT_EQ(std::memcmp(count.bytes.data(), expected.data(), expected.size()), 0);
}

}  // namespace
}  // namespace vgtw
