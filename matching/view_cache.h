// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/matching_view.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <future>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>

namespace vgtw {

// Views that are ready for matching, the least recently used of which leave memory when all
// together take more than `max_memory` bytes. Any number of threads may call Get.
class ViewCache {
 public:
  using View = std::shared_ptr<const MatchingView>;
  // `load` is called by one thread at a time.
  ViewCache(std::function<ViewFeatures(size_t view_idx)> load, int64_t max_memory);

  // Rethrows what `load` throws.
  View Get(size_t view_idx);

 private:
  struct Entry {
    std::shared_future<View> view;
    std::list<size_t>::iterator use;
    int64_t num_bytes = 0;  // 0 while it is being loaded
  };
  View Load(size_t view_idx);
  void Trim();

  const std::function<ViewFeatures(size_t)> load_;
  const int64_t max_memory_;
  std::mutex load_mutex_;
  std::mutex mutex_;  // of what follows
  std::unordered_map<size_t, Entry> entries_;
  std::list<size_t> uses_;  // the most recent first
  int64_t num_bytes_ = 0;
};

}  // namespace vgtw
