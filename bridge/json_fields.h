// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

// Access to one object of a JSON file that this project defines: whatever is not as expected throws
// Error "<path>: <who> <found>, expected <expected>; <hint>".
class JsonFields {
 public:
  // `object` and `path` must outlive it.
  JsonFields(const nlohmann::json& object,
             std::string who,
             const std::filesystem::path& path,
             std::string_view hint);

  [[noreturn]] void Fail(const std::string& found, const std::string& expected) const;

  bool Has(const char* key) const { return object_.contains(key); }
  const nlohmann::json& At(const char* key) const;
  const nlohmann::json& Array(const char* key) const;
  JsonFields Object(const char* key) const;

  std::string String(const char* key) const;
  std::vector<std::string> Strings(const char* key) const;
  bool Bool(const char* key) const;
  uint64_t Unsigned(const char* key, uint64_t max) const;
  // Finite numbers; `size` 0 = any number of them.
  double Number(const char* key) const;
  std::vector<double> Numbers(const char* key, size_t size) const;
  std::vector<double> NumbersOf(const char* key, const nlohmann::json& array, size_t size) const;
  // [width, height] in pixels, up to 65536.
  std::array<uint64_t, 2> Size(const char* key) const;

  // Throws unless "format" and "version" are these.
  void CheckFormat(std::string_view format, int version) const;

 private:
  [[noreturn]] void FailType(const char* key,
                             const nlohmann::json& value,
                             const std::string& expected) const;

  const nlohmann::json& object_;
  std::string who_;
  const std::filesystem::path& path_;
  std::string_view hint_;
};

// Throws Error where the text is no JSON.
nlohmann::json ParseJsonText(std::string_view text,
                             const std::filesystem::path& path,
                             std::string_view hint);

}  // namespace vgtw
