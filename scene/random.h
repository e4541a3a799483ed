// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace vgtw {

// Random numbers that are the same with every compiler, standard library and number of threads
// (the distributions of <random> are not), up to the last bit of std::log and std::cos: a stream is
// a function of its key alone. The order of draws counts, and C++ leaves the order of arguments and
// operands open: draw in separate statements or in a braced list.

// A well mixed 64-bit key of a sequence of numbers, for instance {seed, kind, view_idx}.
uint64_t HashKey(std::initializer_list<uint64_t> values);

class RandomStream {
 public:
  explicit RandomStream(uint64_t key) : state_(key) {}

  uint64_t Bits();
  double Uniform();                        // [0, 1)
  double Uniform(double min, double max);  // [min, max)
  size_t Index(size_t n);                  // [0, n), n >= 1
  bool Chance(double probability);         // true with this probability
  double Normal();                         // mean 0, sigma 1 (Box-Muller)
  Eigen::Vector3d NormalVector();          // three independent Normal()
  Eigen::Quaterniond Rotation();           // uniform on SO(3)

 private:
  uint64_t state_;
};

}  // namespace vgtw
