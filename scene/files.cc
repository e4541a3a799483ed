// SPDX-License-Identifier: BSD-3-Clause
#include "scene/files.h"

#include "scene/error.h"

#include <algorithm>
#include <cerrno>
#include <sys/mman.h>
#include <sys/stat.h>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// A name beside `path` that no other process uses.
fs::path TemporaryBeside(const fs::path& path) {
  fs::path target = path;
  if (!target.has_filename()) target = target.parent_path();
  return target.parent_path() /
         ("." + target.filename().string() + ".tmp-" + std::to_string(::getpid()));
}

// A rename is durable only after its folder has been synced.
void SyncFolderOf(const fs::path& path) {
  const fs::path folder = path.parent_path().empty() ? fs::path(".") : path.parent_path();
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

bool IsEmptyFolder(const fs::path& path) { return fs::is_directory(path) && fs::is_empty(path); }

}  // namespace

AtomicFile::AtomicFile(fs::path path)
    : path_(std::move(path)), temporary_path_(TemporaryBeside(path_)) {
  if (fs::is_directory(path_)) Fail(path_, "is a folder", "a file name to write");
  file_ = std::fopen(temporary_path_.c_str(), "wbe");
  if (file_ == nullptr) FailErrno(path_, "cannot be written");
}

AtomicFile::~AtomicFile() {
  if (file_ == nullptr) return;
  std::fclose(file_);
  ::unlink(temporary_path_.c_str());
}

void AtomicFile::Write(std::span<const std::byte> bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) {
    FailErrno(path_, "cannot be written");
  }
}

void AtomicFile::Write(std::string_view text) { Write(std::as_bytes(std::span(text))); }

void AtomicFile::Commit() {
  if (std::fflush(file_) != 0 || ::fsync(::fileno(file_)) != 0) {
    FailErrno(path_, "cannot be written");
  }
  std::FILE* file = std::exchange(file_, nullptr);
  if (std::fclose(file) != 0 || ::rename(temporary_path_.c_str(), path_.c_str()) != 0) {
    const int code = errno;
    ::unlink(temporary_path_.c_str());
    errno = code;
    FailErrno(path_, "cannot be written");
  }
  SyncFolderOf(path_);
}

AtomicFolder::AtomicFolder(fs::path final_path, bool overwrite)
    : final_path_(std::move(final_path)), temporary_path_(TemporaryBeside(final_path_)) {
  if (fs::exists(final_path_) && !IsEmptyFolder(final_path_) && !overwrite) {
    Fail(final_path_, "exists", "a new or empty folder", "name another or add --overwrite");
  }
  std::error_code code;
  fs::remove_all(temporary_path_, code);
  if (!fs::create_directories(temporary_path_, code)) {
    throw Error(Printable(final_path_.string()) + ": cannot be written: " + code.message());
  }
}

AtomicFolder::~AtomicFolder() {
  if (committed_) return;
  std::error_code ignored;
  fs::remove_all(temporary_path_, ignored);
}

void AtomicFolder::Commit() {
  std::error_code code;
  fs::path old_path;
  if (fs::exists(final_path_)) {
    old_path = temporary_path_;
    old_path += "-old";
    fs::rename(final_path_, old_path, code);
  }
  if (!code) fs::rename(temporary_path_, final_path_, code);
  if (code) {
    std::error_code ignored;
    if (!old_path.empty() && !fs::exists(final_path_)) fs::rename(old_path, final_path_, ignored);
    throw Error(Printable(final_path_.string()) + ": cannot be written: " + code.message());
  }
  committed_ = true;
  SyncFolderOf(final_path_);
  if (!old_path.empty()) fs::remove_all(old_path, code);
}

void WriteFileAtomically(const fs::path& path, std::string_view bytes) {
  AtomicFile file(path);
  file.Write(bytes);
  file.Commit();
}

std::string ReadFile(const fs::path& path, size_t max_bytes) {
  const MappedFile file(path);
  if (file.bytes().size() > max_bytes) {
    Fail(path,
         "has " + std::to_string(file.bytes().size()) + " bytes",
         "at most " + std::to_string(max_bytes));
  }
  return {reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size()};
}

MappedFile::MappedFile(const fs::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) FailErrno(path, "cannot be read");
  struct stat status = {};
  const bool regular = ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
  if (!regular || status.st_size == 0) {
    ::close(descriptor);
    if (!regular) Fail(path, "is not a file", "a regular file");
    return;
  }
  const auto size = static_cast<size_t>(status.st_size);
  void* address = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
  ::close(descriptor);
  if (address == MAP_FAILED) FailErrno(path, "cannot be mapped");
  bytes_ = {static_cast<const std::byte*>(address), size};
}

MappedFile::~MappedFile() {
  if (!bytes_.empty()) ::munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size());
}

bool IsSafeRelativeName(std::string_view name) {
  constexpr size_t kMaxLength = 1024;
  if (name.empty() || name.size() > kMaxLength || name.front() == '/') return false;
  const auto is_bad = [](unsigned char c) { return c < 0x20 || c == 0x7f || c == '\\'; };
  if (std::any_of(name.begin(), name.end(), is_bad)) return false;
  for (size_t begin = 0; begin <= name.size();) {
    const size_t end = std::min(name.find('/', begin), name.size());
    const std::string_view component = name.substr(begin, end - begin);
    if (component.empty() || component == "." || component == "..") return false;
    begin = end + 1;
  }
  return true;
}

}  // namespace vgtw
