// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model_text.h"

#include "bridge/colmap_model_records.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <system_error>
#include <type_traits>
#include <utility>

namespace vgtw {
namespace {

constexpr std::string_view kBlanks = " \t\r";

// The lines of a text with their numbers.
class Lines {
 public:
  explicit Lines(std::string_view text) : rest_(text) {}

  size_t number() const { return number_; }

  std::optional<std::string_view> Next() {
    if (rest_.empty()) return std::nullopt;
    const size_t length = std::min(rest_.find('\n'), rest_.size());
    const std::string_view line = rest_.substr(0, length);
    rest_.remove_prefix(std::min(length + 1, rest_.size()));
    ++number_;
    return line;
  }

  // The next line that is neither blank nor a comment.
  std::optional<std::string_view> NextRecord() {
    while (const auto line = Next()) {
      const size_t begin = line->find_first_not_of(kBlanks);
      if (begin != std::string_view::npos && (*line)[begin] != '#') return line;
    }
    return std::nullopt;
  }

 private:
  std::string_view rest_;
  size_t number_ = 0;
};

// The words of one line; what is missing or no number throws Error with the line.
class Fields {
 public:
  Fields(std::string_view line, const RecordSource& source) : rest_(line), source_(source) {
    SkipBlanks();
  }

  bool AtEnd() const { return rest_.empty(); }

  std::string_view Word(std::string_view what) {
    if (AtEnd()) source_.Fail("ends", std::string(what));
    const size_t length = std::min(rest_.find_first_of(kBlanks), rest_.size());
    const std::string_view word = rest_.substr(0, length);
    rest_.remove_prefix(length);
    SkipBlanks();
    return word;
  }

  template <typename T>
  T Number(std::string_view what) {
    const std::string_view word = Word(what);
    T value{};
    const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (code != std::errc() || end != word.data() + word.size()) {
      source_.Fail("has '" + Printable(word) + "'", what);
    }
    return value;
  }

  void ExpectEnd() const {
    if (!AtEnd()) source_.Fail("goes on with '" + Printable(rest_) + "'", "its end");
  }

 private:
  void SkipBlanks() {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(kBlanks), rest_.size()));
  }

  std::string_view rest_;
  const RecordSource& source_;
};

Rigid3d ParsePose(Fields& fields, const RecordSource& source, const std::string& owner) {
  PoseValues values;
  for (double& value : values) value = fields.Number<double>("a pose qw qx qy qz tx ty tz");
  return PoseFromValues(source, owner, values);
}

SensorId ParseSensorId(Fields& fields, const RecordSource& source) {
  const std::string_view type = fields.Word("a sensor type");
  if (type != "CAMERA" && type != "IMU") {
    source.Fail("has '" + Printable(type) + "'", "a sensor type CAMERA or IMU");
  }
  return {type == "CAMERA" ? 0 : 1, fields.Number<uint32_t>("a sensor id")};
}

Image ParseImage(std::string_view line, const RecordSource& source) {
  Fields fields(line, source);
  Image image;
  image.image_id = fields.Number<uint32_t>("an image id");
  image.cam_from_world = ParsePose(fields, source, "image " + std::to_string(image.image_id));
  image.camera_id = fields.Number<uint32_t>("a camera id");
  image.name = fields.Word("the image's name");
  if (!fields.AtEnd()) {
    source.Fail("goes on after the name " + Printable(image.name),
                "a name without spaces",
                "text models cannot hold such names: use the binary format");
  }
  return image;
}

std::vector<Point2D> ParsePoints2D(std::string_view line, const RecordSource& source) {
  constexpr std::string_view kWhat =
      "points2D as x y point3D_id triples (each image takes two lines, the second may be empty)";
  Fields fields(line, source);
  std::vector<Point2D> points2D;
  while (!fields.AtEnd()) {
    Point2D& point2D = points2D.emplace_back();
    point2D.xy.x() = fields.Number<double>(kWhat);
    point2D.xy.y() = fields.Number<double>(kWhat);
    // -1 = none; kInvalidPoint3DId has the same bits.
    point2D.point3D_id = static_cast<Point3DId>(fields.Number<int64_t>(kWhat));
  }
  points2D.shrink_to_fit();
  return points2D;
}

