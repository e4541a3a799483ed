// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// NumPy's .npy format, versions 1 to 3: little-endian numbers, C or Fortran order. Arrays of
// objects (pickles) and of other types are refused with Error.
enum class NpyType { kBool, kUint8, kInt32, kInt64, kFloat16, kFloat32, kFloat64 };

struct NpyHeader {
  NpyType type = NpyType::kFloat32;
  bool is_fortran_order = false;
  std::vector<uint64_t> shape;  // empty for a scalar
  uint64_t data_offset = 0;     // bytes before the first value
};

// Bytes of one value.
size_t NpyItemSize(NpyType type);

// Product of the shape; it cannot overflow in a header that ParseNpyHeader has accepted.
uint64_t NumValues(const NpyHeader& header);

// "(20, 392, 518)", as NumPy prints it.
std::string ShapeText(const std::vector<uint64_t>& shape);

// Bytes at the front of a file that are certain to hold its header: the limit of this reader.
inline constexpr size_t kMaxNpyHeaderBytes = 1 << 16;

// `front` is the beginning of a file of `file_size` bytes, at least min(file_size,
// kMaxNpyHeaderBytes) of them. `origin` names the file in messages. Throws Error if the header is
// damaged, of another type, or tells of more values than the file can hold.
NpyHeader ParseNpyHeader(std::span<const std::byte> front,
                         uint64_t file_size,
                         const std::string& origin);

// Reads an array front to back, so that a stack of thousands of maps needs the memory of one.
// Values come in C order whatever the file's order (a Fortran array is held in memory as a whole
// and may have at most 2^28 values).
class NpyReader {
 public:
  // Fills the span and returns the number of bytes it got; fewer only at the end of the file.
  using Source = std::function<size_t(std::span<std::byte>)>;

  // Throws Error as ParseNpyHeader does.
  NpyReader(Source source, uint64_t file_size, std::string origin);

  const std::string& origin() const { return origin_; }
  const std::vector<uint64_t>& shape() const { return header_.shape; }
  bool IsFloatingPoint() const;

  // The next values.size() values. Throws Error if the file ends before, std::invalid_argument if
  // the array has fewer left.
  void Read(std::span<float> values);
  void Read(std::span<double> values);

 private:
  template <typename T>
  void ReadAs(std::span<T> values);
  void ReadBytes(std::span<std::byte> bytes);
  void LoadFortran();

  Source source_;
  std::string origin_;
  NpyHeader header_;
  std::vector<std::byte> front_;  // read with the header, not yet consumed
  size_t front_begin_ = 0;
  uint64_t num_left_ = 0;
  std::vector<std::byte> buffer_;
};

}  // namespace vgtw
