// SPDX-License-Identifier: BSD-3-Clause
#include "tests/bridge/numpy_files.h"

#include "scene/files.h"
#include "scene/image_io.h"

#include <stdexcept>

#include <zip.h>

namespace vgtw {

std::string NpyWithHeader(const std::string& header, const std::string& values, int version) {
  constexpr size_t kAlignment = 64;
  const size_t prefix = version == 1 ? 10 : 12;
  std::string padded = header;
  while ((prefix + padded.size() + 1) % kAlignment != 0) padded += ' ';
  padded += '\n';
  std::string bytes = "\x93NUMPY";
  bytes += static_cast<char>(version);
  bytes += '\0';
  for (size_t i = 0; i < prefix - 8; ++i) {
    bytes += static_cast<char>((padded.size() >> (8 * i)) & 0xff);
  }
  return bytes + padded + values;
}

std::string NpyBytes(const std::string& descr,
                     const std::string& shape,
                     const std::string& values,
                     bool is_fortran_order,
                     int version) {
  const std::string header = "{'descr': '" + descr +
                             "', 'fortran_order': " + (is_fortran_order ? "True" : "False") +
                             ", 'shape': " + shape + ", }";
  return NpyWithHeader(header, values, version);
}

void WriteNpz(const std::filesystem::path& path,
              const std::map<std::string, std::string>& npy_by_key,
              bool compressed) {
  int code = 0;
  zip_t* zip = zip_open(path.c_str(), ZIP_CREATE | ZIP_TRUNCATE, &code);
  if (zip == nullptr) throw std::runtime_error("zip_open");
  for (const auto& [key, npy] : npy_by_key) {
    zip_source_t* source = zip_source_buffer(zip, npy.data(), npy.size(), 0);
    const zip_int64_t idx = zip_file_add(zip, (key + ".npy").c_str(), source, 0);
    const auto method = compressed ? ZIP_CM_DEFLATE : ZIP_CM_STORE;
    if (idx < 0 || zip_set_file_compression(zip, static_cast<zip_uint64_t>(idx), method, 0) != 0) {
      throw std::runtime_error("zip_file_add");
    }
  }
  if (zip_close(zip) != 0) throw std::runtime_error("zip_close");
}

void WritePhotos(const std::filesystem::path& folder,
                 const std::vector<std::string>& names,
                 int width,
                 int height) {
  for (const std::string& name : names) {
    WriteImage(folder / name, RgbImage(width, height, {90, 120, 150}));
  }
}

}  // namespace vgtw
