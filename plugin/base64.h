// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace vgtw {

// RFC 4648, with padding.
std::string Base64(std::span<const std::byte> bytes);

}  // namespace vgtw
