// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/progress.h"

#include <cstdint>
#include <functional>

namespace vgtw {

// Threads to use for a request; 0 or less = all cores.
int ResolveThreads(int num_threads);

// Calls work(i) for i in [0, n) on `num_threads` threads (see ResolveThreads). The first exception
// stops further work and is rethrown in the caller. `progress` is called under a lock.
void ParallelFor(int64_t n,
                 int num_threads,
                 const std::function<void(int64_t)>& work,
                 const ProgressCallback& progress = {});

}  // namespace vgtw
