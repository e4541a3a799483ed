// SPDX-License-Identifier: BSD-3-Clause
#include "scene/files.h"

#include "scene/error.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <memory>
#include <sys/mman.h>
#include <sys/stat.h>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void FailToWrite(const fs::path& path, const std::error_code& code) {
  throw Error(Printable(path.string()) + ": cannot be written: " + code.message());
}

// A hidden name beside `path`, another at every call. Files that a killed process left behind may
// have it already, and are not touched.
fs::path TemporaryBeside(const fs::path& path) {
  static std::atomic<int> num_calls = 0;
  return path.parent_path() / ("." + path.filename().string() + ".tmp-" +
                               std::to_string(::getpid()) + "-" + std::to_string(num_calls++));
}

// The path of the folder itself, not of a link to it, without trailing slash or dots.
fs::path ResolveFolder(const fs::path& path) {
  std::error_code code;
  fs::path resolved = fs::absolute(path, code);
  if (!code) resolved = fs::weakly_canonical(resolved, code);
  if (code) Fail(path, "is not a usable path", "the path of a folder");
  if (!resolved.has_filename()) resolved = resolved.parent_path();
  return resolved;
}

// A rename is durable only after its folder has been synced.
void SyncFolderOf(const fs::path& path) {
  const fs::path folder = path.parent_path().empty() ? fs::path(".") : path.parent_path();
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

// Puts `temporary` where the full folder `final_path` is, and that where `temporary` was.
void ExchangeFolders(const fs::path& temporary, const fs::path& final_path) {
  if (::renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, final_path.c_str(), RENAME_EXCHANGE) ==
      0) {
    return;
  }
  // Network file systems cannot exchange; there the final name is absent for a moment.
  const fs::path old = TemporaryBeside(final_path);
  std::error_code code;
  fs::rename(final_path, old, code);
  if (code) FailToWrite(final_path, code);
  fs::rename(temporary, final_path, code);
  std::error_code ignored;
  fs::rename(old, code ? final_path : temporary, ignored);
  if (code) FailToWrite(final_path, code);
}

// An open file and its size.
struct OpenFile {
  int descriptor = -1;
  size_t num_bytes = 0;
};

OpenFile OpenRegularFile(const fs::path& path) {
  // Without O_NONBLOCK a pipe would wait for its writer.
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) FailErrno(path, "cannot be read");
  struct stat status = {};
  if (::fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(descriptor);
    Fail(path, "is not a file", "a regular file");
  }
  return {descriptor, static_cast<size_t>(status.st_size)};
}

}  // namespace

AtomicFile::AtomicFile(fs::path path)
    : path_(std::move(path)), temporary_path_(TemporaryBeside(path_)) {
  std::error_code code;
  const fs::file_status status = fs::status(path_, code);
  if (!path_.has_filename() || fs::is_directory(status)) {
    Fail(path_, "is a folder", "a file name to write");
  }
  // Renaming onto a device would replace the device.
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    Fail(path_, "is a device or pipe", "a file name to write");
  }
  file_ = std::fopen(temporary_path_.c_str(), "wbxe");
  if (file_ == nullptr) FailErrno(path_, "cannot be written");
}

AtomicFile::~AtomicFile() {
  if (file_ == nullptr) return;
  std::fclose(file_);
  ::unlink(temporary_path_.c_str());
}

void AtomicFile::Write(std::span<const std::byte> bytes) {
  VGTW_CHECK(file_ != nullptr, "the file is committed");
  if (bytes.empty()) return;  // a null pointer must not reach fwrite
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) {
    FailErrno(path_, "cannot be written");
  }
}

void AtomicFile::Write(std::string_view text) { Write(std::as_bytes(std::span(text))); }

void AtomicFile::Commit() {
  VGTW_CHECK(file_ != nullptr, "the file is committed");
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
    : final_path_(ResolveFolder(final_path)),
      temporary_path_(TemporaryBeside(final_path_)),
      overwrite_(overwrite) {
  std::error_code code;
  if (final_path_ == fs::current_path(code)) {
    // Replacing it would leave this process and the user's shell in a deleted folder.
    Fail(final_path, "is the current folder", "another folder to write");
  }
  const fs::file_status status = fs::status(final_path_, code);
  if (fs::exists(status)) {
    if (!fs::is_directory(status)) Fail(final_path, "is a file", "a folder to write");
    const bool is_empty = fs::is_empty(final_path_, code);
    if (!is_empty && !overwrite) {
      Fail(final_path, "exists", "a new or empty folder", "name another or add --overwrite");
    }
  }
  fs::create_directories(final_path_.parent_path(), code);
  if (code) FailToWrite(final_path, code);
  const bool is_new = fs::create_directory(temporary_path_, code);
  if (code || !is_new) {
    FailToWrite(final_path, code ? code : std::make_error_code(std::errc::file_exists));
  }
}

AtomicFolder::~AtomicFolder() {
  if (committed_) return;
  std::error_code ignored;
  fs::remove_all(temporary_path_, ignored);
}

void AtomicFolder::Commit() {
  std::error_code code;
  // A rename also replaces an empty folder, but never one that another process filled meanwhile.
  fs::rename(temporary_path_, final_path_, code);
  if (code == std::errc::directory_not_empty && overwrite_) {
    ExchangeFolders(temporary_path_, final_path_);
    fs::remove_all(temporary_path_, code);
  } else if (code) {
    FailToWrite(final_path_, code);
  }
  committed_ = true;
  SyncFolderOf(final_path_);
}

void WriteFileAtomically(const fs::path& path, std::string_view bytes) {
  AtomicFile file(path);
  file.Write(bytes);
  file.Commit();
}

std::string ReadFile(const fs::path& path, size_t max_bytes) {
  const OpenFile open = OpenRegularFile(path);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(::fdopen(open.descriptor, "rb"),
                                                             &std::fclose);
  if (file == nullptr) FailErrno(path, "cannot be read");
  if (open.num_bytes > max_bytes) {
    Fail(path,
         "has " + std::to_string(open.num_bytes) + " bytes",
         "at most " + std::to_string(max_bytes));
  }
  std::string bytes(open.num_bytes, '\0');
  bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file.get()));
  if (std::ferror(file.get()) != 0) FailErrno(path, "cannot be read");
  return bytes;
}

MappedFile::MappedFile(const fs::path& path) {
  const OpenFile open = OpenRegularFile(path);
  if (open.num_bytes == 0) {
    ::close(open.descriptor);
    return;
  }
  void* address = ::mmap(nullptr, open.num_bytes, PROT_READ, MAP_PRIVATE, open.descriptor, 0);
  const int code = errno;
  ::close(open.descriptor);
  errno = code;
  if (address == MAP_FAILED) FailErrno(path, "cannot be mapped");
  bytes_ = {static_cast<const std::byte*>(address), open.num_bytes};
}

MappedFile::~MappedFile() {
  if (!bytes_.empty()) ::munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size());
}

void MappedFile::ReleasePages() const {
  // Nothing is lost, because nothing can be written to the mapping.
  if (!bytes_.empty()) {
    ::madvise(const_cast<std::byte*>(bytes_.data()), bytes_.size(), MADV_DONTNEED);
  }
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
