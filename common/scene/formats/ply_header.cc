// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/ply_header.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "common/scene/formats/number.h"

namespace sheaf {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr size_t kPlyBufferBytes = size_t{1} << 18;
constexpr size_t kLineBytesMax = size_t{1} << 14;
constexpr size_t kWordBytesMax = 512;
constexpr size_t kElementsMax = 256;
constexpr size_t kPropertiesMax = 1024;

struct PlyTypeName {
  std::string_view name;
  PlyType type;
};
constexpr PlyTypeName kPlyTypeNames[] = {
    {"char", PlyType::kInt8},       {"int8", PlyType::kInt8},       {"uchar", PlyType::kUint8},
    {"uint8", PlyType::kUint8},     {"short", PlyType::kInt16},     {"int16", PlyType::kInt16},
    {"ushort", PlyType::kUint16},   {"uint16", PlyType::kUint16},   {"int", PlyType::kInt32},
    {"int32", PlyType::kInt32},     {"uint", PlyType::kUint32},     {"uint32", PlyType::kUint32},
    {"float", PlyType::kFloat32},   {"float32", PlyType::kFloat32}, {"double", PlyType::kFloat64},
    {"float64", PlyType::kFloat64},
};

bool TypeFromName(std::string_view name, PlyType* type) {
  for (const PlyTypeName& entry : kPlyTypeNames) {
    if (entry.name != name) continue;
    *type = entry.type;
    return true;
  }
  return false;
}

template <typename T>
double LoadScalar(const unsigned char* bytes, bool swap) {
  std::array<unsigned char, sizeof(T)> ordered;
  std::memcpy(ordered.data(), bytes, sizeof(T));
  if (swap) std::reverse(ordered.begin(), ordered.end());
  T value;
  std::memcpy(&value, ordered.data(), sizeof(T));
  return static_cast<double>(value);
}

std::vector<std::string_view> SplitWords(std::string_view line) {
  constexpr std::string_view kBlank = " \t";
  std::vector<std::string_view> words;
  size_t begin = line.find_first_not_of(kBlank);
  while (begin != std::string_view::npos) {
    const size_t end = std::min(line.find_first_of(kBlank, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kBlank, end);
  }
  return words;
}

// These return what is wrong with the line; empty if nothing is.
std::string SetFormat(const std::vector<std::string_view>& words, PlyHeader* header) {
  if (words.size() < 2) return "\"format\" needs a name";
  if (words[1] == "ascii") {
    header->format = PlyFormat::kAscii;
  } else if (words[1] == "binary_little_endian") {
    header->format = PlyFormat::kLittleEndian;
  } else if (words[1] == "binary_big_endian") {
    header->format = PlyFormat::kBigEndian;
  } else {
    return absl::StrCat("the format \"", std::string(words[1]), "\" is unknown");
  }
  return "";
}

std::string AddElement(const std::vector<std::string_view>& words, uint64_t line,
                       PlyHeader* header) {
  PlyElement element;
  element.line = line;
  if (words.size() != 3 || !ParseInteger(words[2], &element.count)) {
    return "\"element\" needs a name and a count";
  }
  if (header->elements.size() == kElementsMax) return "there are too many elements";
  element.name = std::string(words[1]);
  header->elements.push_back(std::move(element));
  return "";
}

std::string AddProperty(const std::vector<std::string_view>& words, uint64_t line,
                        PlyHeader* header) {
  if (header->elements.empty()) return "a property stands before the first element";
  PlyProperty property;
  property.line = line;
  property.is_list = words.size() == 5 && words[1] == "list";
  if (property.is_list) {
    if (!TypeFromName(words[2], &property.count_type) || !TypeFromName(words[3], &property.type)) {
      return "the list has an unknown type";
    }
    if (property.count_type == PlyType::kFloat32 || property.count_type == PlyType::kFloat64) {
      return "the list's count is not of an integer type";
    }
  } else if (words.size() != 3 || !TypeFromName(words[1], &property.type)) {
    return "\"property\" needs a known type and a name";
  }
  if (header->elements.back().properties.size() == kPropertiesMax) {
    return "there are too many properties";
  }
  property.name = std::string(words.back());
  header->elements.back().properties.push_back(std::move(property));
  return "";
}

}  // namespace

size_t PlySizeBytes(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat32:
      return 4;
    case PlyType::kFloat64:
      return 8;
  }
  return 0;
}

