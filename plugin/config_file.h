// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

// The flags that a file gives, as words of a command line ("--depth", "6"): one line `name = value`
// each, '#' begins a comment, lists are [a, b]. Those that `arguments` have, too, are left out: the
// command line wins. Throws Error if the file is missing or a line is none of these.
std::vector<std::string> FlagsOfConfig(const std::filesystem::path& path,
                                       const std::vector<std::string>& arguments);

// The file that "--config FILE" or "--config=FILE" names; "" if none.
std::filesystem::path FindConfig(const std::vector<std::string>& arguments);

}  // namespace vgtw
