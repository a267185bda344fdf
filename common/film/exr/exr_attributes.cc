// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/exr_attributes.h"

#include <ImfBoxAttribute.h>
#include <ImfFloatAttribute.h>
#include <ImfIntAttribute.h>
#include <ImfMatrixAttribute.h>
#include <ImfRationalAttribute.h>
#include <ImfVecAttribute.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <type_traits>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/film/exr/exr_streams.h"

namespace sheaf {
namespace {

constexpr std::string_view kCryptomattePrefix = "cryptomatte/";

// The attributes that are no strings, and their types. Names with "sheaf:" are Sheaf's own.
struct TypedName {
  std::string_view name, type;
};
constexpr TypedName kTypedNames[] = {{"sheaf:cellSizePx", "int"},
                                     {"sheaf:cpuSeconds", "float"},
                                     {"sheaf:certifiedError", "float"},
                                     {"sheaf:denoisedMse", "float"},
                                     {"sheaf:depthMax", "int"},
                                     {"sheaf:flip", "float"},
                                     {"sheaf:frameNumber", "int"},
                                     {"sheaf:lightCpuSeconds", "float"},
                                     {"sheaf:lightSamplesMax", "int"},
                                     {"sheaf:maxComponentValue", "float"},
                                     {"sheaf:relativeMse", "float"},
                                     {"sheaf:renderSeconds", "float"},
                                     {"sheaf:samplesPerPixel", "int"},
                                     {"sheaf:samplesPerPixelMax", "int"},
                                     {"sheaf:seed", "int"},
                                     {"sheaf:similarityAfter", "int"},
                                     {"sheaf:size", "v2i"},
                                     {"sheaf:targetError", "float"},
                                     {"sheaf:tileSizePx", "int"},
                                     {"sheaf:trainingCpuSeconds", "float"},
                                     {"sheaf:whiteBalanceK", "float"},
                                     {"sheaf:window", "box2i"},
                                     {"framesPerSecond", "rational"},
                                     {"utcOffset", "float"},
                                     {"worldToCamera", "m44f"},
                                     {"worldToNDC", "m44f"}};
// Standard attributes that are strings.
constexpr std::string_view kStandardTexts[] = {"capDate", "comments", "owner", "software"};

std::string_view TypeOf(const std::string& name) {
  for (const TypedName& typed : kTypedNames) {
    if (typed.name == name) return typed.type;
  }
  return "string";
}

bool IsStandard(const std::string& name) {
  return std::ranges::find(kStandardTexts, name) != std::end(kStandardTexts) ||
         (!name.starts_with(kMetadataPrefix) && TypeOf(name) != "string");
}

template <typename T, size_t kCount>
std::optional<std::array<T, kCount>> NumbersOf(std::string_view raw) {
  std::array<T, kCount> numbers{};
  if (raw.size() != sizeof numbers) return std::nullopt;
  std::memcpy(numbers.data(), raw.data(), sizeof numbers);
  return numbers;
}

// The text of a value as it lies in a file; nothing if the type is none of those above.
std::optional<std::string> TextOf(std::string_view type, std::string_view raw) {
  if (type == "int") {
    const auto value = NumbersOf<int32_t, 1>(raw);
    if (value) return absl::StrCat((*value)[0]);
  } else if (type == "float") {
    const auto value = NumbersOf<float, 1>(raw);
    if (value) return absl::StrFormat("%.6g", (*value)[0]);
  } else if (type == "rational") {
    const auto numerator = NumbersOf<int32_t, 1>(raw.substr(0, sizeof(int32_t)));
    const auto denominator = NumbersOf<uint32_t, 1>(raw.substr(sizeof(int32_t)));
    if (numerator && denominator) return absl::StrCat((*numerator)[0], "/", (*denominator)[0]);
  } else if (type == "v2i") {
    const auto size = NumbersOf<int32_t, 2>(raw);
    if (size) return absl::StrCat((*size)[0], "x", (*size)[1]);
  } else if (type == "box2i") {
    const auto edges = NumbersOf<int32_t, 4>(raw);
    if (edges) {
      const auto [x0, y0, x1, y1] = *edges;
      return absl::StrCat(x0, ",", y0, ",", int64_t{x1} + 1, ",", int64_t{y1} + 1);
    }
  } else if (type == "m44f") {
    const auto values = NumbersOf<float, 16>(raw);
    if (values) {
      return absl::StrJoin(*values, " ", [](std::string* out, float value) {
        absl::StrAppendFormat(out, "%.9g", value);
      });
    }
  }
  return std::nullopt;
}

template <typename T>
std::optional<std::vector<T>> ParseNumbers(const std::string& text, char separator) {
  std::vector<T> numbers;
  for (const absl::string_view item : absl::StrSplit(text, separator)) {
    T value{};
    bool is_good = false;
    if constexpr (std::is_same_v<T, float>) {
      is_good = absl::SimpleAtof(item, &value);
    } else {
      is_good = absl::SimpleAtoi(item, &value);
    }
    if (!is_good) return std::nullopt;
    numbers.push_back(value);
  }
  return numbers;
}

template <typename T>
std::string RawOf(const std::vector<T>& numbers) {
  return std::string(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T));
}

// The value as it lies in a file; nothing if the text is not of the type.
std::optional<std::string> RawOf(std::string_view type, const std::string& text) {
  if (type == "float" || type == "m44f") {
    const auto numbers = ParseNumbers<float>(text, ' ');
    if (numbers) return RawOf(*numbers);
    return std::nullopt;
  }
  const char separator = type == "rational" ? '/' : type == "v2i" ? 'x' : ',';
  auto numbers = ParseNumbers<int32_t>(text, separator);
  if (!numbers) return std::nullopt;
  if (type == "box2i") {
    for (size_t i = 2; i < numbers->size(); ++i) {
      if ((*numbers)[i] == std::numeric_limits<int32_t>::min()) return std::nullopt;
      (*numbers)[i] -= 1;
    }
  }
  return RawOf(*numbers);
}

void SetNumbers(const std::string& name, std::string_view type, const std::string& raw,
                Imf::Header* header) {
  const auto at = [&raw](size_t i) {
    int32_t value = 0;
    std::memcpy(&value, raw.data() + i * sizeof value, sizeof value);
    return value;
  };
  if (type == "int") {
    header->insert(name, Imf::IntAttribute(at(0)));
  } else if (type == "float") {
    header->insert(name, Imf::FloatAttribute((*NumbersOf<float, 1>(raw))[0]));
  } else if (type == "rational") {
    header->insert(name,
                   Imf::RationalAttribute(Imf::Rational(at(0), static_cast<unsigned>(at(1)))));
  } else if (type == "v2i") {
    header->insert(name, Imf::V2iAttribute({at(0), at(1)}));
  } else if (type == "box2i") {
    header->insert(name, Imf::Box2iAttribute({{at(0), at(1)}, {at(2), at(3)}}));
  } else {
    Imath::M44f matrix;
    std::memcpy(matrix.getValue(), raw.data(), 16 * sizeof(float));
    header->insert(name, Imf::M44fAttribute(matrix));
  }
}

void SetAttribute(const std::string& name, const std::string& text, Imf::Header* header) {
  const std::string_view type = TypeOf(name);
  if (type != "string") {
    const std::optional<std::string> raw = RawOf(type, text);
    // Also false where the value has another number of numbers.
    if (raw && TextOf(type, *raw) == text) return SetNumbers(name, type, *raw, header);
  }
  SetText(header, name, text);
}

}  // namespace

