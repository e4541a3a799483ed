// SPDX-License-Identifier: BSD-3-Clause
// Numbers of 16 bits, as bits. Conversions to them round to nearest, ties to even.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include <Eigen/Core>

namespace vgtw {

// IEEE 754 half precision.
inline float FloatOfHalf(uint16_t bits) {
  return static_cast<float>(Eigen::numext::bit_cast<Eigen::half>(bits));
}
inline uint16_t HalfOfFloat(float value) {
  return Eigen::numext::bit_cast<uint16_t>(static_cast<Eigen::half>(value));
}

// bfloat16: the upper half of a float.
inline float FloatOfBrain(uint16_t bits) { return std::bit_cast<float>(uint32_t{bits} << 16); }
inline uint16_t BrainOfFloat(float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  constexpr uint32_t kQuietBit = 0x40;  // a NaN whose upper half is empty must not become infinite
  if (std::isnan(value)) return static_cast<uint16_t>(bits >> 16 | kQuietBit);
  return static_cast<uint16_t>((bits + 0x7fff + (bits >> 16 & 1)) >> 16);
}

}  // namespace vgtw
