// SPDX-License-Identifier: BSD-3-Clause
#include "network/pickle.h"

#include "network/pickle_tensors.h"
#include "tests/network/torch_files.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using namespace torch_files;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

const std::filesystem::path kPath = "a.pt";
const std::string kFloats = Storage("FloatStorage", "0", 24);
const std::string kTensor = Tensor(kFloats, 0, {4, 6}, {6, 1});

std::vector<PickledTensor> Parse(const std::string& root) {
  const std::string bytes = Pickled(root);
  return PickledTensors(Pickle(AsBytes(bytes), kPath), kPath);
}

std::vector<std::string> NamesIn(const std::string& root) {
  std::vector<std::string> names;
  for (const PickledTensor& tensor : Parse(root)) names.push_back(tensor.name);
  return names;
}

std::string ErrorOfBytes(const std::string& bytes) {
  return ErrorOf([&] { PickledTensors(Pickle(AsBytes(bytes), kPath), kPath); });
}

std::string ErrorOfRoot(const std::string& root) { return ErrorOfBytes(Pickled(root)); }

std::string ErrorOfTensor(const std::string& tensor) {
  return ErrorOfRoot(Dict(Text("a"), tensor));
}

TEST(Pickle, DescribesAViewOfAStorage) {
  const auto tensors =
      Parse(OrderedDict(Text("block.0.weight"), Tensor(kFloats, 8, {3, 4}, {6, 1})));
  ASSERT_EQ(tensors.size(), 1u);
  EXPECT_EQ(tensors[0].name, "block.0.weight");
  EXPECT_EQ(tensors[0].storage_key, "0");
  EXPECT_EQ(tensors[0].type, TensorType::kF32);
  EXPECT_EQ(tensors[0].num_storage_elements, 24u);
  EXPECT_EQ(tensors[0].offset, 8u);
  EXPECT_THAT(tensors[0].shape, ElementsAre(3, 4));
  EXPECT_THAT(tensors[0].strides, ElementsAre(6, 1));
}

TEST(Pickle, KnowsEveryStorageOfTensorType) {
  const std::pair<const char*, TensorType> types[] = {{"DoubleStorage", TensorType::kF64},
                                                      {"LongStorage", TensorType::kI64},
                                                      {"FloatStorage", TensorType::kF32},
                                                      {"IntStorage", TensorType::kI32},
                                                      {"HalfStorage", TensorType::kF16},
                                                      {"BFloat16Storage", TensorType::kBF16},
                                                      {"ByteStorage", TensorType::kU8},
                                                      {"BoolStorage", TensorType::kBool}};
  for (const auto& [name, type] : types) {
    EXPECT_EQ(Parse(Dict(Text("a"), Tensor(Storage(name, "0", 1), 0, {}, {})))[0].type, type);
  }
  EXPECT_THAT(ErrorOfTensor(Tensor(Storage("ComplexFloatStorage", "0", 1), 0, {}, {})),
              HasSubstr("torch.ComplexFloatStorage"));
}

TEST(Pickle, ParametersAreTheirTensors) {
  EXPECT_THAT(NamesIn(Dict(Text("a"), Parameter(kTensor))), ElementsAre("a"));
}

TEST(Pickle, MetadataOfModulesIsDropped) {
  const std::string state = Dict(Text("_metadata"), OrderedDict(Text(""), Dict(Text("v"), Int(1))));
  EXPECT_THAT(NamesIn(OrderedDict(Text("a"), kTensor) + state + "b"), ElementsAre("a"));
}

TEST(Pickle, OtherValuesAreSkipped) {
  const std::string root =
      Dict(Text("weight"), kTensor, Text("epoch"), "K\x03", Text("step"), "M\x01\x02") +
      // What follows sets further items of the same dict.
      Bytes(
          '(', Text("delta"), "J\xff\xff\xff\xff", Text("seed"), "\x8a\x09", std::string(9, 'x')) +
      Bytes(Text("rate"), 'G', 0.5, Text("done"), "\x88", Text("none"), "N", Text("raw")) +
      Bytes("C\x02xy", Text("list"), "](", kTensor, "Ne", Text("one"), "]", Text("x"), 'a') +
      Bytes(Int(7), kTensor, 'u');
  EXPECT_THAT(NamesIn(root), ElementsAre("weight"));
}

