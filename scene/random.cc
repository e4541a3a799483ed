// SPDX-License-Identifier: BSD-3-Clause
#include "scene/random.h"

#include <cmath>
#include <numbers>

namespace vgtw {
namespace {

constexpr uint64_t kGoldenGamma = 0x9e3779b97f4a7c15u;

// Finaliser of SplitMix64 (Steele, Lea, Flood, Fast splittable pseudorandom number generators,
// 2014).
uint64_t Mix(uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

}  // namespace

uint64_t HashKey(std::initializer_list<uint64_t> values) {
  uint64_t key = kGoldenGamma;
  for (const uint64_t value : values) key = Mix(key + kGoldenGamma * (value + 1));
  return key;
}

uint64_t RandomStream::Bits() {
  state_ += kGoldenGamma;
  return Mix(state_);
}

double RandomStream::Uniform() { return static_cast<double>(Bits() >> 11) * 0x1.0p-53; }

double RandomStream::Uniform(double min, double max) { return min + (max - min) * Uniform(); }

size_t RandomStream::Index(size_t n) {
  return static_cast<size_t>(Uniform() * static_cast<double>(n));
}

bool RandomStream::Chance(double probability) { return Uniform() < probability; }

double RandomStream::Normal() {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform()));
  return radius * std::cos(2.0 * std::numbers::pi * Uniform());
}

Eigen::Vector3d RandomStream::NormalVector() {
  const double x = Normal();
  const double y = Normal();
  return {x, y, Normal()};
}

Eigen::Quaterniond RandomStream::Rotation() {
  const double w = Normal();
  const Eigen::Vector3d xyz = NormalVector();
  return Eigen::Quaterniond(w, xyz.x(), xyz.y(), xyz.z()).normalized();
}

}  // namespace vgtw
