// SPDX-License-Identifier: BSD-3-Clause
#include "network/checkpoint.h"

#include "network/checkpoint_torch.h"
#include "network/pickle_tensors.h"
#include "network/torch_archive.h"
#include "scene/error.h"
#include "scene/random.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using Json = nlohmann::json;

constexpr size_t kMaxIndexBytes = size_t{16} << 20;
constexpr std::string_view kDownloadAgain = "download the index and all of its shards again";

std::string_view AsText(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// The header of a safetensors file begins after its length, which the file can hold.
bool BeginsLikeSafetensors(std::span<const std::byte> bytes) {
  uint64_t length = 0;
  if (bytes.size() < sizeof(length) + 2) return false;
  std::memcpy(&length, bytes.data(), sizeof(length));
  return length <= bytes.size() && bytes[sizeof(length)] == std::byte{'{'};
}

bool BeginsLikeJson(std::span<const std::byte> bytes) {
  const std::string_view text = AsText(bytes);
  const size_t first = text.find_first_not_of(" \t\r\n");
  return first != std::string_view::npos && text[first] == '{';
}

[[noreturn]] void FailUnknown(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  const bool is_pointer = AsText(bytes).starts_with("version https://git-lfs");
  Fail(path,
       is_pointer ? "is a Git LFS pointer and not the file itself"
                  : "is of no known format (" + std::to_string(bytes.size()) + " bytes)",
       ".safetensors, its .index.json, or what torch.save writes",
       is_pointer ? "fetch it with `git lfs pull`" : "copy or download it again");
}

// Tensor name -> name of the file beside the index.
std::map<std::string, std::string> ParseWeightMap(std::span<const std::byte> bytes,
                                                  const std::filesystem::path& path) {
  if (bytes.size() > kMaxIndexBytes) {
    Fail(path, "has " + std::to_string(bytes.size()) + " bytes", "an index of at most 16 MiB");
  }
  Json weight_map;
  try {
    weight_map = Json::parse(AsText(bytes)).value("weight_map", Json());
  } catch (const Json::exception& exception) {
    Fail(path, Printable(exception.what()), "the JSON of a sharded checkpoint", kDownloadAgain);
  }
  const auto is_file = [](const Json& value) {
    return value.is_string() && IsSafeRelativeName(value.get_ref<const std::string&>());
  };
  if (!weight_map.is_object() || !std::all_of(weight_map.begin(), weight_map.end(), is_file)) {
    Fail(path, "has no usable weight_map", "names of files beside the index, by tensor");
  }
  return weight_map.get<std::map<std::string, std::string>>();
}

// Drops what all names begin with and no network's own names do.
void DropCommonPrefixes(StoredTensors& tensors) {
  const auto is_common = [&](const std::string& key) {
    return std::all_of(tensors.begin(), tensors.end(), [&](const auto& named) {
      return named.first.size() > key.size() + 1 && named.first.starts_with(key + ".");
    });
  };
  const auto& keys = WeightKeys();
  while (!tensors.empty()) {
    const auto key = std::find_if(keys.begin(), keys.end(), is_common);
    if (key == keys.end()) return;
    StoredTensors renamed;
    for (auto& [name, tensor] : tensors) {
      renamed.emplace(name.substr(key->size() + 1), std::move(tensor));
    }
    tensors = std::move(renamed);
  }
}

}  // namespace

Checkpoint::Checkpoint(const std::filesystem::path& path) {
  const auto bytes = Map(path);
  if (BeginsLikeTorchFile(bytes)) {
    TorchWeights weights = ParseTorchWeights(bytes, path);
    tensors_ = std::move(weights.tensors);
    copies_ = std::move(weights.copies);
    format_ = "torch.save";
  } else if (BeginsLikeSafetensors(bytes)) {
    ReadSafetensors(bytes, path);
  } else if (BeginsLikeJson(bytes)) {
    ReadShards(bytes, path);
  } else {
    FailUnknown(bytes, path);
  }
  if (tensors_.empty()) Fail(path, "holds no tensors", "the weights of a network");
  DropCommonPrefixes(tensors_);
  if (tensors_.contains("__metadata__")) {
    Fail(path, "has a tensor '__metadata__'", "other names, as safetensors reserves this one");
  }
}