double PlyValueOf(PlyType type, const unsigned char* bytes, bool swap) {
  switch (type) {
    case PlyType::kInt8:
      return LoadScalar<int8_t>(bytes, swap);
    case PlyType::kUint8:
      return LoadScalar<uint8_t>(bytes, swap);
    case PlyType::kInt16:
      return LoadScalar<int16_t>(bytes, swap);
    case PlyType::kUint16:
      return LoadScalar<uint16_t>(bytes, swap);
    case PlyType::kInt32:
      return LoadScalar<int32_t>(bytes, swap);
    case PlyType::kUint32:
      return LoadScalar<uint32_t>(bytes, swap);
    case PlyType::kFloat32:
      return LoadScalar<float>(bytes, swap);
    case PlyType::kFloat64:
      return LoadScalar<double>(bytes, swap);
  }
  return 0;
}

PlyBytes::PlyBytes(std::unique_ptr<TextInput> input)
    : input_(std::move(input)), buffer_(kPlyBufferBytes) {}

bool PlyBytes::Pull(size_t size_bytes) {
  if (!status_.ok()) return false;
  std::memmove(buffer_.data(), buffer_.data() + position_, end_ - position_);
  end_ -= position_;
  position_ = 0;
  while (end_ < size_bytes) {
    const absl::StatusOr<size_t> count =
        input_->Read(reinterpret_cast<char*>(buffer_.data()) + end_, buffer_.size() - end_);
    if (!count.ok()) status_ = count.status();
    if (!count.ok() || *count == 0) return false;
    end_ += *count;
  }
  return true;
}

bool PlyBytes::Refill(size_t size_bytes) {
  if (Pull(size_bytes)) return true;
  if (status_.ok()) status_ = absl::DataLossError("the file ends too early (truncated?)");
  return false;
}

bool PlyBytes::ReadLine(std::string* line) {
  line->clear();
  while (const unsigned char* byte = ReadBytes(1)) {
    if (*byte == '\n') {
      ++line_;
      if (!line->empty() && line->back() == '\r') line->pop_back();
      return true;
    }
    if (line->size() == kLineBytesMax) {
      status_ = absl::InvalidArgumentError("a line of the header is too long");
      return false;
    }
    line->push_back(static_cast<char>(*byte));
  }
  return false;
}

bool PlyBytes::ReadWord(std::string_view* word) {
  const auto is_blank = [](unsigned char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\n';
  };
  const unsigned char* byte = nullptr;
  do {
    byte = ReadBytes(1);
    if (byte == nullptr) return false;
    if (*byte == '\n') ++line_;
  } while (is_blank(*byte));
  --position_;
  // Once this many bytes are buffered, a word does not cross the end of the buffer; fewer are
  // available only at the end of the file, which then ends the word.
  if (end_ - position_ < kWordBytesMax && !Pull(kWordBytesMax) && !status_.ok()) return false;
  size_t end = position_;
  while (end < end_ && !is_blank(buffer_[end])) ++end;
  if (end - position_ >= kWordBytesMax) {
    status_ = absl::InvalidArgumentError(absl::StrCat("line ", line_, ": a number is too long"));
    return false;
  }
  *word = std::string_view(reinterpret_cast<char*>(buffer_.data()) + position_, end - position_);
  position_ = end;
  return true;
}

bool PlyBytes::IsAtEnd() {
  if (end_ == position_) Pull(1);
  const auto is_blank = [](unsigned char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\0';
  };
  return !status_.ok() || std::all_of(buffer_.begin() + static_cast<ptrdiff_t>(position_),
                                      buffer_.begin() + static_cast<ptrdiff_t>(end_), is_blank);
}

absl::StatusOr<PlyHeader> ReadPlyHeader(PlyBytes& bytes) {
  PlyHeader header;
  std::string line;
  if (!bytes.ReadLine(&line) || line != "ply") {
    return absl::InvalidArgumentError("line 1: this is not a PLY file; it must begin with \"ply\"");
  }
  bool has_format = false;
  while (true) {
    const uint64_t number = bytes.line();
    if (!bytes.ReadLine(&line)) return bytes.status();
    const std::vector<std::string_view> words = SplitWords(line);
    if (words.empty() || words[0] == "comment" || words[0] == "obj_info") {
      // MeshLab's way to name the image of the mesh.
      if (words.size() > 2 && words[1] == "TextureFile" && header.texture.empty()) {
        header.texture = std::string(words[2]);
        header.texture_line = number;
      }
      continue;
    }
    if (words[0] == "end_header") break;
    std::string error;
    if (words[0] == "format") {
      error = SetFormat(words, &header);
      has_format = true;
    } else if (words[0] == "element") {
      error = AddElement(words, number, &header);
    } else if (words[0] == "property") {
      error = AddProperty(words, number, &header);
    } else {
      error = absl::StrCat("\"", std::string(words[0].substr(0, 40)),
                           "\" is not a keyword of a PLY header");
    }
    if (!error.empty())
      return absl::InvalidArgumentError(absl::StrCat("line ", number, ": ", error));
  }
  if (!has_format) return absl::InvalidArgumentError("the header has no format line");
  return header;
}

}  // namespace sheaf
