// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace vgtw {

// An .npy file of version 1 to 3 around raw values, with the header as NumPy pads it (to 64 bytes).
std::string NpyBytes(const std::string& descr,
                     const std::string& shape,
                     const std::string& values,
                     bool is_fortran_order = false,
                     int version = 1);

// The same around any header text.
std::string NpyWithHeader(const std::string& header, const std::string& values, int version = 1);

template <typename T>
std::string RawBytes(const std::vector<T>& values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

// '<f4' in C order.
inline std::string NpyFloats(const std::string& shape, const std::vector<float>& values) {
  return NpyBytes("<f4", shape, RawBytes(values));
}
inline std::string NpyDoubles(const std::string& shape, const std::vector<double>& values) {
  return NpyBytes("<f8", shape, RawBytes(values));
}

// An archive as numpy.savez (stored) or savez_compressed writes it: "<key>.npy" per array.
void WriteNpz(const std::filesystem::path& path,
              const std::map<std::string, std::string>& npy_by_key,
              bool compressed = false);

// Plain photos of one size.
void WritePhotos(const std::filesystem::path& folder,
                 const std::vector<std::string>& names,
                 int width,
                 int height);

}  // namespace vgtw