TEST(Pickle, WeightsOfATrainingCheckpointAreFound) {
  const std::string optimizer =
      Dict(Text("state"), Dict(Int(0), Dict(Text("exp_avg"), kTensor)), Text("groups"), "]");
  for (const char* key : {"model", "state_dict", "model_state_dict", "module"}) {
    EXPECT_THAT(NamesIn(Dict(Text("epoch"),
                             Int(3),
                             Text(key),
                             OrderedDict(Text("w"), kTensor),
                             Text("ema"),
                             Dict(Text("w"), kTensor),
                             Text("optimizer"),
                             optimizer)),
                ElementsAre("w"))
        << key;
  }
  EXPECT_THAT(NamesIn(Dict(Text("state_dict"), Dict(Text("model"), Dict(Text("w"), kTensor)))),
              ElementsAre("w"));
  // A network's own part may be called so, if tensors lie beside it.
  EXPECT_THAT(NamesIn(Dict(Text("model"), Dict(Text("w"), kTensor), Text("b"), kTensor)),
              ElementsAre("model.w", "b"));
  EXPECT_THAT(
      NamesIn(Dict(Text("x"), Dict(Text("w"), kTensor), Text("y"), Dict(Text("w"), kTensor))),
      ElementsAre("x.w", "y.w"));
  EXPECT_THAT(
      ErrorOfRoot(Dict(
          Text("model"), Dict(Text("w"), kTensor), Text("state_dict"), Dict(Text("w"), kTensor))),
      HasSubstr("'model' and 'state_dict'"));
}

TEST(Pickle, ProtocolFourSaysTheSame) {
  const auto short_text = [](std::string_view text) {
    return Bytes("\x8c", static_cast<uint8_t>(text.size()), text, '\x94');
  };
  const std::string global = short_text("collections") + short_text("OrderedDict") + "\x93\x94";
  const std::string body = Bytes("}",
                                 '\x94',
                                 short_text("a"),
                                 kTensor,
                                 's',
                                 short_text("b"),
                                 // memo 0 the dict, 1 "a", 2 "b", 3 and 4 names, 5 OrderedDict
                                 global,
                                 ")R",
                                 's',
                                 '.');
  const std::string bytes = Bytes("\x80\x04\x95", uint64_t{body.size()}, body);
  const auto tensors = PickledTensors(Pickle(AsBytes(bytes), kPath), kPath);
  ASSERT_EQ(tensors.size(), 1u);
  EXPECT_EQ(tensors[0].name, "a");
  EXPECT_THAT(ErrorOfBytes(Bytes("\x80\x04\x95", uint64_t{body.size() + 1}, body)),
              HasSubstr("frame"));
}

TEST(Pickle, RememberedValuesAreTheSameValue) {
  const uint32_t index = 0xfffffff0;  // costs no more than a small one
  EXPECT_THAT(NamesIn(Dict(Text("a"), kTensor, "q\x01", Text("b"), "h\x01")),
              ElementsAre("a", "b"));
  EXPECT_THAT(NamesIn(Dict(Text("a"), kTensor, 'r', index, Text("b"), 'j', index)),
              ElementsAre("a", "b"));
  // As Python, a value may be filled after it was remembered and used.
  EXPECT_THAT(NamesIn(Dict(Text("a"), "}q\x01", Text("b"), "h\x01", Text("w"), kTensor, 's')),
              ElementsAre("a.w", "b.w"));
  EXPECT_THAT(ErrorOfRoot("h\x05"), HasSubstr("recalls the value 5"));
}

