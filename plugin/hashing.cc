// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/hashing.h"

#include "scene/error.h"
#include "scene/files.h"
#include "scene/parallel.h"

#include <algorithm>
#include <memory>
#include <span>

#include <openssl/evp.h>

namespace vgtw {
namespace {

std::string Sha256(std::span<const std::byte> bytes) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int length = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest, &length, EVP_sha256(), nullptr) != 1) {
    throw std::runtime_error("SHA-256 is not available in OpenSSL");
  }
  constexpr const char* kDigits = "0123456789abcdef";
  std::string text;
  for (unsigned int i = 0; i < length; ++i) {
    text += kDigits[digest[i] >> 4];
    text += kDigits[digest[i] & 15];
  }
  return text;
}

}  // namespace

std::string HashText(std::string_view text) { return Sha256(std::as_bytes(std::span(text))); }

std::string HashFile(const std::filesystem::path& path) { return Sha256(MappedFile(path).bytes()); }

std::string HashFiles(const std::filesystem::path& folder,
                      const std::vector<std::string>& names,
                      int num_threads,
                      const ProgressCallback& progress) {
  std::vector<std::string> hashes(names.size());
  ParallelFor(
      static_cast<int64_t>(names.size()),
      num_threads,
      [&](int64_t i) {
        const auto idx = static_cast<size_t>(i);
        hashes[idx] = HashFile(folder / names[idx]);
      },
      progress);
  std::string listing;
  for (size_t i = 0; i < names.size(); ++i) listing += hashes[i] + " " + names[i] + "\n";
  return HashText(listing);
}

std::vector<std::string> ListFiles(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) names.push_back(entry.path().lexically_relative(folder).string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace vgtw
