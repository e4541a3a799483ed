// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/npy.h"

#include "scene/error.h"
#include "scene/float16.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

namespace vgtw {
namespace {

static_assert(std::endian::native == std::endian::little, ".npy is read as little-endian");

constexpr size_t kMaxDimensions = 8;
constexpr uint64_t kMaxFortranValues = uint64_t{1} << 28;
constexpr size_t kChunkValues = 1 << 16;

struct TypeRow {
  std::string_view descr;
  NpyType type;
  size_t item_size;
};
constexpr std::array<TypeRow, 8> kTypes = {{{"|b1", NpyType::kBool, 1},
                                            {"|u1", NpyType::kUint8, 1},
                                            {"<u1", NpyType::kUint8, 1},
                                            {"<i4", NpyType::kInt32, 4},
                                            {"<i8", NpyType::kInt64, 8},
                                            {"<f2", NpyType::kFloat16, 2},
                                            {"<f4", NpyType::kFloat32, 4},
                                            {"<f8", NpyType::kFloat64, 8}}};

// The header is a Python dictionary in text, for instance
//   {'descr': '<f4', 'fortran_order': False, 'shape': (20, 3, 4), }
// Only this form is understood: three keys in any order, no escapes.
class DictionaryParser {
 public:
  DictionaryParser(std::string_view text, const std::string& origin)
      : text_(text), origin_(origin) {}

  NpyHeader Parse() {
    NpyHeader header;
    Expect('{');
    while (!Accept('}')) {
      const std::string_view key = QuotedText();
      Expect(':');
      ParseValue(key, header);
      if (!Accept(',')) {
        Expect('}');
        break;
      }
    }
    SkipSpace();
    if (position_ != text_.size() || num_keys_ != 3) Damaged();
    return header;
  }

 private:
  [[noreturn]] void Damaged() const {
    Fail(origin_,
         "the .npy header is damaged (" + Printable(text_) + ")",
         "'descr', 'fortran_order' and 'shape'");
  }

  void SkipSpace() {
    while (position_ < text_.size() && (text_[position_] == ' ' || text_[position_] == '\n')) {
      ++position_;
    }
  }

  bool Accept(char c) {
    SkipSpace();
    if (position_ >= text_.size() || text_[position_] != c) return false;
    ++position_;
    return true;
  }

  void Expect(char c) {
    if (!Accept(c)) Damaged();
  }

  std::string_view QuotedText() {
    SkipSpace();
    const char quote = Accept('"') ? '"' : '\'';
    if (quote == '\'') Expect('\'');
    const size_t end = text_.find(quote, position_);
    if (end == std::string_view::npos) Damaged();
    const std::string_view quoted = text_.substr(position_, end - position_);
    position_ = end + 1;
    return quoted;
  }

  bool Word(std::string_view word) {
    SkipSpace();
    if (text_.substr(position_, word.size()) != word) return false;
    position_ += word.size();
    return true;
  }

  void ParseValue(std::string_view key, NpyHeader& header) {
    const auto key_bit = [&]() -> unsigned {
      if (key == "descr") return 1;
      if (key == "fortran_order") return 2;
      if (key == "shape") return 4;
      Damaged();
    }();
    if ((seen_ & key_bit) != 0) Damaged();
    seen_ |= key_bit;
    ++num_keys_;
    if (key_bit == 1) {
      header.type = ParseType();
    } else if (key_bit == 2) {
      header.is_fortran_order = Word("True");
      if (!header.is_fortran_order && !Word("False")) Damaged();
    } else {
      header.shape = ParseShape();
    }
  }

  NpyType ParseType() {
    SkipSpace();
    // A structured type is a list instead of a text.
    if (position_ < text_.size() && text_[position_] == '[') RefuseType("a structured type");
    const std::string_view descr = QuotedText();
    for (const TypeRow& row : kTypes) {
      if (row.descr == descr) return row.type;
    }
    RefuseType("type '" + Printable(descr) + "'");
  }

