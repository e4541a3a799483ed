// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"

#include <cstddef>
#include <optional>
#include <span>

namespace vgtw {

// The pixels of the PNG that most masks are: gray of 8 or 1 bits, neither interlaced nor with a
// transparent colour; 1 reads as 255. Several times faster than a decoder of every PNG. nullopt for
// any other file and for one with any fault, including a CRC: what is wrong with it, and how much
// of it can be forgiven, is for that decoder to say. The bytes are foreign.
std::optional<GrayImage> DecodeGrayPng(std::span<const std::byte> file);

}  // namespace vgtw
