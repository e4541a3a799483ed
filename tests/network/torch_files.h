// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tests/support/bytes.h"

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace vgtw::torch_files {

// Pickles, opcode by opcode: each function gives the bytes that push one value.
inline std::string Text(std::string_view text) {
  return Bytes('X', static_cast<uint32_t>(text.size()), text);
}

inline std::string Int(int64_t number) { return Bytes("\x8a", uint8_t{8}, number); }

inline std::string Global(std::string_view module, std::string_view name) {
  return Bytes('c', module, '\n', name, '\n');
}

template <typename... Items>
std::string Tuple(const Items&... items) {
  return Bytes('(', items..., 't');
}

inline std::string Ints(const std::vector<int64_t>& numbers) {
  std::string items;
  for (const int64_t number : numbers) items += Int(number);
  return Tuple(items);
}

// `entries` are keys and values in turn.
template <typename... Entries>
std::string Dict(const Entries&... entries) {
  return Bytes("}(", entries..., 'u');
}

template <typename... Entries>
std::string OrderedDict(const Entries&... entries) {
  return Bytes(Global("collections", "OrderedDict"), ")R(", entries..., 'u');
}

inline std::string Storage(std::string_view type, std::string_view key, int64_t num_elements) {
  return Tuple(Text("storage"), Global("torch", type), Text(key), Text("cpu"), Int(num_elements)) +
         "Q";
}

inline std::string Tensor(const std::string& storage,
                          int64_t offset,
                          const std::vector<int64_t>& shape,
                          const std::vector<int64_t>& strides) {
  return Global("torch._utils", "_rebuild_tensor_v2") +
         Tuple(storage, Int(offset), Ints(shape), Ints(strides), '\x89', OrderedDict()) + "R";
}

inline std::string Parameter(const std::string& tensor) {
  return Global("torch._utils", "_rebuild_parameter") + Tuple(tensor, '\x88', OrderedDict()) + "R";
}

inline std::string Pickled(const std::string& root) { return "\x80\x02" + root + "."; }

struct ZipEntry {
  std::string name;
  std::string data;
  uint16_t method = 0;
  uint16_t flags = 0x0808;  // as torch: sizes also follow the data, UTF-8
};

// A zip archive as torch writes it: data at multiples of 64 bytes, sizes behind the data, no sizes
// in the headers. With `is_zip64` every size and offset is kept in 64 bits.
inline std::string Zip(const std::vector<ZipEntry>& entries, bool is_zip64 = false) {
  std::string file;
  std::string directory;
  for (const ZipEntry& entry : entries) {
    const uint64_t begin = file.size();
    const uint64_t size = entry.data.size();
    const uint64_t padding = 63 - (begin + 30 + entry.name.size() + 4 + 63) % 64;
    file += Bytes("PK\x03\x04", uint16_t{0}, entry.flags, entry.method, uint32_t{0}, uint32_t{0});
    file += Bytes(uint32_t{0}, uint32_t{0}, static_cast<uint16_t>(entry.name.size()));
    file += Bytes(static_cast<uint16_t>(padding + 4), entry.name, "FB");
    file += Bytes(static_cast<uint16_t>(padding), std::string(padding, 'Z'), entry.data);
    file += Bytes("PK\x07\x08", uint32_t{0}, static_cast<uint32_t>(size));
    file += Bytes(static_cast<uint32_t>(size));
    const auto saturated = [&](uint64_t value) {
      return is_zip64 ? UINT32_MAX : static_cast<uint32_t>(value);
    };
    const std::string extra =
        is_zip64 ? Bytes("ZZ", uint16_t{1}, 'Z', uint16_t{1}, uint16_t{24}, size, size, begin) : "";
    directory += Bytes("PK\x01\x02", uint16_t{0}, uint16_t{0}, entry.flags, entry.method);
    directory += Bytes(uint32_t{0}, uint32_t{0}, saturated(size), saturated(size));
    directory +=
        Bytes(static_cast<uint16_t>(entry.name.size()), static_cast<uint16_t>(extra.size()));
    directory += Bytes(uint16_t{0}, uint16_t{0}, uint16_t{0}, uint32_t{0}, saturated(begin));
    directory += entry.name + extra;
  }
  const uint64_t begin = file.size();
  const uint64_t count = entries.size();
  const uint64_t size = directory.size();
  file += directory;
  if (is_zip64) {
    const uint64_t end = file.size();
    file += Bytes("PK\x06\x06", uint64_t{44}, uint16_t{45}, uint16_t{45}, uint32_t{0}, uint32_t{0});
    file += Bytes(count, count, size, begin, "PK\x06\x07", uint32_t{0}, end, uint32_t{1});
    return file + Bytes("PK\x05\x06",
                        uint32_t{0},
                        uint16_t{UINT16_MAX},
                        uint16_t{UINT16_MAX},
                        UINT32_MAX,
                        UINT32_MAX,
                        uint16_t{0});
  }
  file += Bytes("PK\x05\x06", uint32_t{0}, static_cast<uint16_t>(count));
  return file + Bytes(static_cast<uint16_t>(count),
                      static_cast<uint32_t>(size),
                      static_cast<uint32_t>(begin),
                      uint16_t{0});
}

// The archive of torch.save for the pickle of `root`; storages are keys and bytes.
inline std::string TorchFile(const std::string& root,
                             const std::vector<std::pair<std::string, std::string>>& storages,
                             const std::string& folder = "archive",
                             bool is_zip64 = false) {
  std::vector<ZipEntry> entries = {{folder + "/data.pkl", Pickled(root)},
                                   {folder + "/byteorder", "little"}};
  for (const auto& [key, bytes] : storages) entries.push_back({folder + "/data/" + key, bytes});
  entries.push_back({folder + "/version", "3\n"});
  return Zip(entries, is_zip64);
}

}  // namespace vgtw::torch_files
