// SPDX-License-Identifier: BSD-3-Clause
#include "matching/extract.h"

#include "matching/ordered_sink.h"
#include "scene/error.h"
#include "scene/memory.h"
#include "scene/parallel.h"

#include <condition_variable>
#include <mutex>
#include <string>
#include <utility>

#include <opencv2/core/utility.hpp>

namespace vgtw {
namespace {

class WithoutOpenCvThreads {
 public:
  WithoutOpenCvThreads() : num_threads_(cv::getNumThreads()) { cv::setNumThreads(1); }
  ~WithoutOpenCvThreads() { cv::setNumThreads(num_threads_); }
  WithoutOpenCvThreads(const WithoutOpenCvThreads&) = delete;
  WithoutOpenCvThreads& operator=(const WithoutOpenCvThreads&) = delete;

 private:
  int num_threads_;
};

// Lets photos in by their order, so that a large one is not overtaken for ever, while memory lasts.
class MemoryGate {
 public:
  explicit MemoryGate(int64_t max_bytes) : max_bytes_(max_bytes) {}

  // False if the work was given up.
  bool Enter(size_t photo_idx, int64_t bytes) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] {
      return is_given_up_ ||
             (photo_idx == next_idx_ && (used_bytes_ == 0 || used_bytes_ + bytes <= max_bytes_));
    });
    if (is_given_up_) return false;
    ++next_idx_;
    used_bytes_ += bytes;
    changed_.notify_all();
    return true;
  }

  void Leave(int64_t bytes) {
    const std::lock_guard lock(mutex_);
    used_bytes_ -= bytes;
    changed_.notify_all();
  }

  void GiveUp() {
    const std::lock_guard lock(mutex_);
    is_given_up_ = true;
    changed_.notify_all();
  }

 private:
  const int64_t max_bytes_;
  std::mutex mutex_;
  std::condition_variable changed_;
  size_t next_idx_ = 0;
  int64_t used_bytes_ = 0;
  bool is_given_up_ = false;
};

}  // namespace

void ExtractOptions::Check() const {
  sift.Check();
  VGTW_CHECK(max_memory >= 0,
             "ExtractOptions::max_memory = " + std::to_string(max_memory) + ", must be >= 0");
}

void ExtractAll(size_t num_photos,
                const PhotoLoader& load,
                const FeatureSink& sink,
                const ExtractOptions& options,
                const ProgressCallback& progress) {
  options.Check();
  const WithoutOpenCvThreads without_threads;
  MemoryGate gate(options.max_memory > 0 ? options.max_memory : AvailableMemory() / 2);
  OrderedSink<Features> ordered_sink(sink);
  const auto extract = [&](size_t photo_idx) {
    MaskedPhoto photo = load(photo_idx);
    const ImageSize size{static_cast<uint64_t>(photo.image.width()),
                         static_cast<uint64_t>(photo.image.height())};
    const int64_t bytes = SiftMemory(size, options.sift);
    if (!gate.Enter(photo_idx, bytes)) return;
    Features features = ExtractSift(photo.image, photo.static_mask, options.sift);
    photo = {};
    gate.Leave(bytes);
    ordered_sink.Put(photo_idx, std::move(features));
  };
  const auto work = [&](int64_t i) {
    try {
      extract(static_cast<size_t>(i));
    } catch (...) {
      gate.GiveUp();
      throw;
    }
  };
  ParallelFor(static_cast<int64_t>(num_photos), options.num_threads, work, progress);
}

}  // namespace vgtw
