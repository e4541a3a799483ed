// SPDX-License-Identifier: BSD-3-Clause
#include "network/pickle.h"

#include "network/pickle_opcodes.h"
#include "scene/error.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <string>
#include <unordered_map>
#include <utility>

namespace vgtw {
namespace {

static_assert(std::endian::native == std::endian::little, "pickles are little-endian");

using Kind = PickleValue::Kind;

constexpr size_t kMaxBytes = size_t{16} << 20;
constexpr size_t kMaxValues = size_t{1} << 21;
constexpr std::string_view kDamaged = "the file is truncated or damaged: copy or write it again";
constexpr std::string_view kSaveWeights =
    "save the weights alone: torch.save(model.state_dict(), path)";

constexpr std::string_view kOrderedDict = "collections.OrderedDict";
constexpr std::array<std::string_view, 12> kAllowedGlobals = {
    kOrderedDict,
    "torch._utils._rebuild_tensor_v2",
    "torch._utils._rebuild_parameter",
    "torch._utils._rebuild_parameter_with_state",
    "torch.FloatStorage",
    "torch.HalfStorage",
    "torch.BFloat16Storage",
    "torch.DoubleStorage",
    "torch.LongStorage",
    "torch.IntStorage",
    "torch.ByteStorage",
    "torch.BoolStorage",
};

class Machine {
 public:
  Machine(std::span<const std::byte> bytes,
          const std::filesystem::path& path,
          std::deque<PickleValue>& values)
      : bytes_(bytes), path_(path), values_(values) {}

  PickleId Run() {
    if (bytes_.size() > kMaxBytes) {
      Refuse("is a pickle of " + std::to_string(bytes_.size()) + " bytes", "at most 16 MiB");
    }
    if (Read<uint8_t>() != kProto) FailHere("does not begin with a protocol", "a pickle");
    const auto protocol = Read<uint8_t>();
    if (protocol < 2 || protocol > 4) {
      Refuse("is a pickle of protocol " + std::to_string(protocol), "protocol 2, 3 or 4");
    }
    while (true) {
      const auto opcode = Read<uint8_t>();
      if (opcode == kStop) break;
      if (RunConstant(opcode) || RunText(opcode) || RunMemo(opcode) || RunContainer(opcode) ||
          RunCall(opcode)) {
        continue;
      }
      Refuse("uses the pickle opcode " + std::to_string(opcode) + " at byte " +
                 std::to_string(position_ - 1),
             "only those that weights need");
    }
    const PickleId root = Pop();
    if (!stack_.empty() || !marks_.empty()) FailHere("ends with values left over", "one value");
    return root;
  }

 private:
  [[noreturn]] void FailHere(const std::string& found, std::string_view expected) const {
    Fail(path_, "data.pkl " + found + " at byte " + std::to_string(position_), expected, kDamaged);
  }

  [[noreturn]] void Refuse(const std::string& found, std::string_view expected) const {
    Fail(path_, "data.pkl " + found, expected, kSaveWeights);
  }

  std::span<const std::byte> Take(uint64_t num_bytes) {
    if (num_bytes > bytes_.size() - position_) {
      FailHere("needs " + std::to_string(num_bytes) + " bytes",
               "the " + std::to_string(bytes_.size() - position_) + " that are left");
    }
    const auto taken = bytes_.subspan(position_, num_bytes);
    position_ += num_bytes;
    return taken;
  }

  template <typename T>
  T Read() {
    T value;
    std::memcpy(&value, Take(sizeof(T)).data(), sizeof(T));
    return value;
  }

  template <typename Length>
  std::string_view ReadText() {
    const auto text = Take(Read<Length>());
    return {reinterpret_cast<const char*>(text.data()), text.size()};
  }

  std::string_view ReadLine() {
    const auto left = bytes_.subspan(position_);
    const auto end = std::find(left.begin(), left.end(), std::byte{'\n'});
    if (end == left.end()) FailHere("has a line without an end", "one");
    const auto line = Take(static_cast<size_t>(end - left.begin()) + 1);
    return {reinterpret_cast<const char*>(line.data()), line.size() - 1};
  }

  // --- the stack ---

  void PushId(PickleId id) {
    if (stack_.size() >= kMaxValues) Refuse("holds too many values", "at most 2^21");
    stack_.push_back(id);
  }

