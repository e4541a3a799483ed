// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

namespace vgtw {

using PickleId = uint32_t;

// A value of a pickle. Values refer to each other by id, so that they may be shared or cyclic.
struct PickleValue {
  enum class Kind {
    kOpaque,      // None, a bool, a float, bytes, an integer beyond 64 bits: never looked at
    kInt,         // `number`
    kString,      // `text`
    kTuple,       // `items`
    kList,        // `items`
    kDict,        // `items`: key, value, key, value, ... in the order of the file
    kGlobal,      // `text`: "module.name", an allowed one
    kCall,        // `text`(*items[0]): a call that was noted, not made; items[0] is a tuple
    kPersistent,  // items[0]: the persistent id, by which torch names a storage
  };
  Kind kind = Kind::kOpaque;
  int64_t number = 0;
  std::string_view text;
  std::vector<PickleId> items;
};

// The values of a Python pickle (protocols 2 to 4) as torch.save writes it for weights. Nothing is
// ever imported or called: the only globals allowed are the storage types, what rebuilds tensors
// (kept as kCall) and OrderedDict (becomes a kDict; attributes set on it are dropped).
// Strings point into `bytes`, or are static; `path` is for messages. Throws Error for any other
// global, which it names, any other opcode, what does not fit, and more than 16 MiB or 2^21 values.
class Pickle {
 public:
  Pickle(std::span<const std::byte> bytes, const std::filesystem::path& path);

  PickleId root() const { return root_; }
  const PickleValue& operator[](PickleId id) const { return values_[id]; }

 private:
  std::deque<PickleValue> values_;
  PickleId root_ = 0;
};

}  // namespace vgtw