Rig ParseRig(std::string_view line, const RecordSource& source) {
  Fields fields(line, source);
  Rig rig;
  rig.rig_id = fields.Number<uint32_t>("a rig id");
  const auto num_sensors = fields.Number<uint32_t>("the number of sensors");
  if (num_sensors == 0) source.Fail("has no sensor", "at least the reference");
  rig.reference = ParseSensorId(fields, source);
  for (uint32_t i = 1; i < num_sensors; ++i) {
    const SensorId sensor = ParseSensorId(fields, source);
    std::optional<Rigid3d> sensor_from_rig;
    if (fields.Number<int>("1 if a pose follows, else 0") != 0) {
      sensor_from_rig = ParsePose(fields, source, "rig " + std::to_string(rig.rig_id));
    }
    if (!rig.sensor_from_rig.emplace(sensor, sensor_from_rig).second) {
      source.Fail("names a sensor twice", "each once");
    }
  }
  fields.ExpectEnd();
  return rig;
}

Frame ParseFrame(std::string_view line, const RecordSource& source) {
  Fields fields(line, source);
  Frame frame;
  frame.frame_id = fields.Number<uint32_t>("a frame id");
  frame.rig_id = fields.Number<uint32_t>("a rig id");
  frame.rig_from_world = ParsePose(fields, source, "frame " + std::to_string(frame.frame_id));
  const auto num_data = fields.Number<uint32_t>("the number of images");
  for (uint32_t i = 0; i < num_data; ++i) {
    const SensorId sensor = ParseSensorId(fields, source);
    frame.data.push_back({sensor, fields.Number<uint64_t>("an image id")});
  }
  fields.ExpectEnd();
  return frame;
}

// Writes words separated by spaces, as lines.
class TextWriter {
 public:
  TextWriter(const std::filesystem::path& path, std::string_view columns) : file_(path) {
    file_.Write("# ");
    file_.Write(columns);
    file_.Write("\n");
  }

  TextWriter& operator<<(std::string_view word) {
    if (!line_.empty()) line_ += ' ';
    line_ += word;
    return *this;
  }

  template <typename T>
  requires std::is_arithmetic_v<T> TextWriter& operator<<(T value) {
    constexpr int kDigits = 17;  // enough for every double
    std::array<char, 32> buffer;
    std::to_chars_result result;
    if constexpr (std::is_floating_point_v<T>) {
      result =
          std::to_chars(buffer.begin(), buffer.end(), value, std::chars_format::general, kDigits);
    } else {
      result = std::to_chars(buffer.begin(), buffer.end(), value);
    }
    return *this << std::string_view(buffer.begin(), result.ptr);
  }

  TextWriter& operator<<(const Rigid3d& pose) {
    for (const double value : ValuesFromPose(pose)) *this << value;
    return *this;
  }

  TextWriter& operator<<(const SensorId& sensor) {
    return *this << (sensor.type == 0 ? "CAMERA" : "IMU") << sensor.id;
  }

  void EndLine() {
    line_ += '\n';
    file_.Write(line_);
    line_.clear();
  }

  void Commit() { file_.Commit(); }

 private:
  AtomicFile file_;
  std::string line_;
};

}  // namespace

void ParseCamerasText(std::string_view text,
                      const std::filesystem::path& path,
                      Reconstruction& reconstruction) {
  Lines lines(text);
  while (const auto line = lines.NextRecord()) {
    const RecordSource source{path, lines.number()};
    Fields fields(*line, source);
    Camera camera;
    camera.camera_id = fields.Number<uint32_t>("a camera id");
    const CameraModelInfo& info = FindModelOrFail(source, fields.Word("a camera model"));
    camera.model = info.model;
    camera.width = fields.Number<uint64_t>("the image width");
    camera.height = fields.Number<uint64_t>("the image height");
    for (int i = 0; i < info.num_params; ++i) {
      camera.params.push_back(fields.Number<double>(std::to_string(info.num_params) +
                                                    " parameters of " + std::string(info.name)));
    }
    fields.ExpectEnd();
    AddCamera(source, std::move(camera), reconstruction.cameras);
  }
}

void ParseImagesText(std::string_view text,
                     const std::filesystem::path& path,
                     Reconstruction& reconstruction) {
  Lines lines(text);
  while (const auto line = lines.NextRecord()) {
    Image image = ParseImage(*line, {path, lines.number()});
    const auto points2D_line = lines.Next();
    const RecordSource source{path, lines.number()};
    image.points2D = ParsePoints2D(points2D_line.value_or(""), source);
    AddImage(source, std::move(image), reconstruction.images);
  }
}

