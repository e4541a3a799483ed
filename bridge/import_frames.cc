// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_frames.h"

#include "bridge/import_arrays.h"
#include "bridge/npz.h"
#include "scene/error.h"
#include "scene/image_io.h"

#include <optional>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

void CheckSize(const fs::path& path, const MapSize& found, const MapSize& expected) {
  if (found == expected) return;
  const auto text = [](const MapSize& map) {
    return std::to_string(map.width) + "x" + std::to_string(map.height);
  };
  Fail(path,
       "has " + text(found) + " pixels",
       text(expected) + " like the frame's other maps or intrinsics");
}

}  // namespace

fs::path FrameFiles::Path(size_t frame) const {
  std::string number = std::to_string(frame);
  const auto width = static_cast<size_t>(num_digits);
  if (number.size() < width) number.insert(0, width - number.size(), '0');
  return folder / (prefix + number + extension);
}

bool FrameFiles::HaveAll(size_t num_frames) const {
  std::optional<size_t> missing;
  size_t num_found = 0;
  for (size_t i = 0; i < num_frames; ++i) {
    if (fs::is_regular_file(Path(i))) {
      ++num_found;
    } else if (!missing) {
      missing = i;
    }
  }
  if (missing && num_found > 0) {
    Fail(Path(*missing), "is missing", "such a file for each frame, or for none");
  }
  return num_found > 0;
}

std::vector<MapSize> FrameSizes(const FrameFiles& files, size_t num_frames) {
  std::vector<MapSize> sizes;
  for (size_t i = 0; i < num_frames; ++i) {
    sizes.push_back(SingleMapSize(OpenNpyFile(files.Path(i))));
  }
  return sizes;
}

Grid<float> ReadFrameMap(const fs::path& path, const MapSize& size) {
  NpyReader reader = OpenNpyFile(path);
  CheckSize(path, SingleMapSize(reader), size);
  return ReadSingleMap(reader);
}

DistractorMask ReadFrameMask(const fs::path& path, const MapSize& size) {
  const GrayImage values = ReadMaskValues(path);
  CheckSize(path, {values.width(), values.height()}, size);
  DistractorMask mask(values.width(), values.height());
  for (size_t i = 0; i < values.size(); ++i) {
    mask.data()[i] = static_cast<float>(values.data()[i]) / 255.0f;
  }
  return mask;
}

}  // namespace vgtw
