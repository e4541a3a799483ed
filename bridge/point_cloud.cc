// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/point_cloud.h"

#include "bridge/byte_reader.h"
#include "bridge/surface_cloud.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

namespace vgtw {
namespace {

constexpr std::string_view kBlanks = " \t\r\n";

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

struct PlyTypeName {
  std::string_view name;
  PlyType type;
};
constexpr std::array<PlyTypeName, 16> kPlyTypes = {{
    {"char", PlyType::kInt8},
    {"int8", PlyType::kInt8},
    {"uchar", PlyType::kUint8},
    {"uint8", PlyType::kUint8},
    {"short", PlyType::kInt16},
    {"int16", PlyType::kInt16},
    {"ushort", PlyType::kUint16},
    {"uint16", PlyType::kUint16},
    {"int", PlyType::kInt32},
    {"int32", PlyType::kInt32},
    {"uint", PlyType::kUint32},
    {"uint32", PlyType::kUint32},
    {"float", PlyType::kFloat},
    {"float32", PlyType::kFloat},
    {"double", PlyType::kDouble},
    {"float64", PlyType::kDouble},
}};

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat;
  std::optional<PlyType> list_count_type;  // set for lists
};

struct PlyElement {
  std::string name;
  uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  bool is_ascii = false;
  std::vector<PlyElement> elements;
};

// Cuts the next word off `text`; "" at its end.
std::string_view NextWord(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  const size_t length = std::min(text.find_first_of(kBlanks), text.size());
  const std::string_view word = text.substr(0, length);
  text.remove_prefix(length);
  return word;
}

template <typename T>
std::optional<T> ToNumber(std::string_view word) {
  T value{};
  const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (code != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

// Takes the header off the front of `text`.
class PlyHeaderParser {
 public:
  PlyHeaderParser(std::string_view& text, const std::filesystem::path& path)
      : text_(text), path_(path) {}

  PlyHeader Parse() {
    if (NextLine() != "ply") Fail(path_, "does not begin with ply", "a PLY file");
    while (true) {
      std::string_view line = NextLine();
      const std::string_view keyword = NextWord(line);
      if (keyword == "end_header") break;
      if (keyword == "format") {
        ParseFormat(line);
      } else if (keyword == "element") {
        ParseElement(line);
      } else if (keyword == "property") {
        ParseProperty(line);
      } else if (keyword != "comment" && keyword != "obj_info") {
        Fail(path_, "has '" + Printable(keyword) + "' in its header", "a PLY header");
      }
    }
    if (!has_format_) Fail(path_, "names no format in its header", "a PLY header");
    return std::move(header_);
  }

 private:
  std::string_view NextLine() {
    const size_t length = text_.find('\n');
    if (length == std::string_view::npos) {
      Fail(path_, "ends inside its header", "a complete PLY header", "copy the file again");
    }
    std::string_view line = text_.substr(0, length);
    text_.remove_prefix(length + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
  }

  void ParseFormat(std::string_view line) {
    const std::string_view format = NextWord(line);
    if (format != "ascii" && format != "binary_little_endian") {
      Fail(path_, "has format '" + Printable(format) + "'", "ascii or binary_little_endian");
    }
    header_.is_ascii = format == "ascii";
    has_format_ = true;
  }

  void ParseElement(std::string_view line) {
    PlyElement element;
    element.name = NextWord(line);
    const auto count = ToNumber<uint64_t>(NextWord(line));
    if (!count) Fail(path_, "has no count for element " + Printable(element.name), "one");
    element.count = *count;
    header_.elements.push_back(std::move(element));
  }

  void ParseProperty(std::string_view line) {
    if (header_.elements.empty()) Fail(path_, "has a property before any element", "a PLY header");
    PlyProperty property;
    std::string_view type_name = NextWord(line);
    if (type_name == "list") {
      property.list_count_type = ParseType(NextWord(line));
      type_name = NextWord(line);
    }
    property.type = ParseType(type_name);
    property.name = NextWord(line);
    header_.elements.back().properties.push_back(std::move(property));
  }

  PlyType ParseType(std::string_view name) const {
    const auto found = std::ranges::find(kPlyTypes, name, &PlyTypeName::name);
    if (found == kPlyTypes.end()) {
      Fail(path_, "has a property of type '" + Printable(name) + "'", "a type of PLY");
    }
    return found->type;
  }

  std::string_view& text_;
  const std::filesystem::path& path_;
  PlyHeader header_;
  bool has_format_ = false;
};

// The values behind the header, one by one, in either format.
class PlyValues {
 public:
  PlyValues(std::string_view body, bool is_ascii, const std::filesystem::path& path)
      : text_(body),
        reader_(std::as_bytes(std::span(body)), path),
        is_ascii_(is_ascii),
        path_(path) {}

  double Read(PlyType type) { return is_ascii_ ? ReadWord() : ReadBinary(type); }

 private:
  double ReadWord() {
    const std::string_view word = NextWord(text_);
    const auto value = ToNumber<double>(word);
    if (!value) {
      Fail(path_,
           word.empty() ? "ends early" : "has '" + Printable(word) + "' among its values",
           "as many numbers as its header announces",
           "copy the file again");
    }
    return *value;
  }

  double ReadBinary(PlyType type) {
    switch (type) {
      case PlyType::kInt8:
        return reader_.Read<int8_t>();
      case PlyType::kUint8:
        return reader_.Read<uint8_t>();
      case PlyType::kInt16:
        return reader_.Read<int16_t>();
      case PlyType::kUint16:
        return reader_.Read<uint16_t>();
      case PlyType::kInt32:
        return reader_.Read<int32_t>();
      case PlyType::kUint32:
        return reader_.Read<uint32_t>();
      case PlyType::kFloat:
        return static_cast<double>(reader_.Read<float>());
      case PlyType::kDouble:
        return reader_.Read<double>();
    }
    throw std::logic_error("unreachable");
  }

  std::string_view text_;
  ByteReader reader_;
  bool is_ascii_;
  const std::filesystem::path& path_;
};

// Where a vertex's properties lie among its values; -1 = absent.
struct VertexLayout {
  std::array<int, 3> xyz = {-1, -1, -1};
  std::array<int, 3> rgb = {-1, -1, -1};

  bool HasPosition() const { return std::ranges::find(xyz, -1) == xyz.end(); }
  bool HasColor() const { return std::ranges::find(rgb, -1) == rgb.end(); }
};

VertexLayout LayoutOf(const PlyElement& vertex) {
  constexpr std::array<std::string_view, 3> kPosition = {"x", "y", "z"};
  constexpr std::array<std::string_view, 3> kColor = {"red", "green", "blue"};
  VertexLayout layout;
  for (size_t i = 0; i < vertex.properties.size(); ++i) {
    const PlyProperty& property = vertex.properties[i];
    if (property.list_count_type) continue;
    for (size_t axis = 0; axis < 3; ++axis) {
      if (property.name == kPosition[axis]) layout.xyz[axis] = static_cast<int>(i);
      if (property.name == kColor[axis] && property.type == PlyType::kUint8) {
        layout.rgb[axis] = static_cast<int>(i);
      }
    }
  }
  return layout;
}

// One record of an element; the value of a list is left at 0.
void ReadRecord(const PlyElement& element,
                PlyValues& values,
                const std::filesystem::path& path,
                std::vector<double>& record) {
  record.assign(element.properties.size(), 0.0);
  for (size_t i = 0; i < record.size(); ++i) {
    const PlyProperty& property = element.properties[i];
    if (!property.list_count_type) {
      record[i] = values.Read(property.type);
      continue;
    }
    const double size = values.Read(*property.list_count_type);
    if (!(size >= 0.0)) Fail(path, "has a list of " + std::to_string(size), "a size >= 0");
    for (double k = 0.0; k < size; ++k) values.Read(property.type);
  }
}

std::optional<ColoredPoint> PointOf(const std::vector<double>& record, const VertexLayout& layout) {
  ColoredPoint point;
  for (size_t axis = 0; axis < 3; ++axis) {
    point.xyz[static_cast<int>(axis)] =
        static_cast<float>(record[static_cast<size_t>(layout.xyz[axis])]);
    if (!layout.HasColor()) continue;
    const double channel = record[static_cast<size_t>(layout.rgb[axis])];
    point.rgb[axis] = static_cast<uint8_t>(std::clamp(channel, 0.0, 255.0));
  }
  if (!point.xyz.allFinite()) return std::nullopt;
  return point;
}

}  // namespace

std::vector<ColoredPoint> PointsOf(const Reconstruction& reconstruction) {
  std::vector<ColoredPoint> points;
  points.reserve(reconstruction.points3D.size());
  for (const auto& [point3D_id, point] : reconstruction.points3D) {
    points.push_back({point.xyz.cast<float>(), point.rgb});
  }
  return points;
}

void WritePly(const std::filesystem::path& path, const std::vector<ColoredPoint>& points) {
  WritePly(path, SurfaceCloud{.points = points, .normals = {}, .scalars = {}});
}

std::vector<ColoredPoint> ParsePly(std::span<const std::byte> bytes,
                                   const std::filesystem::path& path) {
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const PlyHeader header = PlyHeaderParser(text, path).Parse();
  PlyValues values(text, header.is_ascii, path);
  std::vector<double> record;
  for (const PlyElement& element : header.elements) {
    const bool is_vertex = element.name == "vertex";
    const VertexLayout layout = LayoutOf(element);
    if (is_vertex && !layout.HasPosition()) break;
    std::vector<ColoredPoint> points;
    if (is_vertex) points.reserve(std::min<uint64_t>(element.count, text.size() / 3));
    // Records without a property take no bytes, so that any number of them may be announced.
    const uint64_t num_records = element.properties.empty() ? 0 : element.count;
    for (uint64_t i = 0; i < num_records; ++i) {
      ReadRecord(element, values, path, record);
      if (!is_vertex) continue;
      if (const auto point = PointOf(record, layout)) points.push_back(*point);
    }
    if (is_vertex) return points;
  }
  Fail(path, "has no element vertex with x y z", "a point cloud");
}

std::vector<ColoredPoint> ReadPly(const std::filesystem::path& path) {
  const MappedFile file(path);
  return ParsePly(file.bytes(), path);
}

void WritePcd(const std::filesystem::path& path, const std::vector<ColoredPoint>& points) {
  WritePcd(path, SurfaceCloud{.points = points, .normals = {}, .scalars = {}});
}

}  // namespace vgtw