TEST(Pickle, ForeignGlobalsAreRefusedAndNamed) {
  const std::pair<const char*, const char*> globals[] = {{"os", "system"},
                                                         {"posix", "system"},
                                                         {"builtins", "eval"},
                                                         {"__builtin__", "getattr"},
                                                         {"torch", "nn.Linear"},
                                                         {"torch.nn.modules.linear", "Linear"},
                                                         {"collections", "defaultdict"},
                                                         {"torch._utils", "_rebuild_tensor"},
                                                         {"", "collections.OrderedDict"}};
  for (const auto& [module, name] : globals) {
    const std::string full = std::string(module) + "." + name;
    const std::string call = Global(module, name) + Tuple(Text("echo")) + "R";
    for (const std::string& root : {call,
                                    Dict(Text("a"), kTensor, Text("b"), call),
                                    Bytes(Text(module), Text(name), '\x93')}) {
      EXPECT_THAT(ErrorOfRoot(root), AllOf(HasSubstr(full), HasSubstr("never executes code")));
    }
  }
  EXPECT_THAT(ErrorOfRoot(Global("os\nsystem", "x")), HasSubstr("os.system"));
  // Other ways of Python to make objects: INST, OBJ, NEWOBJ, NEWOBJ_EX, extensions.
  for (const char opcode : {'i', 'o', '\x81', '\x92', '\x82', '\x83', '\x84'}) {
    EXPECT_THAT(ErrorOfRoot(Global("collections", "OrderedDict") + ")" + opcode),
                HasSubstr("opcode " + std::to_string(static_cast<uint8_t>(opcode))));
  }
}

TEST(Pickle, EveryTruncationIsAnError) {
  const std::string bytes = Pickled(OrderedDict(Text("a"), Parameter(kTensor)) +
                                    Dict(Text("_metadata"), OrderedDict()) + "b");
  ASSERT_EQ(ErrorOfBytes(bytes), "");
  for (size_t length = 0; length < bytes.size(); ++length) {
    EXPECT_NE(ErrorOfBytes(bytes.substr(0, length)), "") << length;
  }
}

TEST(Pickle, BrokenStacksAreErrors) {
  for (const std::string root :
       {"",   ".", "t",  "u",   "s",    "R",   "b",    "Q",   "\x85", "(",  "(N",
        "NN", "q", "}N", "N)R", "}(Nu", "})R", "]N(s", "}(N", "}NNe", "N}b"}) {
    EXPECT_NE(ErrorOfRoot(root), "") << root;
  }
  EXPECT_THAT(ErrorOfBytes("\x80\x01N."), HasSubstr("protocol 1"));
  EXPECT_THAT(ErrorOfBytes("\x80\x05N."), HasSubstr("protocol 5"));
  EXPECT_THAT(ErrorOfBytes("N."), HasSubstr("does not begin"));
  EXPECT_THAT(ErrorOfRoot("N"), HasSubstr("something else than a dict"));
  EXPECT_THAT(ErrorOfRoot(kTensor), HasSubstr("something else than a dict"));
}

TEST(Pickle, ImpossibleTensorsAreErrors) {
  constexpr int64_t kHuge = std::numeric_limits<int64_t>::max();
  const auto view = [](int64_t offset, std::vector<int64_t> shape, std::vector<int64_t> strides) {
    return ErrorOfTensor(Tensor(kFloats, offset, shape, strides));
  };
  EXPECT_EQ(view(23, {1}, {kHuge}), "");  // the stride of one element is never taken
  EXPECT_EQ(view(24, {0, kHuge, kHuge}, {kHuge, kHuge, 1}), "");
  EXPECT_THAT(view(0, {25}, {1}), HasSubstr("reaches beyond its storage of 24"));
  EXPECT_THAT(view(24, {}, {}), HasSubstr("beyond"));
  EXPECT_THAT(view(1, {4, 6}, {6, 1}), HasSubstr("beyond"));
  EXPECT_THAT(view(0, {2}, {24}), HasSubstr("beyond"));
  EXPECT_THAT(view(kHuge, {1}, {1}), HasSubstr("beyond"));
  EXPECT_THAT(view(kHuge, {2}, {1}), HasSubstr("beyond"));
  EXPECT_THAT(view(0, {3}, {kHuge}), HasSubstr("beyond"));
  EXPECT_THAT(view(0, {kHuge, kHuge, 4}, {0, 0, 0}), HasSubstr("beyond"));
  EXPECT_THAT(view(-1, {1}, {1}), HasSubstr("size of -1"));
  EXPECT_THAT(view(0, {-4}, {1}), HasSubstr("size of -4"));
  EXPECT_THAT(view(3, {2}, {-1}), HasSubstr("size of -1"));
  EXPECT_THAT(view(0, {2}, {1, 1}), HasSubstr("as many strides"));
  EXPECT_THAT(view(0, std::vector<int64_t>(65, 1), std::vector<int64_t>(65, 1)), HasSubstr("64"));
  EXPECT_THAT(ErrorOfTensor(Tensor(Storage("LongStorage", "0", kHuge), 0, {1}, {1})),
              HasSubstr("absurdly large"));
  EXPECT_THAT(ErrorOfTensor(Tensor(Storage("FloatStorage", "0", -8), 0, {1}, {1})),
              HasSubstr("size of -8"));
  EXPECT_THAT(ErrorOfTensor(Tensor("N", 0, {1}, {1})), HasSubstr("no storage"));
  EXPECT_THAT(ErrorOfTensor(Tensor(Tuple(Text("module")) + "Q", 0, {1}, {1})),
              HasSubstr("no storage"));
  EXPECT_THAT(ErrorOfTensor(Global("torch._utils", "_rebuild_tensor_v2") + ")R"),
              HasSubstr("too few arguments"));
}

