// SPDX-License-Identifier: BSD-3-Clause
// A whole model: the first byte chooses binary or text; then cameras, images, points3D, rigs and
// frames, each behind its length. The last two are files only if one of them has bytes.
#include "bridge/colmap_model.h"
#include "tests/fuzz/fuzzing.h"

#include <array>
#include <fstream>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  if (size == 0) return 0;
  static constexpr std::array<const char*, 5> kNames = {
      "cameras", "images", "points3D", "rigs", "frames"};
  const bool is_text = data[0] == 't';
  const std::vector<std::string> files = SplitInput(data + 1, size - 1, kNames.size());
  const size_t num_files = files[3].empty() && files[4].empty() ? 3 : 5;
  const std::filesystem::path folder = ScratchFolder() / "model";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directory(folder);
  for (size_t i = 0; i < num_files; ++i) {
    std::ofstream(folder / (std::string(kNames[i]) + (is_text ? ".txt" : ".bin")), std::ios::binary)
        << files[i];
  }
  return OnlyErrors([&] {
    // What was accepted is written, and read back to the same bytes.
    const std::filesystem::path first = ScratchFolder() / "first";
    const std::filesystem::path second = ScratchFolder() / "second";
    WriteModel(ReadModel(folder), first, {ModelFormat::kBinary, true});
    WriteModel(ReadModel(first), second, {ModelFormat::kBinary, true});
    for (const char* name : kNames) {
      const std::string file = std::string(name) + ".bin";
      Require(std::filesystem::exists(first / file) == std::filesystem::exists(second / file));
      if (!std::filesystem::exists(first / file)) continue;
      Require(ReadFile(first / file) == ReadFile(second / file));
    }
  });
}