  void Push(PickleValue value) {
    if (values_.size() >= kMaxValues) Refuse("holds too many values", "at most 2^21");
    values_.push_back(std::move(value));
    PushId(static_cast<PickleId>(values_.size() - 1));
  }

  void PushInt(int64_t number) { Push({Kind::kInt, number, {}, {}}); }

  // Values above the last mark, which belong to a container that is not complete yet.
  size_t NumAboveMark() const { return stack_.size() - (marks_.empty() ? 0 : marks_.back()); }

  PickleId Pop() {
    if (NumAboveMark() == 0) FailHere("takes a value from an empty stack", "one there");
    const PickleId id = stack_.back();
    stack_.pop_back();
    return id;
  }

  std::vector<PickleId> PopMany(size_t count) {
    if (count > NumAboveMark()) FailHere("takes values from an empty stack", "them there");
    const auto begin = stack_.end() - static_cast<std::ptrdiff_t>(count);
    std::vector<PickleId> ids(begin, stack_.end());
    stack_.erase(begin, stack_.end());
    return ids;
  }

  std::vector<PickleId> PopToMark() {
    if (marks_.empty()) FailHere("ends a container that never began", "a mark");
    std::vector<PickleId> ids = PopMany(NumAboveMark());
    marks_.pop_back();
    return ids;
  }

  PickleValue& Top(Kind kind, std::string_view expected) {
    if (NumAboveMark() == 0 || values_[stack_.back()].kind != kind) {
      FailHere("has another value", expected);
    }
    return values_[stack_.back()];
  }

  // --- opcodes; each function tells whether the opcode was one of its kind ---

  bool RunConstant(uint8_t opcode) {
    switch (opcode) {
      case kNone:
      case kNewTrue:
      case kNewFalse:
        Push({});
        return true;
      case kBinFloat:
        Take(sizeof(double));
        Push({});
        return true;
      case kBinInt:
        PushInt(Read<int32_t>());
        return true;
      case kBinInt1:
        PushInt(Read<uint8_t>());
        return true;
      case kBinInt2:
        PushInt(Read<uint16_t>());
        return true;
      case kLong1:
        PushLong(ReadText<uint8_t>());
        return true;
      default:
        return false;
    }
  }

  // Two's complement of any number of bytes.
  void PushLong(std::string_view bytes) {
    if (bytes.size() > sizeof(int64_t)) return Push({});
    const bool is_negative = !bytes.empty() && (static_cast<uint8_t>(bytes.back()) & 0x80) != 0;
    int64_t number = is_negative ? -1 : 0;
    std::memcpy(&number, bytes.data(), bytes.size());
    PushInt(number);
  }

  void PushText(std::string_view text) { Push({Kind::kString, 0, text, {}}); }

  bool RunText(uint8_t opcode) {
    switch (opcode) {
      case kShortBinUnicode:
        PushText(ReadText<uint8_t>());
        return true;
      case kBinUnicode:
        PushText(ReadText<uint32_t>());
        return true;
      case kBinUnicode8:
        PushText(ReadText<uint64_t>());
        return true;
      case kShortBinBytes:
        ReadText<uint8_t>();
        Push({});
        return true;
      case kBinBytes:
        ReadText<uint32_t>();
        Push({});
        return true;
      case kBinBytes8:
        ReadText<uint64_t>();
        Push({});
        return true;
      default:
        return false;
    }
  }

  void Put(uint32_t index) {
    if (NumAboveMark() == 0) FailHere("remembers a value that is not there", "one");
    memo_[index] = stack_.back();
    if (memo_.size() > kMaxValues) Refuse("remembers too many values", "at most 2^21");
  }

  void Get(uint32_t index) {
    const auto found = memo_.find(index);
    if (found == memo_.end()) {
      FailHere("recalls the value " + std::to_string(index), "one that was remembered");
    }
    PushId(found->second);
  }

  bool RunMemo(uint8_t opcode) {
    switch (opcode) {
      case kBinPut:
        Put(Read<uint8_t>());
        return true;
      case kLongBinPut:
        Put(Read<uint32_t>());
        return true;
      case kMemoize:
        Put(static_cast<uint32_t>(memo_.size()));
        return true;
      case kBinGet:
        Get(Read<uint8_t>());
        return true;
      case kLongBinGet:
        Get(Read<uint32_t>());
        return true;
      case kFrame:
        if (const auto length = Read<uint64_t>(); length > bytes_.size() - position_) {
          FailHere("announces a frame of " + std::to_string(length) + " bytes", "as many left");
        }
        return true;
      default:
        return false;
    }
  }

