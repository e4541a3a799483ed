// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <vector>

namespace vgtw {

// A map of COLMAP's dense workspace, read by its documentation and not by what wrote it.
struct ColmapMap {
  int width = 0;
  int height = 0;
  int num_channels = 0;
  std::vector<float> values;

  float At(int x, int y, int channel) const {
    return values.at(static_cast<size_t>((channel * height + y) * width + x));
  }
};

inline ColmapMap ReadColmapMap(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  ColmapMap map;
  char separator = 0;
  file >> map.width >> separator >> map.height >> separator >> map.num_channels >> separator;
  if (!file || separator != '&') throw std::runtime_error("no map: " + path.string());
  map.values.resize(static_cast<size_t>(map.width * map.height * map.num_channels));
  file.read(reinterpret_cast<char*>(map.values.data()),
            static_cast<std::streamsize>(map.values.size() * sizeof(float)));
  if (!file || file.peek() != EOF) throw std::runtime_error("wrong size: " + path.string());
  return map;
}

}  // namespace vgtw
