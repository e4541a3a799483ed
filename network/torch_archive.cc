// SPDX-License-Identifier: BSD-3-Clause
#include "network/torch_archive.h"

#include "scene/error.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

namespace vgtw {
namespace {

static_assert(std::endian::native == std::endian::little, "zip archives are little-endian");

// Records of the format (PKWARE APPNOTE 4.3) without what follows their fixed part.
constexpr uint32_t kLocalSignature = 0x04034b50;
constexpr uint32_t kEntrySignature = 0x02014b50;
constexpr uint32_t kEndSignature = 0x06054b50;
constexpr uint32_t kEnd64Signature = 0x06064b50;
constexpr uint32_t kLocatorSignature = 0x07064b50;
constexpr uint64_t kLocalBytes = 30;
constexpr uint64_t kEntryBytes = 46;
constexpr uint64_t kEndBytes = 22;
constexpr uint64_t kEnd64Bytes = 56;
constexpr uint64_t kLocatorBytes = 20;

constexpr uint16_t kZip64Extra = 1;
constexpr uint16_t kEncryptionFlags = 1 << 0 | 1 << 6 | 1 << 13;
constexpr uint64_t kMaxEntries = 1 << 20;
constexpr std::string_view kDamaged = "the file is truncated or damaged: copy or download it again";
constexpr std::string_view kSaveAgain =
    "save it again: torch.save(torch.load(OLD, map_location='cpu', weights_only=True), NEW)";

// An entry of the directory. `begin` is where its local header begins.
struct Entry {
  std::string name;
  uint16_t flags = 0;
  uint16_t method = 0;
  uint64_t stored_size = 0;
  uint64_t size = 0;
  uint64_t begin = 0;
};

struct Directory {
  uint64_t num_entries = 0;
  uint64_t begin = 0;
  uint64_t end = 0;
};

class ZipReader {
 public:
  ZipReader(std::span<const std::byte> bytes, const std::filesystem::path& path)
      : bytes_(bytes), path_(path) {}

  std::vector<Entry> ReadEntries() {
    directory_ = FindDirectory();
    std::vector<Entry> entries;
    uint64_t position = directory_.begin;
    for (uint64_t i = 0; i < directory_.num_entries; ++i) entries.push_back(ReadEntry(position));
    if (position != directory_.end) FailDamaged("has a directory of another length than it says");
    return entries;
  }

  // The bytes of every entry, in order.
  std::vector<std::span<const std::byte>> ReadData(const std::vector<Entry>& entries) const {
    std::vector<std::span<const std::byte>> data;
    std::vector<std::pair<uint64_t, uint64_t>> extents;  // begin of header, end of data
    for (const Entry& entry : entries) {
      data.push_back(DataOf(entry));
      extents.emplace_back(entry.begin,
                           static_cast<uint64_t>(data.back().data() - bytes_.data()) + entry.size);
    }
    std::sort(extents.begin(), extents.end());
    for (size_t i = 1; i < extents.size(); ++i) {
      if (extents[i].first < extents[i - 1].second) FailDamaged("has entries that overlap");
    }
    return data;
  }

 private:
  [[noreturn]] void FailDamaged(const std::string& found) const {
    Fail(path_, found, "a zip archive as torch.save writes it", kDamaged);
  }

  template <typename T>
  T Load(uint64_t position) const {
    if (position > bytes_.size() || sizeof(T) > bytes_.size() - position) {
      FailDamaged("has " + std::to_string(bytes_.size()) + " bytes and refers to byte " +
                  std::to_string(position));
    }
    T value;
    std::memcpy(&value, bytes_.data() + position, sizeof(T));
    return value;
  }

  std::string_view Text(uint64_t position, uint64_t length) const {
    if (position > bytes_.size() || length > bytes_.size() - position) {
      FailDamaged("has a name beyond its end");
    }
    return {reinterpret_cast<const char*>(bytes_.data()) + position, length};
  }

