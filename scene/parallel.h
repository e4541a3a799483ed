// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/progress.h"

#include <cstdint>
#include <functional>

namespace vgtw {

// Threads to use for a request; 0 or less = all cores.
int ResolveThreads(int num_threads);

// Calls work(i) for i in [0, n) on `num_threads` threads (see ResolveThreads). An exception stops
// further work; rethrown in the caller is that of the lowest i, so that the same faults give the
// same message on any number of threads. `progress` is called under a lock.
void ParallelFor(int64_t n,
                 int num_threads,
                 const std::function<void(int64_t)>& work,
                 const ProgressCallback& progress = {});

}  // namespace vgtw