  [[noreturn]] void RefuseType(const std::string& found) const {
    Fail(origin_,
         "holds values of " + found,
         "b1, u1, i4, i8, f2, f4 or f8, little-endian",
         "save it with .astype('<f4')");
  }

  std::vector<uint64_t> ParseShape() {
    std::vector<uint64_t> shape;
    Expect('(');
    while (!Accept(')')) {
      SkipSpace();
      uint64_t length = 0;
      const char* begin = text_.data() + position_;
      const auto [end, code] = std::from_chars(begin, text_.data() + text_.size(), length);
      if (code != std::errc() || shape.size() == kMaxDimensions) Damaged();
      position_ += static_cast<size_t>(end - begin);
      Accept('L');  // written by Python 2
      shape.push_back(length);
      if (!Accept(',')) {
        Expect(')');
        break;
      }
    }
    return shape;
  }

  std::string_view text_;
  const std::string& origin_;
  size_t position_ = 0;
  unsigned seen_ = 0;
  int num_keys_ = 0;
};

template <typename T>
T LoadAs(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(value));
  return value;
}

template <typename T>
T ConvertValue(NpyType type, const std::byte* bytes) {
  switch (type) {
    case NpyType::kBool:
      return static_cast<T>(LoadAs<uint8_t>(bytes) != 0);
    case NpyType::kUint8:
      return static_cast<T>(LoadAs<uint8_t>(bytes));
    case NpyType::kInt32:
      return static_cast<T>(LoadAs<int32_t>(bytes));
    case NpyType::kInt64:
      return static_cast<T>(LoadAs<int64_t>(bytes));
    case NpyType::kFloat16:
      return static_cast<T>(FloatOfHalf(LoadAs<uint16_t>(bytes)));
    case NpyType::kFloat32:
      return static_cast<T>(LoadAs<float>(bytes));
    case NpyType::kFloat64:
      break;
  }
  return static_cast<T>(LoadAs<double>(bytes));
}

// Number of values, or nullopt if it exceeds `limit`.
std::optional<uint64_t> CountValues(const std::vector<uint64_t>& shape, uint64_t limit) {
  if (std::find(shape.begin(), shape.end(), 0u) != shape.end()) return 0;
  uint64_t count = 1;
  for (const uint64_t length : shape) {
    if (length > limit / count) return std::nullopt;
    count *= length;
  }
  return count;
}

}  // namespace

size_t NpyItemSize(NpyType type) {
  const auto* row = std::find_if(kTypes.begin(), kTypes.end(), [&](const TypeRow& candidate) {
    return candidate.type == type;
  });
  return row->item_size;
}

uint64_t NumValues(const NpyHeader& header) {
  return CountValues(header.shape, std::numeric_limits<uint64_t>::max()).value();
}

std::string ShapeText(const std::vector<uint64_t>& shape) {
  std::string text = "(";
  for (size_t i = 0; i < shape.size(); ++i) {
    text += (i == 0 ? "" : ", ") + std::to_string(shape[i]);
  }
  return text + (shape.size() == 1 ? ",)" : ")");
}

NpyHeader ParseNpyHeader(std::span<const std::byte> front,
                         uint64_t file_size,
                         const std::string& origin) {
  constexpr std::string_view kMagic = "\x93NUMPY";
  constexpr size_t kVersion1Prefix = 10;
  if (front.size() < kVersion1Prefix ||
      std::memcmp(front.data(), kMagic.data(), kMagic.size()) != 0) {
    Fail(origin, "is no .npy array", "NumPy's magic bytes");
  }
  const auto version = LoadAs<uint8_t>(front.data() + 6);
  const size_t prefix = version == 1 ? kVersion1Prefix : kVersion1Prefix + 2;
  if (version < 1 || version > 3 || front.size() < prefix) {
    Fail(origin,
         "is .npy version " + std::to_string(version),
         "a complete header of version 1 to 3");
  }
  const uint64_t length = version == 1 ? LoadAs<uint16_t>(front.data() + 8)
                                       : uint64_t{LoadAs<uint32_t>(front.data() + 8)};
  if (length > front.size() - prefix) {
    Fail(origin,
         "ends or exceeds " + std::to_string(kMaxNpyHeaderBytes) + " bytes within the .npy header",
         "a header of " + std::to_string(length) + " bytes");
  }
  const std::string_view text(reinterpret_cast<const char*>(front.data()) + prefix, length);
  NpyHeader header = DictionaryParser(text, origin).Parse();
  header.data_offset = prefix + length;
  const uint64_t num_bytes = file_size - std::min(file_size, header.data_offset);
  if (!CountValues(header.shape, num_bytes / NpyItemSize(header.type))) {
    Fail(origin,
         "holds " + std::to_string(num_bytes) + " bytes of values",
         "shape " + ShapeText(header.shape) + " of " + std::to_string(NpyItemSize(header.type)) +
             " bytes each",
         "the file is truncated or damaged");
  }
  return header;
}

