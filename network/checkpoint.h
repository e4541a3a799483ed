// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/files.h"
#include "scene/safetensors.h"

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace vgtw {

// The weights of a network as a file holds them, told by its content and not by its extension:
// .safetensors; model.safetensors.index.json, whose shards lie beside it; or what torch.save wrote
// since torch 1.6 (.pt, .pth, .bin). Nothing in the file is ever executed.
//
// Names are those of the state dict: "module.", "model." and the like are dropped where all names
// begin so. Of a training checkpoint only the weights are read (network/pickle_tensors.h).
// Tensors are mapped, not read; only tensors of torch.save that are not row-major are copied, to at
// most as many bytes as the file has. While this object lives the spans stay valid, and the files
// must not shrink.
class Checkpoint {
 public:
  // Throws Error if a file is unreadable, in another format, damaged, holds no tensors or refers to
  // code; if shards lie outside the folder, or they and the index disagree.
  explicit Checkpoint(const std::filesystem::path& path);

  const StoredTensors& tensors() const { return tensors_; }
  const std::map<std::string, std::string>& metadata() const { return metadata_; }
  // "safetensors", "safetensors, 3 shards" or "torch.save"; " + " between those of overlays.
  const std::string& format() const { return format_; }

  // Takes the tensors and metadata of `other`; where both have a name, what `other` has stays.
  void Overlay(Checkpoint other);

  // Gives back the memory of what was read of the files so far; what is touched again is read
  // again.
  void ReleasePages() const;

 private:
  std::span<const std::byte> Map(const std::filesystem::path& path);
  void ReadSafetensors(std::span<const std::byte> bytes, const std::filesystem::path& path);
  void ReadShards(std::span<const std::byte> index, const std::filesystem::path& path);

  std::vector<std::unique_ptr<MappedFile>> files_;
  std::vector<std::vector<std::byte>> copies_;
  StoredTensors tensors_;
  std::map<std::string, std::string> metadata_;
  std::string format_;
};

// A number that tells checkpoints of different weights apart: of the names, types and shapes of all
// tensors, and of 4 KiB of each.
uint64_t Fingerprint(const Checkpoint& checkpoint);

// Keeps the memory small of who reads all of a checkpoint once, with any number of threads.
class PageLimiter {
 public:
  explicit PageLimiter(const Checkpoint& checkpoint) : checkpoint_(checkpoint) {}
  // To be called after `num_bytes` were read: releases all pages whenever these are 256 MiB.
  void AddRead(size_t num_bytes);

 private:
  const Checkpoint& checkpoint_;
  std::atomic<size_t> num_bytes_ = 0;
};

}  // namespace vgtw
