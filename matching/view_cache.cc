// SPDX-License-Identifier: BSD-3-Clause
#include "matching/view_cache.h"

#include <exception>
#include <utility>

namespace vgtw {
namespace {

// Besides the descriptors a feature takes pixel, ray, scale, depth, confidence, background
// distance, its places in the grid and by scale.
constexpr int64_t kBytesPerFeature = 48;

int64_t NumBytes(const ViewFeatures& features) {
  return static_cast<int64_t>(features.descriptors.data.size()) +
         kBytesPerFeature * static_cast<int64_t>(features.size());
}

}  // namespace

ViewCache::ViewCache(std::function<ViewFeatures(size_t view_idx)> load, int64_t max_memory)
    : load_(std::move(load)), max_memory_(max_memory) {}

ViewCache::View ViewCache::Get(size_t view_idx) {
  std::promise<View> promise;
  {
    std::unique_lock lock(mutex_);
    const auto found = entries_.find(view_idx);
    if (found != entries_.end()) {
      uses_.splice(uses_.begin(), uses_, found->second.use);
      const std::shared_future<View> view = found->second.view;
      lock.unlock();
      return view.get();
    }
    uses_.push_front(view_idx);
    entries_[view_idx] = {promise.get_future().share(), uses_.begin(), 0};
  }
  try {
    const View view = Load(view_idx);
    promise.set_value(view);
    const std::lock_guard lock(mutex_);
    Entry& entry = entries_.at(view_idx);
    entry.num_bytes = NumBytes(view->features());
    num_bytes_ += entry.num_bytes;
    Trim();
    return view;
  } catch (...) {
    promise.set_exception(std::current_exception());
    throw;
  }
}

ViewCache::View ViewCache::Load(size_t view_idx) {
  ViewFeatures features;
  {
    const std::lock_guard lock(load_mutex_);
    features = load_(view_idx);
  }
  return std::make_shared<const MatchingView>(std::move(features));
}

void ViewCache::Trim() {
  for (auto use = uses_.end(); use != uses_.begin() && num_bytes_ > max_memory_;) {
    --use;
    const auto entry = entries_.find(*use);
    if (entry->second.num_bytes == 0) continue;  // somebody is loading it
    num_bytes_ -= entry->second.num_bytes;
    entries_.erase(entry);
    use = uses_.erase(use);
  }
}

}  // namespace vgtw
