// SPDX-License-Identifier: BSD-3-Clause
#include "scene/memory.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <string>
#include <sys/resource.h>

#include <unistd.h>

namespace vgtw {
namespace {

// First number of a file, or -1: "max" and missing files are no limit.
int64_t ReadNumber(const char* path) {
  std::ifstream file(path);
  int64_t number = -1;
  return file >> number ? number : -1;
}

// A line of the kernel's summary, such as "MemAvailable:"; -1 where it has none.
int64_t OfMachine(std::string_view key) {
  std::ifstream file("/proc/meminfo");
  std::string line;
  while (std::getline(file, line)) {
    if (line.starts_with(key)) return std::atoll(line.c_str() + key.size()) * 1024;
  }
  return -1;
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

}  // namespace

int64_t TotalMemory() { return std::max<int64_t>(0, OfMachine("MemTotal:")); }

int64_t AvailableMemory() {
  const int64_t of_machine = OfMachine("MemAvailable:");
  return of_machine < 0 ? FreeOfControlGroup() : std::min(of_machine, FreeOfControlGroup());
}

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
