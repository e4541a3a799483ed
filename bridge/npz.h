// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/npy.h"

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace vgtw {

// Named NumPy arrays: an .npz archive (entries stored or deflated) or a folder of .npy files.
// Nothing is read before it is asked for; a key of an unreadable type does no harm to the others.
class ArrayStore {
 public:
  virtual ~ArrayStore() = default;

  // Names without ".npy", sorted.
  virtual const std::vector<std::string>& keys() const = 0;
  bool Contains(const std::string& key) const;

  // Throws Error if the key is missing or its array is damaged. The reader holds the archive open;
  // several readers may be in use at the same time, in one thread.
  virtual NpyReader Open(const std::string& key) const = 0;

  // For messages.
  const std::filesystem::path& path() const { return path_; }

 protected:
  explicit ArrayStore(std::filesystem::path path) : path_(std::move(path)) {}

 private:
  std::filesystem::path path_;
};

// A single .npy file. Throws Error if it is missing or damaged.
NpyReader OpenNpyFile(const std::filesystem::path& path);

// By its name.
bool IsNpzFile(const std::filesystem::path& path);

// Throws Error if `path` is neither a folder nor a zip archive.
std::unique_ptr<ArrayStore> OpenArrayStore(const std::filesystem::path& path);

// The same from the bytes of an archive; `path` is used in messages only.
std::unique_ptr<ArrayStore> OpenArchive(std::string bytes, const std::filesystem::path& path);

}  // namespace vgtw
