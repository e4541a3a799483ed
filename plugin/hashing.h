// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/progress.h"

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// SHA-256 as 64 lower-case hexadecimal digits.
std::string HashText(std::string_view text);
std::string HashFile(const std::filesystem::path& path);

// One hash over names and contents of files, `names` relative to `folder`, in the given order.
std::string HashFiles(const std::filesystem::path& folder,
                      const std::vector<std::string>& names,
                      int num_threads,
                      const ProgressCallback& progress = {});

// Every regular file below a folder, relative, sorted byte-wise.
std::vector<std::string> ListFiles(const std::filesystem::path& folder);

}  // namespace vgtw
