// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <utility>

namespace vgtw {

// Hands over with 0, 1, 2, ... what comes in any order and from any thread. After an exception of
// `take` nothing more is handed over.
template <typename T>
class OrderedSink {
 public:
  using Take = std::function<void(size_t idx, T value)>;
  // `take` must outlive the sink; it is called by one thread at a time.
  explicit OrderedSink(const Take& take) : take_(take) {}

  void Put(size_t idx, T value) {
    const std::lock_guard lock(mutex_);
    waiting_.emplace(idx, std::move(value));
    while (!waiting_.empty() && waiting_.begin()->first == next_idx_) {
      T next = std::move(waiting_.begin()->second);
      waiting_.erase(waiting_.begin());
      take_(next_idx_, std::move(next));
      ++next_idx_;  // not after an exception
    }
  }

 private:
  const Take& take_;
  std::mutex mutex_;
  size_t next_idx_ = 0;
  std::map<size_t, T> waiting_;
};

}  // namespace vgtw
