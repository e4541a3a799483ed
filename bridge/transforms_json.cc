// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/transforms_json.h"

#include "scene/error.h"

#include <optional>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using Json = nlohmann::json;

constexpr char kExpectedMatrix[] = "the 4x4 matrix of a rigid motion, camera to world";

Json ParseJson(std::string_view text, const std::string& origin) {
  try {
    return Json::parse(text);
  } catch (const Json::exception& exception) {
    Fail(origin, Printable(exception.what()), "JSON, in which NaN and Infinity do not exist");
  }
}

// The member of an object; null where there is none.
const Json& MemberOf(const Json& object, const char* key) {
  static const Json null;
  if (!object.is_object()) return null;
  const auto found = object.find(key);
  return found == object.end() ? null : *found;
}

// nullopt unless it is an array of 3 or 4 rows of 4 numbers, the fourth 0 0 0 1.
std::optional<Eigen::Matrix<double, 3, 4>> ParseMatrix(const Json& rows) {
  if (!rows.is_array() || (rows.size() != 3 && rows.size() != 4)) return std::nullopt;
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  for (size_t row = 0; row < rows.size(); ++row) {
    if (!rows[row].is_array() || rows[row].size() != 4) return std::nullopt;
    for (size_t column = 0; column < 4; ++column) {
      const Json& value = rows[row][column];
      if (!value.is_number()) return std::nullopt;
      matrix(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) =
          value.get<double>();
    }
  }
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) return std::nullopt;
  return matrix.topRows<3>();
}

TransformsFrame ParseFrame(const Json& frame, size_t idx, const std::string& origin) {
  const Json& file_path = MemberOf(frame, "file_path");
  if (!file_path.is_string()) {
    Fail(origin, "frame " + std::to_string(idx) + " has no \"file_path\"", "a string");
  }
  TransformsFrame read;
  read.name = file_path.get<std::string>();
  if (read.name.starts_with("./")) read.name.erase(0, 2);
  auto matrix = ParseMatrix(MemberOf(frame, "transform_matrix"));
  if (matrix) matrix->middleCols<2>(1) *= -1.0;
  const auto world_from_cam = matrix ? RigidFromMatrix(*matrix) : std::nullopt;
  if (!world_from_cam) {
    Fail(origin, "\"transform_matrix\" of '" + Printable(read.name) + "' is none", kExpectedMatrix);
  }
  read.world_from_cam = *world_from_cam;
  return read;
}

}  // namespace

std::vector<TransformsFrame> ParseTransformsJson(std::string_view text, const std::string& origin) {
  const Json json = ParseJson(text, origin);
  const Json& frames = MemberOf(json, "frames");
  if (!frames.is_array() || frames.empty()) {
    Fail(origin, "has no \"frames\"", "an array with a frame for each photo");
  }
  std::vector<TransformsFrame> read;
  for (const Json& frame : frames) read.push_back(ParseFrame(frame, read.size(), origin));
  return read;
}

}  // namespace vgtw
