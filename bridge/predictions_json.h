// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/view.h"

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// predictions.json: what a predictions folder says about all views, without their maps.
struct PredictionsIndex {
  struct Entry {
    View view;
    std::string file;  // of its maps, relative to the folder
  };
  std::string producer;
  std::string weights_hash;
  std::vector<Entry> entries;  // sorted byte-wise by view.name
};

// Throws Error, naming the view, for anything but format version 1 as FormatPredictionsIndex writes
// it: types, sizes above 65536 pixels, unsafe or repeated names, and FindFault(ViewPrediction).
PredictionsIndex ParsePredictionsIndex(std::string_view text, const std::filesystem::path& path);

// Numbers are written so that they are read back exactly. Camera ids and prior flags are not part
// of the format. Throws Error if a string is not UTF-8.
std::string FormatPredictionsIndex(const PredictionsIndex& index);

}  // namespace vgtw