void Checkpoint::Overlay(Checkpoint other) {
  std::move(other.files_.begin(), other.files_.end(), std::back_inserter(files_));
  std::move(other.copies_.begin(), other.copies_.end(), std::back_inserter(copies_));
  other.tensors_.merge(tensors_);  // keeps what it has
  tensors_ = std::move(other.tensors_);
  other.metadata_.merge(metadata_);
  metadata_ = std::move(other.metadata_);
  format_ += " + " + other.format_;
}

void Checkpoint::ReleasePages() const {
  for (const auto& file : files_) file->ReleasePages();
}

void PageLimiter::AddRead(size_t num_bytes) {
  constexpr size_t kMaxBytes = size_t{256} << 20;
  const size_t before = num_bytes_.fetch_add(num_bytes);
  if (before / kMaxBytes != (before + num_bytes) / kMaxBytes) checkpoint_.ReleasePages();
}

std::span<const std::byte> Checkpoint::Map(const std::filesystem::path& path) {
  files_.push_back(std::make_unique<MappedFile>(path));
  return files_.back()->bytes();
}

void Checkpoint::ReadSafetensors(std::span<const std::byte> bytes,
                                 const std::filesystem::path& path) {
  SafetensorsContent content = ParseSafetensors(bytes, path);
  tensors_ = std::move(content.tensors);
  metadata_ = std::move(content.metadata);
  format_ = "safetensors";
}

void Checkpoint::ReadShards(std::span<const std::byte> index, const std::filesystem::path& path) {
  const auto file_by_tensor = ParseWeightMap(index, path);
  std::map<std::string, std::vector<std::string>> tensors_by_file;
  for (const auto& [tensor, file] : file_by_tensor) tensors_by_file[file].push_back(tensor);
  for (const auto& [file, expected] : tensors_by_file) {
    const auto shard_path = path.parent_path() / file;
    SafetensorsContent shard = ParseSafetensors(Map(shard_path), shard_path);
    for (auto& [name, tensor] : shard.tensors) {
      const auto place = file_by_tensor.find(name);
      if (place == file_by_tensor.end() || place->second != file) {
        Fail(shard_path,
             "holds the tensor '" + Printable(name) + "'",
             place == file_by_tensor.end() ? "only those of the index"
                                           : "it in " + Printable(place->second) + " alone",
             kDownloadAgain);
      }
      tensors_.emplace(name, std::move(tensor));
    }
    for (const std::string& name : expected) {
      if (tensors_.contains(name)) continue;
      Fail(shard_path, "lacks the tensor '" + Printable(name) + "'", "it there", kDownloadAgain);
    }
    metadata_.merge(shard.metadata);
  }
  format_ = "safetensors, " + std::to_string(tensors_by_file.size()) +
            (tensors_by_file.size() == 1 ? " shard" : " shards");
}

uint64_t Fingerprint(const Checkpoint& checkpoint) {
  constexpr size_t kBytesOfEach = 4096;
  uint64_t key = 0;
  const auto add = [&key](std::span<const std::byte> bytes) {
    key = HashKey({key, bytes.size()});
    for (size_t i = 0; i < bytes.size(); i += sizeof(uint64_t)) {
      uint64_t word = 0;
      std::memcpy(&word, bytes.data() + i, std::min(sizeof(word), bytes.size() - i));
      key = HashKey({key, word});
    }
  };
  for (const auto& [name, tensor] : checkpoint.tensors()) {
    add(std::as_bytes(std::span(name)));
    add(std::as_bytes(std::span(tensor.shape)));
    key = HashKey({key, static_cast<uint64_t>(tensor.type)});
    add(tensor.bytes.first(std::min(kBytesOfEach, tensor.bytes.size())));
  }
  return key;
}

}  // namespace vgtw
