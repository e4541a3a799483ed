// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/npz.h"

#include "scene/error.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include <zip.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kExtension = ".npy";
constexpr zip_int64_t kMaxEntries = 1 << 16;

std::string EntryOrigin(const fs::path& path, const std::string& key) {
  return path.string() + ":" + key;
}

[[noreturn]] void FailMissing(const ArrayStore& store, const std::string& key) {
  std::string found;
  for (const std::string& other : store.keys()) found += (found.empty() ? "" : ", ") + other;
  Fail(store.path(),
       "has no array '" + Printable(key) + "' (it has: " + Printable(found) + ")",
       "an array of that name");
}

using ZipPtr = std::shared_ptr<zip_t>;

std::string ZipErrorText(int code) {
  zip_error_t error;
  zip_error_init_with_code(&error, code);
  std::string text = zip_error_strerror(&error);
  zip_error_fini(&error);
  return text;
}

class Archive : public ArrayStore {
 public:
  // `bytes` backs an archive that was opened from memory.
  Archive(const fs::path& path, zip_t* zip, std::shared_ptr<const std::string> bytes)
      : ArrayStore(path), bytes_(std::move(bytes)), zip_(zip, zip_discard) {
    const zip_int64_t num_entries = zip_get_num_entries(zip, 0);
    if (num_entries < 0 || num_entries > kMaxEntries) {
      Fail(path, "has " + std::to_string(num_entries) + " entries", "an .npz archive of arrays");
    }
    for (zip_int64_t i = 0; i < num_entries; ++i) {
      const char* name = zip_get_name(zip, static_cast<zip_uint64_t>(i), ZIP_FL_ENC_RAW);
      const std::string_view entry = name == nullptr ? std::string_view() : name;
      if (entry.ends_with(kExtension)) {
        keys_.emplace_back(entry.substr(0, entry.size() - kExtension.size()));
      }
    }
    std::sort(keys_.begin(), keys_.end());
  }

  const std::vector<std::string>& keys() const override { return keys_; }

  NpyReader Open(const std::string& key) const override {
    const std::string name = key + std::string(kExtension);
    zip_stat_t status;
    zip_stat_init(&status);
    if (zip_stat(zip_.get(), name.c_str(), ZIP_FL_ENC_RAW, &status) != 0) FailMissing(*this, key);
    const std::string origin = EntryOrigin(path(), key);
    zip_file_t* opened = nullptr;
    if ((status.valid & ZIP_STAT_SIZE) != 0) {
      opened = zip_fopen_index(zip_.get(), status.index, 0);
    }
    if (opened == nullptr) {
      throw Error(Printable(origin) + ": cannot be read: " + zip_strerror(zip_.get()));
    }
    // The archive must outlive the file opened in it, and its bytes the archive.
    std::shared_ptr<zip_file_t> file(
        opened, [zip = zip_, bytes = bytes_](zip_file_t* closing) { zip_fclose(closing); });
    return NpyReader(
        [file, origin](std::span<std::byte> bytes) { return ReadEntry(*file, bytes, origin); },
        status.size,
        origin);
  }

 private:
  static size_t ReadEntry(zip_file_t& file, std::span<std::byte> bytes, const std::string& origin) {
    size_t num_read = 0;
    while (num_read < bytes.size()) {
      const zip_int64_t count = zip_fread(&file, bytes.data() + num_read, bytes.size() - num_read);
      if (count < 0) {
        throw Error(Printable(origin) + ": is damaged: " + zip_file_strerror(&file));
      }
      if (count == 0) break;
      num_read += static_cast<size_t>(count);
    }
    return num_read;
  }

  std::shared_ptr<const std::string> bytes_;
  ZipPtr zip_;
  std::vector<std::string> keys_;
};

class Folder : public ArrayStore {
 public:
  explicit Folder(const fs::path& path) : ArrayStore(path) {
    std::error_code code;
    for (auto entry = fs::directory_iterator(path, code);
         !code && entry != fs::directory_iterator();
         entry.increment(code)) {
      if (entry->path().extension() == kExtension) keys_.push_back(entry->path().stem().string());
    }
    if (code) throw Error(Printable(path.string()) + ": cannot be read: " + code.message());
    std::sort(keys_.begin(), keys_.end());
  }

  const std::vector<std::string>& keys() const override { return keys_; }

  NpyReader Open(const std::string& key) const override {
    if (!Contains(key)) FailMissing(*this, key);
    return OpenNpyFile(path() / (key + std::string(kExtension)));
  }

 private:
  std::vector<std::string> keys_;
};

}  // namespace

bool ArrayStore::Contains(const std::string& key) const {
  return std::binary_search(keys().begin(), keys().end(), key);
}

bool IsNpzFile(const fs::path& path) {
  return fs::is_regular_file(path) && path.extension() == ".npz";
}

NpyReader OpenNpyFile(const fs::path& path) {
  std::shared_ptr<std::FILE> file(std::fopen(path.c_str(), "rbe"),
                                  [](std::FILE* closing) { closing&& std::fclose(closing); });
  if (file == nullptr) FailErrno(path, "cannot be read");
  std::error_code code;
  const uintmax_t file_size = fs::file_size(path, code);
  if (code) throw Error(Printable(path.string()) + ": cannot be read: " + code.message());
  return NpyReader(
      [file](std::span<std::byte> bytes) {
        return std::fread(bytes.data(), 1, bytes.size(), file.get());
      },
      file_size,
      path.string());
}

std::unique_ptr<ArrayStore> OpenArrayStore(const fs::path& path) {
  if (fs::is_directory(path)) return std::make_unique<Folder>(path);
  int code = 0;
  zip_t* zip = zip_open(path.c_str(), ZIP_RDONLY, &code);
  if (zip == nullptr) {
    Fail(path, "cannot be read as .npz (" + ZipErrorText(code) + ")", "an archive of numpy.savez");
  }
  return std::make_unique<Archive>(path, zip, nullptr);
}

std::unique_ptr<ArrayStore> OpenArchive(std::string bytes, const fs::path& path) {
  const auto shared = std::make_shared<const std::string>(std::move(bytes));
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* source = zip_source_buffer_create(shared->data(), shared->size(), 0, &error);
  zip_t* zip = source == nullptr ? nullptr : zip_open_from_source(source, ZIP_RDONLY, &error);
  const std::string text = zip_error_strerror(&error);
  zip_error_fini(&error);
  if (zip == nullptr) {
    if (source != nullptr) zip_source_free(source);
    Fail(path, "cannot be read as .npz (" + text + ")", "an archive of numpy.savez");
  }
  return std::make_unique<Archive>(path, zip, shared);
}

}  // namespace vgtw
