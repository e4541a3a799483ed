// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/json_fields.h"

#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vgtw {
namespace {

using Json = nlohmann::json;

constexpr uint64_t kMaxSize = 65536;  // pixels

std::string Quote(const Json& value) {
  if (value.is_structured()) {
    return std::string("an ") + value.type_name() + " of " + std::to_string(value.size());
  }
  return Printable(value.dump());
}

}  // namespace

JsonFields::JsonFields(const Json& object,
                       std::string who,
                       const std::filesystem::path& path,
                       std::string_view hint)
    : object_(object), who_(std::move(who)), path_(path), hint_(hint) {
  if (!object.is_object()) Fail(std::string("is a JSON ") + object.type_name(), "an object");
}

void JsonFields::Fail(const std::string& found, const std::string& expected) const {
  vgtw::Fail(path_, who_ + " " + found, expected, hint_);
}

void JsonFields::FailType(const char* key, const Json& value, const std::string& expected) const {
  Fail(std::string("has '") + key + "' = " + Quote(value), expected);
}

const Json& JsonFields::At(const char* key) const {
  const auto found = object_.find(key);
  if (found == object_.end()) Fail(std::string("lacks '") + key + "'", "it");
  return *found;
}

const Json& JsonFields::Array(const char* key) const {
  const Json& array = At(key);
  if (!array.is_array()) FailType(key, array, "an array");
  return array;
}

JsonFields JsonFields::Object(const char* key) const {
  return {At(key), who_ + " '" + key + "'", path_, hint_};
}

std::string JsonFields::String(const char* key) const {
  const Json& value = At(key);
  if (!value.is_string()) FailType(key, value, "a string");
  return value.get<std::string>();
}

std::vector<std::string> JsonFields::Strings(const char* key) const {
  const Json& array = Array(key);
  std::vector<std::string> values;
  for (const Json& element : array) {
    if (!element.is_string()) FailType(key, element, "an array of strings");
    values.push_back(element.get<std::string>());
  }
  return values;
}

bool JsonFields::Bool(const char* key) const {
  const Json& value = At(key);
  if (!value.is_boolean()) FailType(key, value, "true or false");
  return value.get<bool>();
}

uint64_t JsonFields::Unsigned(const char* key, uint64_t max) const {
  const Json& value = At(key);
  if (!value.is_number_unsigned() || value.get<uint64_t>() > max) {
    FailType(key, value, "a whole number from 0 to " + std::to_string(max));
  }
  return value.get<uint64_t>();
}

double JsonFields::Number(const char* key) const {
  const Json& value = At(key);
  if (!value.is_number() || !std::isfinite(value.get<double>())) {
    FailType(key, value, "a finite number");
  }
  return value.get<double>();
}

std::vector<double> JsonFields::Numbers(const char* key, size_t size) const {
  return NumbersOf(key, At(key), size);
}

std::vector<double> JsonFields::NumbersOf(const char* key, const Json& array, size_t size) const {
  const std::string expected =
      "an array of " + (size == 0 ? "" : std::to_string(size) + " ") + "finite numbers";
  if (!array.is_array() || (size != 0 && array.size() != size)) FailType(key, array, expected);
  std::vector<double> values;
  for (const Json& element : array) {
    if (!element.is_number()) FailType(key, element, expected);
    values.push_back(element.get<double>());
    if (!std::isfinite(values.back())) FailType(key, element, expected);
  }
  return values;
}

std::array<uint64_t, 2> JsonFields::Size(const char* key) const {
  const Json& array = At(key);
  const auto is_size = [](const Json& value) {
    return value.is_number_unsigned() && value.get<uint64_t>() <= kMaxSize;
  };
  if (!array.is_array() || array.size() != 2 || !std::all_of(array.begin(), array.end(), is_size)) {
    FailType(key, array, "[width, height] in pixels up to " + std::to_string(kMaxSize));
  }
  return {array[0].get<uint64_t>(), array[1].get<uint64_t>()};
}

void JsonFields::CheckFormat(std::string_view format, int version) const {
  const Json& found_format = At("format");
  const Json& found_version = At("version");
  if (found_format == format && found_version == version) return;
  Fail("has format " + Printable(found_format.dump()) + ", version " +
           Printable(found_version.dump()),
       "format \"" + std::string(format) + "\", version " + std::to_string(version));
}

Json ParseJsonText(std::string_view text,
                   const std::filesystem::path& path,
                   std::string_view hint) {
  try {
    return Json::parse(text);
  } catch (const Json::exception& exception) {
    Fail(path, Printable(exception.what()), "JSON, in which NaN and Infinity do not exist", hint);
  }
}

}  // namespace vgtw