void ParsePoints3DText(std::string_view text,
                       const std::filesystem::path& path,
                       Reconstruction& reconstruction) {
  Lines lines(text);
  while (const auto line = lines.NextRecord()) {
    const RecordSource source{path, lines.number()};
    Fields fields(*line, source);
    const auto point3D_id = fields.Number<uint64_t>("a point3D id");
    Point3D point;
    for (double& value : point.xyz) value = fields.Number<double>("x y z");
    for (uint8_t& channel : point.rgb) channel = fields.Number<uint8_t>("r g b from 0 to 255");
    point.error = fields.Number<double>("an error in pixels");
    while (!fields.AtEnd()) {
      const auto image_id = fields.Number<uint32_t>("an image id");
      point.track.push_back({image_id, fields.Number<uint32_t>("a point2D index")});
    }
    point.track.shrink_to_fit();
    AddPoint3D(source, point3D_id, std::move(point), reconstruction.points3D);
  }
}

void ParseRigsText(std::string_view text,
                   const std::filesystem::path& path,
                   Reconstruction& reconstruction) {
  Lines lines(text);
  while (const auto line = lines.NextRecord()) {
    const RecordSource source{path, lines.number()};
    AddRig(source, ParseRig(*line, source), reconstruction.rigs);
  }
}

void ParseFramesText(std::string_view text,
                     const std::filesystem::path& path,
                     Reconstruction& reconstruction) {
  Lines lines(text);
  while (const auto line = lines.NextRecord()) {
    const RecordSource source{path, lines.number()};
    AddFrame(source, ParseFrame(*line, source), reconstruction.frames);
  }
}

void WriteCamerasText(const Reconstruction& reconstruction, const std::filesystem::path& path) {
  TextWriter writer(path, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]");
  for (const auto& [camera_id, camera] : reconstruction.cameras) {
    writer << camera_id << GetCameraModelInfo(camera.model).name << camera.width << camera.height;
    for (const double param : camera.params) writer << param;
    writer.EndLine();
  }
  writer.Commit();
}

void WriteImagesText(const Reconstruction& reconstruction, const std::filesystem::path& path) {
  TextWriter writer(path,
                    "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME; on the next line "
                    "(X Y POINT3D_ID)[], may be empty");
  for (const auto& [image_id, image] : reconstruction.images) {
    VGTW_CHECK(image.name.find(' ') == std::string::npos,
               "text models cannot hold the name '" + image.name + "'");
    writer << image_id << image.cam_from_world << image.camera_id << image.name;
    writer.EndLine();
    for (const Point2D& point2D : image.points2D) {
      writer << point2D.xy.x() << point2D.xy.y() << static_cast<int64_t>(point2D.point3D_id);
    }
    writer.EndLine();
  }
  writer.Commit();
}

void WritePoints3DText(const Reconstruction& reconstruction, const std::filesystem::path& path) {
  TextWriter writer(path, "POINT3D_ID X Y Z R G B ERROR (IMAGE_ID POINT2D_IDX)[]");
  for (const auto& [point3D_id, point] : reconstruction.points3D) {
    writer << point3D_id;
    for (const double value : point.xyz) writer << value;
    for (const uint8_t channel : point.rgb) writer << int{channel};
    writer << point.error;
    for (const TrackElement& element : point.track) {
      writer << element.image_id << element.point2D_idx;
    }
    writer.EndLine();
  }
  writer.Commit();
}

void WriteRigsText(const Reconstruction& reconstruction, const std::filesystem::path& path) {
  TextWriter writer(path,
                    "RIG_ID NUM_SENSORS REFERENCE_TYPE REFERENCE_ID "
                    "(TYPE ID HAS_POSE [QW QX QY QZ TX TY TZ])[]");
  for (const auto& [rig_id, rig] : reconstruction.rigs) {
    writer << rig_id << 1 + rig.sensor_from_rig.size() << rig.reference;
    for (const auto& [sensor, sensor_from_rig] : rig.sensor_from_rig) {
      writer << sensor << int{sensor_from_rig.has_value()};
      if (sensor_from_rig) writer << *sensor_from_rig;
    }
    writer.EndLine();
  }
  writer.Commit();
}

void WriteFramesText(const Reconstruction& reconstruction, const std::filesystem::path& path) {
  TextWriter writer(path, "FRAME_ID RIG_ID QW QX QY QZ TX TY TZ NUM_DATA (TYPE ID DATA_ID)[]");
  for (const auto& [frame_id, frame] : reconstruction.frames) {
    writer << frame_id << frame.rig_id << frame.rig_from_world << frame.data.size();
    for (const FrameData& data : frame.data) writer << data.sensor << data.data_id;
    writer.EndLine();
  }
  writer.Commit();
}

}  // namespace vgtw
