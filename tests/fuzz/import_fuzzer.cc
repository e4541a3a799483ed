// SPDX-License-Identifier: BSD-3-Clause
// The arrays of a system for one photo of 16 x 16 pixels, as a folder of .npy (in an archive few
// mutations would outlive the checksums), from recognition to predictions that can be read back.
#include "bridge/import.h"
#include "bridge/predictions.h"
#include "scene/image_io.h"
#include "tests/fuzz/fuzzing.h"

#include <fstream>
#include <map>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  static const std::map<char, std::vector<std::string>> keys_by_system = {
      {'d', {"poses", "focals", "pps", "depthmaps", "confs", "pts3d"}},
      {'f',
       {"estimated_poses_c2w",
        "estimated_focals",
        "local_aligned_to_global_pointmaps",
        "local_confidence_maps"}},
      {'m', {"extrinsic", "intrinsic", "world_points", "depth", "conf", "final_mask"}},
      {'p', {"camera_poses", "points", "conf"}},
      {'v', {"extrinsic", "intrinsic", "depth", "depth_conf", "depth_mask"}}};
  static const std::filesystem::path photos = [] {
    std::filesystem::create_directories(ScratchFolder() / "photos");
    WriteImage(ScratchFolder() / "photos/a.png", RgbImage(16, 16));
    return ScratchFolder() / "photos";
  }();
  if (size == 0 || !keys_by_system.contains(static_cast<char>(data[0]))) return 0;
  const std::vector<std::string>& keys = keys_by_system.at(static_cast<char>(data[0]));
  const std::vector<std::string> parts = SplitInput(data + 1, size - 1, keys.size());
  const std::filesystem::path arrays = ScratchFolder() / "arrays";
  std::filesystem::remove_all(arrays);
  std::filesystem::create_directories(arrays);
  for (size_t i = 0; i < keys.size(); ++i) {
    if (!parts[i].empty()) std::ofstream(arrays / (keys[i] + ".npy"), std::ios::binary) << parts[i];
  }
  return OnlyErrors([&] {
    const std::filesystem::path out = ScratchFolder() / "out";
    const ImportSummary summary = Import(arrays, photos, out, {.overwrite = true});
    Require(summary.num_views == 1 && ReadPrediction(out).views.size() == 1);
  });
}