  // Nothing may follow the directory: torch writes no comments, and what somebody put behind a
  // valid archive is not to be searched for another one.
  Directory FindDirectory() const {
    if (bytes_.size() < kEndBytes || Load<uint32_t>(bytes_.size() - kEndBytes) != kEndSignature) {
      FailDamaged("does not end with a zip directory");
    }
    const uint64_t end = bytes_.size() - kEndBytes;
    Directory directory;
    directory.num_entries = Load<uint16_t>(end + 10);
    uint64_t num_bytes = Load<uint32_t>(end + 12);
    directory.begin = Load<uint32_t>(end + 16);
    directory.end = end;
    const bool is_zip64 =
        end >= kLocatorBytes && Load<uint32_t>(end - kLocatorBytes) == kLocatorSignature;
    if (is_zip64) {
      directory.end = Load<uint64_t>(end - kLocatorBytes + 8);
      if (directory.end > end - kLocatorBytes ||
          end - kLocatorBytes - directory.end != kEnd64Bytes ||
          Load<uint32_t>(directory.end) != kEnd64Signature) {
        FailDamaged("has no zip64 record where it should be");
      }
      directory.num_entries = Load<uint64_t>(directory.end + 32);
      num_bytes = Load<uint64_t>(directory.end + 40);
      directory.begin = Load<uint64_t>(directory.end + 48);
    }
    if (directory.begin > directory.end || directory.end - directory.begin != num_bytes ||
        directory.num_entries > num_bytes / kEntryBytes || directory.num_entries > kMaxEntries) {
      FailDamaged("has a directory of " + std::to_string(directory.num_entries) + " entries and " +
                  std::to_string(num_bytes) + " bytes at byte " + std::to_string(directory.begin));
    }
    return directory;
  }

  Entry ReadEntry(uint64_t& position) const {
    if (Load<uint32_t>(position) != kEntrySignature) {
      FailDamaged("has no directory entry at byte " + std::to_string(position));
    }
    Entry entry;
    entry.flags = Load<uint16_t>(position + 8);
    entry.method = Load<uint16_t>(position + 10);
    entry.stored_size = Load<uint32_t>(position + 20);
    entry.size = Load<uint32_t>(position + 24);
    entry.begin = Load<uint32_t>(position + 42);
    const auto name_length = Load<uint16_t>(position + 28);
    const auto extra_length = Load<uint16_t>(position + 30);
    const auto comment_length = Load<uint16_t>(position + 32);
    entry.name = Text(position + kEntryBytes, name_length);
    position += kEntryBytes + name_length;
    ReadZip64Extra(position, position + extra_length, entry);
    position += uint64_t{extra_length} + comment_length;
    if (position > directory_.end) FailDamaged("has an entry beyond its directory");
    return entry;
  }

  // Only the fields that 32 bits cannot hold are there, in this order.
  void ReadZip64Extra(uint64_t position, uint64_t end, Entry& entry) const {
    constexpr uint64_t kInExtra = std::numeric_limits<uint32_t>::max();
    while (end - position >= 4) {
      const auto id = Load<uint16_t>(position);
      uint64_t length = Load<uint16_t>(position + 2);
      position += 4;
      if (length > end - position) FailDamaged("has a damaged extra field");
      if (id == kZip64Extra) {
        for (uint64_t* field : {&entry.size, &entry.stored_size, &entry.begin}) {
          if (*field != kInExtra) continue;
          if (length < sizeof(uint64_t)) FailDamaged("has a zip64 field that is too short");
          *field = Load<uint64_t>(position);
          position += sizeof(uint64_t);
          length -= sizeof(uint64_t);
        }
        return;
      }
      position += length;
    }
  }

  std::span<const std::byte> DataOf(const Entry& entry) const {
    const std::string who = "has an entry '" + Printable(entry.name) + "' that ";
    if ((entry.flags & kEncryptionFlags) != 0) {
      Fail(path_, who + "is encrypted", "plain entries", kSaveAgain);
    }
    if (entry.method != 0 || entry.size != entry.stored_size) {
      Fail(path_, who + "is compressed", "stored entries, as torch.save writes them", kSaveAgain);
    }
    const uint64_t limit = directory_.begin;
    if (entry.begin > limit || limit - entry.begin < kLocalBytes ||
        Load<uint32_t>(entry.begin) != kLocalSignature) {
      FailDamaged(who + "has no header at byte " + std::to_string(entry.begin));
    }
    const auto name_length = Load<uint16_t>(entry.begin + 26);
    const auto extra_length = Load<uint16_t>(entry.begin + 28);
    const uint64_t begin = entry.begin + kLocalBytes + name_length + extra_length;
    if (begin > limit || entry.size > limit - begin) {
      FailDamaged(who + "needs " + std::to_string(entry.size) + " bytes from byte " +
                  std::to_string(begin));
    }
    const bool is_same = Load<uint16_t>(entry.begin + 8) == entry.method &&
                         Text(entry.begin + kLocalBytes, name_length) == entry.name;
    if (!is_same) FailDamaged(who + "has another header than the directory says");
    return bytes_.subspan(begin, entry.size);
  }