TEST(Pickle, LazilyNegatedViewsAreRefused) {
  const auto tensor = [](const std::string& metadata) {
    return Global("torch._utils", "_rebuild_tensor_v2") +
           Tuple(kFloats, Int(0), Ints({2}), Ints({1}), '\x89', OrderedDict(), metadata) + "R";
  };
  EXPECT_EQ(ErrorOfTensor(tensor("N")), "");
  EXPECT_EQ(ErrorOfTensor(tensor("}")), "");
  EXPECT_THAT(ErrorOfTensor(tensor(Dict(Text("neg"), "\x88"))), HasSubstr("negated"));
}

TEST(Pickle, KeysAreUniqueText) {
  EXPECT_THAT(ErrorOfRoot(Dict(Text("a"), kTensor, Text("a"), kTensor)), HasSubstr("twice"));
  EXPECT_THAT(ErrorOfRoot(Dict(Text("a\n"), kTensor)), HasSubstr("no text"));
  EXPECT_THAT(ErrorOfRoot(Dict(Text("\xff"), kTensor)), HasSubstr("no text"));
  EXPECT_THAT(ErrorOfRoot(Dict(Text(std::string(2000, 'a')), kTensor)), HasSubstr("no text"));
}

TEST(Pickle, BombsAreRefused) {
  EXPECT_THAT(ErrorOfRoot(Bytes("}q\x01", Text("a"), "h\x01s")), HasSubstr("too deeply"));
  // Fifteen dicts of which each holds the one before it thrice: 3^15 entries from 500 bytes.
  std::string levels = Bytes("}q", uint8_t{0});
  for (uint8_t i = 1; i <= 15; ++i) {
    const std::string previous = Bytes('h', static_cast<uint8_t>(i - 1));
    levels += Dict(Text("a"), previous, Text("b"), previous, Text("c"), previous) + Bytes('q', i);
  }
  EXPECT_THAT(ErrorOfRoot(Dict(Text("levels"), Tuple(levels), Text("x"), "h\x0f")),
              HasSubstr("too often"));
  EXPECT_THAT(ErrorOfRoot(std::string(3 << 20, 'N')), HasSubstr("too many values"));
  EXPECT_THAT(ErrorOfRoot(std::string(3 << 20, '(')), HasSubstr("too deeply"));
  std::string memoized = "}";
  for (uint32_t i = 0; i < 1 << 21; ++i) memoized += Bytes('r', i);
  EXPECT_EQ(ErrorOfRoot(memoized), "");
  EXPECT_THAT(ErrorOfRoot(memoized + "\x94"), HasSubstr("remembers too many"));
  EXPECT_THAT(ErrorOfRoot(std::string(17 << 20, 'N')), HasSubstr("16 MiB"));
  for (const std::string length : {"X", "B"}) {
    EXPECT_THAT(ErrorOfRoot(length + "\xff\xff\xff\xff"), HasSubstr("4294967295"));
  }
  EXPECT_THAT(ErrorOfRoot(Bytes('\x8d', UINT64_MAX)), HasSubstr("18446744073709551615"));
}

}  // namespace
}  // namespace vgtw
