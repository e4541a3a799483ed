// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <span>
#include <string>

namespace vgtw {

// What torch.save writes since 1.6: a zip archive whose entries, all stored without compression
// below one folder of any name, are data.pkl (which tensors there are) and data/<key> (their
// bytes). Spans point into the bytes of the file; no two overlap.
struct TorchArchive {
  std::span<const std::byte> pickle;
  std::map<std::string, std::span<const std::byte>, std::less<>> storages;  // by <key>
};

// Whether the bytes begin like a zip archive or like a pickle, torch's older format.
bool BeginsLikeTorchFile(std::span<const std::byte> bytes);

// Reads the directory at the end (zip64 where present) and checks every entry against the file.
// `path` is for messages. Throws Error for truncated or damaged archives, for entries that are
// compressed, encrypted, overlapping or there twice, for big-endian data, and for files that
// are TorchScript or older than torch 1.6. Checksums are not verified: that would read all data.
TorchArchive ParseTorchArchive(std::span<const std::byte> bytes, const std::filesystem::path& path);

}  // namespace vgtw
