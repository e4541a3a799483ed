// SPDX-License-Identifier: BSD-3-Clause
#include "network/predict_memory.h"

#include "network/config.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <string>
#include <sys/resource.h>

#include <unistd.h>

namespace vgtw {
namespace {

constexpr int64_t kFloatBytes = 4;

// First number of a file, or -1: "max" and missing files are no limit.
int64_t ReadNumber(const char* path) {
  std::ifstream file(path);
  int64_t number = -1;
  return file >> number ? number : -1;
}

int64_t FreeOfMachine() {
  std::ifstream file("/proc/meminfo");
  std::string line;
  while (std::getline(file, line)) {
    constexpr std::string_view kKey = "MemAvailable:";
    if (line.starts_with(kKey)) return std::atoll(line.c_str() + kKey.size()) * 1024;
  }
  return std::numeric_limits<int64_t>::max();
}

// Of the control group that a container sees as its root, version 2 or 1. Pages of files count as
// used there although they can be given back, so that this errs to the safe side.
int64_t FreeOfControlGroup() {
  constexpr const char* kFiles[][2] = {
      {"/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"},
      {"/sys/fs/cgroup/memory/memory.limit_in_bytes",
       "/sys/fs/cgroup/memory/memory.usage_in_bytes"}};
  for (const auto& [limit_file, usage_file] : kFiles) {
    const int64_t limit = ReadNumber(limit_file);
    const int64_t usage = ReadNumber(usage_file);
    if (limit >= 0 && usage >= 0) return std::max<int64_t>(0, limit - usage);
  }
  return std::numeric_limits<int64_t>::max();
}

// Width of a network's tokens, how many layers its heads read, and the features of its dense heads.
struct Sizes {
  int64_t dim = 0;
  int64_t num_kept_layers = 0;
  int64_t num_features = 0;
};

Sizes SizesOf(const NetworkDescription& description) {
  if (const auto* vggt = std::get_if<VggtConfig>(&description.config)) {
    return {vggt->dim, 4, vggt->dpt.num_features};
  }
  const auto& pi3 = std::get<Pi3Config>(description.config);
  if (!pi3.has_distractor_head) return {pi3.encoder.dim, 1, 0};
  return {pi3.encoder.dim, 5, pi3.dpt.num_features};
}

}  // namespace

MemoryEstimate EstimateMemory(const NetworkDescription& description, int width, int height) {
  const Sizes sizes = SizesOf(description);
  const int64_t num_pixels = static_cast<int64_t>(width) * height;
  const int64_t num_tokens = num_pixels / (kPatchSize * kPatchSize) + kNumSpecialTokens;
  constexpr int64_t kBlockWidths = 15;
  const int64_t widths_per_view = 2 * sizes.num_kept_layers + 2 + kBlockWidths;
  constexpr int64_t kImageCopies = 3;
  MemoryEstimate estimate;
  estimate.per_view =
      kFloatBytes * (widths_per_view * sizes.dim * num_tokens + kImageCopies * 3 * num_pixels);
  constexpr int64_t kMapsPerFeature = 4;
  estimate.fixed = kFloatBytes * num_pixels * kMapsPerFeature * (sizes.num_features + 32);
  return estimate;
}

int64_t AvailableMemory() { return std::min(FreeOfMachine(), FreeOfControlGroup()); }

int64_t PeakMemory() {
  rusage usage = {};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<int64_t>(usage.ru_maxrss) * 1024;
}

int64_t ResidentMemory() {
  std::ifstream file("/proc/self/statm");
  int64_t num_pages = 0;
  int64_t num_resident_pages = 0;
  file >> num_pages >> num_resident_pages;
  return num_resident_pages * ::sysconf(_SC_PAGESIZE);
}

}  // namespace vgtw