void SetAttributes(const FrameImage& image, Imf::Header* header) {
  for (const auto& [key, text] : image.metadata) SetAttribute(kMetadataPrefix + key, text, header);
  for (const auto& [name, text] : image.attributes) SetAttribute(name, text, header);
}

void SetScreenWindow(const FrameImage& image, Imf::Header* header) {
  const auto matrix_of = [&image](const char* name) -> std::optional<Imath::M44d> {
    const auto found = image.attributes.find(name);
    if (found == image.attributes.end()) return std::nullopt;
    const auto numbers = ParseNumbers<float>(found->second, ' ');
    if (!numbers || numbers->size() != 16) return std::nullopt;
    Imath::M44d matrix;
    std::copy(numbers->begin(), numbers->end(), matrix.getValue());
    return matrix;
  };
  const std::optional<Imath::M44d> to_camera = matrix_of("worldToCamera");
  const std::optional<Imath::M44d> to_ndc = matrix_of("worldToNDC");
  if (!to_camera || !to_ndc) return;
  // Directions suffice, and lose no digits where the camera is far from the origin.
  Imath::M44d axes = *to_camera, projection = *to_ndc;
  for (int i = 0; i < 3; ++i) axes[3][i] = projection[3][i] = 0;
  if (axes.determinant() == 0) return;
  projection = axes.inverse() * projection;
  const double w = projection[2][3];  // 0 without perspective.
  const double width = w / projection[0][0], height = -w / projection[1][1];
  if (!(w > 0) || !std::isfinite(width) || !(width > 0) || !std::isfinite(height)) return;
  header->screenWindowWidth() = static_cast<float>(width);
  header->screenWindowCenter() = {static_cast<float>((0.5 - projection[2][0] / w) * width),
                                  static_cast<float>((projection[2][1] / w - 0.5) * height)};
}

void SetMatteAttributes(const FrameImage& image, std::string_view layer, Imf::Header* header) {
  constexpr std::string_view kName = "/name";
  for (const auto& [name, text] : image.attributes) {
    const bool names_layer =
        name.starts_with(kCryptomattePrefix) && name.ends_with(kName) && layer.starts_with(text);
    if (!names_layer) continue;
    const std::string key = name.substr(0, name.size() - kName.size() + 1);
    for (const auto& [of_matte, value] : image.attributes) {
      if (of_matte.starts_with(key)) SetText(header, of_matte, value);
    }
  }
}

void ReadAttributes(const ExrHeader& header, FrameImage* image) {
  const auto keep = [image](const std::string& name, const std::string& text) {
    if (name.starts_with(kMetadataPrefix)) {
      image->metadata[name.substr(std::strlen(kMetadataPrefix))] = text;
    } else if (name.starts_with(kCryptomattePrefix) || IsStandard(name)) {
      image->attributes[name] = text;
    }
  };
  for (const auto& [name, text] : header.strings) keep(name, text);
  for (const auto& [name, raw] : header.numbers) {
    const std::optional<std::string> text = TextOf(header.types.at(name), raw);
    if (text) keep(name, *text);
  }
}

}  // namespace sheaf
