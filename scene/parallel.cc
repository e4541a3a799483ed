// SPDX-License-Identifier: BSD-3-Clause
#include "scene/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace vgtw {

int ResolveThreads(int num_threads) {
  if (num_threads > 0) return num_threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void ParallelFor(int64_t n,
                 int num_threads,
                 const std::function<void(int64_t)>& work,
                 const ProgressCallback& progress) {
  std::atomic<int64_t> next = 0;
  std::mutex mutex;
  int64_t num_done = 0;
  std::exception_ptr exception;
  int64_t exception_idx = n;
  const auto run = [&] {
    for (int64_t i = next++; i < n; i = next++) {
      try {
        work(i);
        const std::lock_guard lock(mutex);
        ++num_done;
        if (progress) progress(num_done, n);
      } catch (...) {
        next = n;
        const std::lock_guard lock(mutex);
        // Indices are begun in order: all below the lowest that fails have been.
        if (i >= exception_idx) continue;
        exception_idx = i;
        exception = std::current_exception();
      }
    }
  };
  const auto num_workers =
      static_cast<size_t>(std::clamp<int64_t>(n, 1, ResolveThreads(num_threads)));
  std::vector<std::thread> threads;
  threads.reserve(num_workers);
  try {
    for (size_t i = 1; i < num_workers; ++i) threads.emplace_back(run);
  } catch (const std::system_error&) {
    // The system gives no more threads; those that run do all the work.
  }
  run();
  for (std::thread& thread : threads) thread.join();
  if (exception) std::rethrow_exception(exception);
}

}  // namespace vgtw