  void Extend(Kind kind, const std::vector<PickleId>& ids) {
    PickleValue& container = Top(kind, kind == Kind::kDict ? "a dict" : "a list");
    if (kind == Kind::kDict && ids.size() % 2 != 0) FailHere("has a key without value", "pairs");
    container.items.insert(container.items.end(), ids.begin(), ids.end());
  }

  bool RunContainer(uint8_t opcode) {
    switch (opcode) {
      case kMark:
        if (marks_.size() >= kMaxValues) Refuse("nests too deeply", "at most 2^21 levels");
        marks_.push_back(stack_.size());
        return true;
      case kEmptyTuple:
        Push({Kind::kTuple, 0, {}, {}});
        return true;
      case kEmptyList:
        Push({Kind::kList, 0, {}, {}});
        return true;
      case kEmptyDict:
        Push({Kind::kDict, 0, {}, {}});
        return true;
      case kTuple1:
      case kTuple2:
      case kTuple3:
        Push({Kind::kTuple, 0, {}, PopMany(size_t{opcode} - kTuple1 + 1)});
        return true;
      case kTupleOfMark:
        Push({Kind::kTuple, 0, {}, PopToMark()});
        return true;
      case kAppend:
        Extend(Kind::kList, PopMany(1));
        return true;
      case kAppends:
        Extend(Kind::kList, PopToMark());
        return true;
      case kSetItem:
        Extend(Kind::kDict, PopMany(2));
        return true;
      case kSetItems:
        Extend(Kind::kDict, PopToMark());
        return true;
      default:
        return false;
    }
  }

  void PushGlobal(std::string_view module, std::string_view name) {
    const std::string global = std::string(module) + "." + std::string(name);
    const auto* allowed = std::find(kAllowedGlobals.begin(), kAllowedGlobals.end(), global);
    if (allowed == kAllowedGlobals.end()) {
      Refuse("refers to " + Printable(global) + ", which is refused: vgtw never executes code",
             "tensors of F64, F32, F16, BF16, I64, I32, U8 or bool in dicts");
    }
    Push({Kind::kGlobal, 0, *allowed, {}});
  }

  void Reduce() {
    const PickleId arguments = Pop();
    const std::string_view global = Top(Kind::kGlobal, "something to call").text;
    Pop();
    if (values_[arguments].kind != Kind::kTuple) FailHere("has other arguments", "a tuple of them");
    if (global != kOrderedDict) return Push({Kind::kCall, 0, global, {arguments}});
    if (!values_[arguments].items.empty()) Refuse("makes an OrderedDict at once", "an empty one");
    Push({Kind::kDict, 0, {}, {}});
  }

  bool RunCall(uint8_t opcode) {
    switch (opcode) {
      case kGlobalByLines: {
        const std::string_view module = ReadLine();
        PushGlobal(module, ReadLine());
        return true;
      }
      case kStackGlobal: {
        const std::string_view name = Top(Kind::kString, "the name of a global").text;
        Pop();
        const std::string_view module = Top(Kind::kString, "the module of a global").text;
        Pop();
        PushGlobal(module, name);
        return true;
      }
      case kReduce:
        Reduce();
        return true;
      case kBuild:
        // Attributes of an OrderedDict, such as _metadata with the versions of modules.
        Pop();
        Top(Kind::kDict, "a dict to set attributes of");
        return true;
      case kBinPersId:
        Push({Kind::kPersistent, 0, {}, PopMany(1)});
        return true;
      default:
        return false;
    }
  }

  std::span<const std::byte> bytes_;
  const std::filesystem::path& path_;
  std::deque<PickleValue>& values_;
  size_t position_ = 0;
  std::vector<PickleId> stack_;
  std::vector<size_t> marks_;
  std::unordered_map<uint32_t, PickleId> memo_;
};

}  // namespace

Pickle::Pickle(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  root_ = Machine(bytes, path, values_).Run();
}

}  // namespace vgtw
