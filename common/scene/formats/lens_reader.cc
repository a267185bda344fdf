// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/lens_reader.h"

#include <cmath>
#include <cstdint>
#include <memory>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "common/scene/formats/number.h"
#include "common/scene/formats/text_input.h"

namespace sheaf {
namespace {

constexpr uint64_t kLensFileBytesMax = uint64_t{1} << 20;
// Lengths of lenses, in millimeters, are below this; within these limits squares neither underflow
// nor overflow. The index limits cover all real media.
constexpr double kLengthMaxMm = 1e9;
constexpr double kEtaMin = 0.1, kEtaMax = 10;

absl::StatusOr<std::string> ReadLensText(const std::string& path) {
  absl::StatusOr<std::unique_ptr<TextInput>> input = TextInput::Open(path, kLensFileBytesMax);
  if (!input.ok()) return input.status();
  std::string text;
  char buffer[1 << 12];
  while (true) {
    const absl::StatusOr<size_t> count = (*input)->Read(buffer, sizeof buffer);
    if (!count.ok()) return count.status();
    if (*count == 0) return text;
    text.append(buffer, *count);
  }
}

struct PlacedNumber {
  double value = 0;
  int line = 0, column = 0;
};

bool IsSpace(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == ','; }

absl::Status ErrorAt(const std::string& name, int line, int column, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat(name, ":", line, ":", column, ": ", what));
}

absl::StatusOr<std::vector<PlacedNumber>> ReadNumbers(const std::string& name,
                                                      std::string_view text) {
  std::vector<PlacedNumber> numbers;
  int line = 1;
  size_t line_begin = 0;
  for (size_t i = 0; i < text.size();) {
    if (text[i] == '#') {
      while (i < text.size() && text[i] != '\n') ++i;
      continue;
    }
    if (IsSpace(text[i])) {
      if (text[i] == '\n') {
        ++line;
        line_begin = i + 1;
      }
      ++i;
      continue;
    }
    const size_t begin = i;
    while (i < text.size() && !IsSpace(text[i]) && text[i] != '#') ++i;
    const std::string_view word = text.substr(begin, i - begin);
    const int column = static_cast<int>(begin - line_begin) + 1;
    PlacedNumber number{0, line, column};
    if (!ParseDouble(word, &number.value) || !std::isfinite(number.value)) {
      return ErrorAt(
          name, line, column,
          absl::StrCat("expected a number, not \"", std::string(word.substr(0, 40)), "\""));
    }
    if (numbers.size() == 4 * kLensSurfacesMax) {
      return absl::ResourceExhaustedError(absl::StrCat(name, ":", line, ": a lens has at most ",
                                                       kLensSurfacesMax, " surfaces here"));
    }
    numbers.push_back(number);
  }
  return numbers;
}

// Why the number is invalid in its column of the file; empty if it is valid.
std::string WhyNot(size_t column, double value) {
  switch (column) {
    case 0:
      if (std::fabs(value) > kLengthMaxMm)
        return "a radius of curvature this large is flat: give 0";
      if (value != 0 && std::fabs(value) < 1 / kLengthMaxMm) return "the radius is too small";
      return "";
    case 1:
      return value >= 0 && value <= kLengthMaxMm ? "" : "a thickness is at least 0";
    case 2:
      return value == 0 || (value >= kEtaMin && value <= kEtaMax)
                 ? ""
                 : absl::StrCat("an index of refraction is within [", kEtaMin, ", ", kEtaMax,
                                "], or 0 for air");
    default:
      return value > 0 && value <= kLengthMaxMm ? "" : "an aperture's diameter is greater than 0";
  }
}

}  // namespace

absl::StatusOr<std::vector<LensSurface>> ReadLens(const std::string& name,
                                                  const std::string& path) {
  const absl::StatusOr<std::string> text = ReadLensText(path);
  if (!text.ok()) return text.status();
  const absl::StatusOr<std::vector<PlacedNumber>> numbers = ReadNumbers(name, *text);
  if (!numbers.ok()) return numbers.status();
  if (numbers->empty()) return ErrorAt(name, 1, 1, "the file has no surfaces");
  if (numbers->size() % 4 != 0) {
    const PlacedNumber& last = numbers->back();
    return ErrorAt(name, last.line, last.column,
                   absl::StrCat("the file ends within a surface: ", numbers->size(),
                                " numbers are not four a surface (radius, thickness, index, "
                                "diameter)"));
  }
  std::vector<LensSurface> surfaces;
  for (size_t i = 0; i < numbers->size(); i += 4) {
    for (size_t k = 0; k < 4; ++k) {
      const PlacedNumber& number = (*numbers)[i + k];
      const std::string why = WhyNot(k, number.value);
      if (!why.empty()) {
        return ErrorAt(name, number.line, number.column, absl::StrCat(number.value, ": ", why));
      }
    }
    const double eta = (*numbers)[i + 2].value;
    surfaces.push_back({(*numbers)[i].value, (*numbers)[i + 1].value, eta == 0 ? 1 : eta,
                        (*numbers)[i + 3].value});
  }
  if (surfaces.back().eta != 1) {
    const PlacedNumber& last = (*numbers)[numbers->size() - 2];
    return ErrorAt(name, last.line, last.column, "the film lies in air: the last index must be 1");
  }
  return surfaces;
}

}  // namespace sheaf