NpyReader::NpyReader(Source source, uint64_t file_size, std::string origin)
    : source_(std::move(source)), origin_(std::move(origin)) {
  front_.resize(std::min<uint64_t>(file_size, kMaxNpyHeaderBytes));
  if (source_(front_) != front_.size()) {
    Fail(origin_, "ends early", std::to_string(file_size) + " bytes");
  }
  header_ = ParseNpyHeader(front_, file_size, origin_);
  front_begin_ = header_.data_offset;
  num_left_ = NumValues(header_);
}

bool NpyReader::IsFloatingPoint() const {
  return header_.type == NpyType::kFloat16 || header_.type == NpyType::kFloat32 ||
         header_.type == NpyType::kFloat64;
}

void NpyReader::ReadBytes(std::span<std::byte> bytes) {
  const size_t num_from_front = std::min(bytes.size(), front_.size() - front_begin_);
  std::copy_n(front_.data() + front_begin_, num_from_front, bytes.data());
  front_begin_ += num_from_front;
  const std::span<std::byte> rest = bytes.subspan(num_from_front);
  if (!rest.empty() && source_(rest) != rest.size()) {
    Fail(origin_, "ends within its values", "shape " + ShapeText(header_.shape));
  }
}

// Replaces the unread bytes by the same values in C order.
void NpyReader::LoadFortran() {
  if (num_left_ > kMaxFortranValues) {
    Fail(origin_,
         "is a Fortran-order array of shape " + ShapeText(header_.shape),
         "at most 2^28 values in that order",
         "save it with numpy.ascontiguousarray");
  }
  const size_t item_size = NpyItemSize(header_.type);
  std::vector<std::byte> fortran(num_left_ * item_size);
  ReadBytes(fortran);
  front_.resize(fortran.size());
  const size_t num_dimensions = header_.shape.size();
  std::vector<uint64_t> index(num_dimensions, 0);
  for (uint64_t k = 0; k < num_left_; ++k) {
    uint64_t source_idx = 0;
    for (size_t d = num_dimensions; d-- > 0;) source_idx = source_idx * header_.shape[d] + index[d];
    std::memcpy(front_.data() + k * item_size, fortran.data() + source_idx * item_size, item_size);
    for (size_t d = num_dimensions; d-- > 0 && ++index[d] == header_.shape[d];) index[d] = 0;
  }
  front_begin_ = 0;
  header_.is_fortran_order = false;
}

template <typename T>
void NpyReader::ReadAs(std::span<T> values) {
  VGTW_CHECK(values.size() <= num_left_, origin_);
  if (header_.is_fortran_order) LoadFortran();
  const size_t item_size = NpyItemSize(header_.type);
  for (size_t begin = 0; begin < values.size(); begin += kChunkValues) {
    const size_t count = std::min(kChunkValues, values.size() - begin);
    buffer_.resize(count * item_size);
    ReadBytes(buffer_);
    for (size_t i = 0; i < count; ++i) {
      values[begin + i] = ConvertValue<T>(header_.type, buffer_.data() + i * item_size);
    }
  }
  num_left_ -= values.size();
}

void NpyReader::Read(std::span<float> values) { ReadAs(values); }
void NpyReader::Read(std::span<double> values) { ReadAs(values); }

}  // namespace vgtw