  std::span<const std::byte> bytes_;
  const std::filesystem::path& path_;
  Directory directory_;
};

bool BeginsWith(std::span<const std::byte> bytes, std::string_view start) {
  return bytes.size() >= start.size() && std::memcmp(bytes.data(), start.data(), start.size()) == 0;
}

bool BeginsLikePickle(std::span<const std::byte> bytes) {
  return bytes.size() >= 2 && bytes[0] == std::byte{0x80} && bytes[1] >= std::byte{2} &&
         bytes[1] <= std::byte{5};
}

// The folder of all entries, with its slash.
std::string_view CommonFolder(const std::vector<Entry>& entries,
                              const std::filesystem::path& path) {
  std::string_view folder = entries.empty() ? std::string_view() : entries.front().name;
  folder = folder.substr(0, folder.find('/') + 1);
  const bool is_common = std::all_of(entries.begin(), entries.end(), [&](const Entry& entry) {
    return std::string_view(entry.name).starts_with(folder);
  });
  if (folder.empty() || !is_common) {
    Fail(path, "is a zip archive whose entries lie in no common folder", "one of torch.save");
  }
  return folder;
}

void RefuseTorchScript(const std::vector<Entry>& entries,
                       std::string_view folder,
                       const std::filesystem::path& path) {
  for (const Entry& entry : entries) {
    const auto name = std::string_view(entry.name).substr(folder.size());
    if (name != "constants.pkl" && !name.starts_with("code/")) continue;
    Fail(path,
         "is a TorchScript program, which is refused: vgtw never executes code",
         "weights",
         "save them: torch.save(torch.jit.load(OLD, map_location='cpu').state_dict(), NEW)");
  }
}

}  // namespace

bool BeginsLikeTorchFile(std::span<const std::byte> bytes) {
  return BeginsWith(bytes, "PK\x03\x04") || BeginsLikePickle(bytes);
}

TorchArchive ParseTorchArchive(std::span<const std::byte> bytes,
                               const std::filesystem::path& path) {
  if (BeginsLikePickle(bytes)) {
    Fail(path,
         "is a bare pickle, such as torch before 1.6 wrote",
         "the zip archive that torch.save writes",
         kSaveAgain);
  }
  constexpr std::string_view kStorageFolder = "data/";
  ZipReader reader(bytes, path);
  const std::vector<Entry> entries = reader.ReadEntries();
  const std::string_view folder = CommonFolder(entries, path);
  RefuseTorchScript(entries, folder, path);
  const auto data = reader.ReadData(entries);

  std::map<std::string_view, std::span<const std::byte>> data_by_name;
  TorchArchive archive;
  for (size_t i = 0; i < entries.size(); ++i) {
    const std::string_view name = std::string_view(entries[i].name).substr(folder.size());
    if (!data_by_name.emplace(name, data[i]).second) {
      Fail(path, "has the entry '" + Printable(entries[i].name) + "' twice", "once", kDamaged);
    }
    if (name.starts_with(kStorageFolder)) {
      archive.storages.emplace(name.substr(kStorageFolder.size()), data[i]);
    }
  }
  const auto pickle = data_by_name.find("data.pkl");
  if (pickle == data_by_name.end()) {
    Fail(path, "is a zip archive without data.pkl", "one of torch.save");
  }
  archive.pickle = pickle->second;
  const auto byte_order = data_by_name.find("byteorder");
  if (byte_order != data_by_name.end() &&
      !(byte_order->second.size() == 6 && BeginsWith(byte_order->second, "little"))) {
    Fail(path, "holds data that is not little-endian", "little-endian data", kSaveAgain);
  }
  return archive;
}

}  // namespace vgtw
