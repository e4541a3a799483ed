// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace vgtw {

// A file that appears under its final name only when it is complete: bytes go to a file beside
// `path`, Commit() flushes, fsyncs and renames. Without Commit() nothing is left behind.
// Throws Error if the target cannot be written (missing folder, permission, disk full, a device).
// A limit on file sizes must not kill the process first: programs ignore SIGXFSZ.
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void Write(std::span<const std::byte> bytes);
  void Write(std::string_view text);
  void Commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path temporary_path_;
  std::FILE* file_ = nullptr;
};

// A folder that appears under its final name only when it is complete: fill path(), then Commit().
// Parent folders are created. Law: `final_path` must not exist, be an empty folder, or `overwrite`
// be set (then the old folder is replaced as a whole at Commit()). Throws Error otherwise, also at
// Commit() if another process filled the folder meanwhile. Without Commit() nothing is left; only a
// killed process leaves ".<name>.tmp-<pid>-<n>" beside it, which may be deleted.
class AtomicFolder {
 public:
  AtomicFolder(std::filesystem::path final_path, bool overwrite);
  ~AtomicFolder();
  AtomicFolder(const AtomicFolder&) = delete;
  AtomicFolder& operator=(const AtomicFolder&) = delete;

  const std::filesystem::path& path() const { return temporary_path_; }
  void Commit();

 private:
  std::filesystem::path final_path_;
  std::filesystem::path temporary_path_;
  bool overwrite_ = false;
  bool committed_ = false;
};

void WriteFileAtomically(const std::filesystem::path& path, std::string_view bytes);

// The whole file. Throws Error if it is unreadable or larger than max_bytes.
std::string ReadFile(const std::filesystem::path& path, size_t max_bytes = size_t{1} << 32);

// A read-only memory map of a whole file; an empty file maps to an empty span. The file must not
// shrink meanwhile (files that this project writes are renamed, never rewritten).
// Throws Error if the file is missing or not a regular file.
class MappedFile {
 public:
  explicit MappedFile(const std::filesystem::path& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::span<const std::byte> bytes() const { return bytes_; }

  // Gives back the memory of what was read so far; what is touched again is read again.
  void ReleasePages() const;

 private:
  std::span<const std::byte> bytes_;
};

// Whether `name` is a relative path that stays inside its folder and is printable: no leading '/',
// no "..", "." or empty component, no backslash, no control character, at most 1024 bytes.
bool IsSafeRelativeName(std::string_view name);

}  // namespace vgtw
