// SPDX-License-Identifier: BSD-3-Clause
// scene_stream_benchmark [NUM_SCENES [WIDTH [TEXTURE_FOLDER]]]
// What a training scene of SceneStream costs: time of one thread on the processor, by view, with
// all defaults but the width (112 pixels; height 3/4 of it).
#include "scene/error.h"
#include "scene/scene_stream.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>

namespace vgtw {
namespace {

// Not of the wall: other programs may be running.
double ProcessorMs() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double DistractorPixels(const SceneSample& sample) {
  double sum = 0.0;
  for (const DistractorMask& distractor : sample.distractor) {
    for (const float probability : distractor.data()) sum += probability;
  }
  return sum;
}

void Run(const SceneStreamOptions& options, uint64_t num_scenes) {
  const SceneStream stream(options);
  stream.Sample(0);  // makes the tables
  size_t num_views = 0;
  double distractor_pixels = 0.0;
  double slowest_ms = 0.0;
  const double begin_ms = ProcessorMs();
  for (uint64_t idx = 0; idx < num_scenes; ++idx) {
    const double scene_begin_ms = ProcessorMs();
    const SceneSample sample = stream.Sample(idx);
    const auto count = static_cast<double>(sample.images.size());
    slowest_ms = std::max(slowest_ms, (ProcessorMs() - scene_begin_ms) / count);
    num_views += sample.images.size();
    distractor_pixels += DistractorPixels(sample);
  }
  const double num_pixels = static_cast<double>(num_views) * options.width * options.height;
  std::printf(
      "%zu views of %d x %d pixels in %zu scenes: %.2f ms of one core a view "
      "(slowest scene %.2f), distractors on %.1f %% of the pixels\n",
      num_views,
      options.width,
      options.height,
      static_cast<size_t>(num_scenes),
      (ProcessorMs() - begin_ms) / static_cast<double>(num_views),
      slowest_ms,
      100.0 * distractor_pixels / num_pixels);
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  vgtw::SceneStreamOptions options;
  const uint64_t num_scenes = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 200;
  if (argc > 2) options.width = std::atoi(argv[2]);
  options.height = options.width * 3 / 4;
  if (argc > 3) options.texture_folder = argv[3];
  try {
    vgtw::Run(options, std::max<uint64_t>(num_scenes, 1));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
