// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/trajectory_text.h"

#include "scene/error.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include <Eigen/Core>

namespace vgtw {
namespace {

constexpr std::string_view kSpace = " \t\r,";
constexpr size_t kNumTumNumbers = 7;      // tx ty tz qx qy qz qw
constexpr size_t kNumKittiNumbers = 12;   // [R|t], row-major
constexpr size_t kNumMatrixNumbers = 16;  // a 4x4 matrix
constexpr char kTumLine[] = "\"timestamp tx ty tz qx qy qz qw\" with a unit quaternion";
constexpr char kKittiLine[] = "twelve numbers, [R|t] of world_from_cam row by row";

std::string_view Trim(std::string_view text) {
  const size_t begin = text.find_first_not_of(kSpace);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kSpace) - begin + 1);
}

// Takes the last `numbers.size()` words of the line into `numbers`; returns what stands before
// them, or nullopt if there are fewer or one is no finite number.
std::optional<std::string_view> SplitOffNumbers(std::string_view line, std::span<double> numbers) {
  std::string_view rest = Trim(line);
  for (size_t i = numbers.size(); i-- > 0;) {
    const size_t space = rest.find_last_of(kSpace);
    const size_t begin = space == std::string_view::npos ? 0 : space + 1;
    const std::optional<double> number = ParseTimestamp(rest.substr(begin));
    if (!number) return std::nullopt;
    numbers[i] = *number;
    rest = Trim(rest.substr(0, begin));
  }
  return rest;
}

std::optional<TumPose> ParseTumLine(std::string_view line) {
  std::array<double, kNumTumNumbers> numbers{};
  const std::optional<std::string_view> label = SplitOffNumbers(line, numbers);
  if (!label) return std::nullopt;
  const auto& [tx, ty, tz, qx, qy, qz, qw] = numbers;
  const Eigen::Quaterniond rotation(qw, qx, qy, qz);
  constexpr double kMaxNormError = 1e-2;
  if (label->empty() || !(std::abs(rotation.norm() - 1.0) < kMaxNormError)) return std::nullopt;
  return TumPose{std::string(*label), {rotation.normalized(), {tx, ty, tz}}};
}

std::optional<Rigid3d> ParseKittiLine(std::string_view line) {
  std::array<double, kNumKittiNumbers> numbers{};
  const std::optional<std::string_view> rest = SplitOffNumbers(line, numbers);
  if (!rest || !rest->empty()) return std::nullopt;
  return RigidFromMatrix(
      Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(numbers.data()));
}

std::optional<std::vector<double>> ParseNumberLine(std::string_view line, size_t num_columns) {
  std::vector<double> numbers(num_columns);
  const std::optional<std::string_view> rest = SplitOffNumbers(line, numbers);
  if (!rest || !rest->empty()) return std::nullopt;
  return numbers;
}

// A line that is neither empty nor a comment.
bool HoldsPose(std::string_view line) {
  const std::string_view trimmed = Trim(line);
  return !trimmed.empty() && !trimmed.starts_with('#');
}

// Takes the next line that holds a pose off the front of `text`; "" at its end.
std::string_view NextLine(std::string_view& text, size_t& line_number) {
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    ++line_number;
    if (HoldsPose(line)) return line;
  }
  return {};
}

// `parse` gives nullopt for a damaged line.
template <typename Parse>
auto ParseLines(std::string_view text,
                const std::string& origin,
                const std::string& expected,
                const Parse& parse) {
  std::vector<typename decltype(parse(text))::value_type> poses;
  size_t line_number = 0;
  for (auto line = NextLine(text, line_number); !line.empty(); line = NextLine(text, line_number)) {
    auto pose = parse(line);
    if (!pose) {
      Fail(origin,
           "line " + std::to_string(line_number) + " is '" + Printable(line) + "'",
           expected);
    }
    poses.push_back(*std::move(pose));
  }
  if (poses.empty()) Fail(origin, "holds no numbers", "lines of " + expected);
  return poses;
}

}  // namespace

std::optional<double> ParseTimestamp(std::string_view token) {
  if (token.starts_with('+')) token.remove_prefix(1);
  double value = 0.0;
  const auto [end, code] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (code != std::errc() || end != token.data() + token.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::optional<TrajectoryFormat> FindTrajectoryFormat(std::string_view text) {
  size_t line_number = 0;
  const std::string_view line = NextLine(text, line_number);
  // A matrix of world_from_cam ends in "0 0 0 1", which is a unit quaternion.
  if (ParseNumberLine(line, kNumMatrixNumbers)) return std::nullopt;
  // Twelve numbers could also be a name of five and a pose, which nobody writes.
  if (ParseKittiLine(line)) return TrajectoryFormat::kKitti;
  if (ParseTumLine(line)) return TrajectoryFormat::kTum;
  return std::nullopt;
}

std::vector<TumPose> ParseTumTrajectory(std::string_view text, const std::string& origin) {
  return ParseLines(text, origin, kTumLine, ParseTumLine);
}

std::vector<Rigid3d> ParseKittiTrajectory(std::string_view text, const std::string& origin) {
  return ParseLines(text, origin, kKittiLine, ParseKittiLine);
}

std::vector<std::vector<double>> ParseNumberRows(std::string_view text,
                                                 size_t num_columns,
                                                 const std::string& origin) {
  VGTW_CHECK(num_columns >= 1 && num_columns <= kNumMatrixNumbers, "columns");
  return ParseLines(
      text, origin, std::to_string(num_columns) + " numbers", [&](std::string_view line) {
        return ParseNumberLine(line, num_columns);
      });
}

}  // namespace vgtw
