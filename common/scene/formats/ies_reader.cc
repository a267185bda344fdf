// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/ies_reader.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/scene/formats/number.h"
#include "common/scene/formats/text_input.h"

namespace sheaf {
namespace {

constexpr uint64_t kIesFileBytesMax = uint64_t{1} << 24;
// Limit of a table before unfolding. Measured tables have tens of thousands of entries.
constexpr int32_t kCandelaCountMax = 1 << 20;

absl::StatusOr<std::string> ReadText(const std::string& path) {
  absl::StatusOr<std::unique_ptr<TextInput>> input = TextInput::Open(path, kIesFileBytesMax);
  if (!input.ok()) return input.status();
  std::string text;
  char buffer[1 << 14];
  while (true) {
    const absl::StatusOr<size_t> count = (*input)->Read(buffer, sizeof buffer);
    if (!count.ok()) return count.status();
    if (*count == 0) return text;
    text.append(buffer, *count);
  }
}

// Words and lines with their locations. The first error is sticky; after it every number is 0.
class IesText {
 public:
  IesText(std::string name, std::string_view text) : name_(std::move(name)), text_(text) {}

  const absl::Status& status() const { return status_; }
  void Fail(const std::string& what) {
    if (!status_.ok()) return;
    status_ = absl::InvalidArgumentError(absl::StrCat(name_, ":", line_, ":", column_, ": ", what));
  }

  bool AtEnd() const { return next_ >= text_.size(); }
  // Excludes the line end and a carriage return before it. The next word is on the next line.
  std::string_view TakeLine() {
    const size_t begin = next_, end = std::min(text_.find('\n', begin), text_.size());
    std::string_view line = text_.substr(begin, end - begin);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    next_ = std::min(end + 1, text_.size());
    ++line_count_;
    line_begin_ = next_;
    return line;
  }
  // Errors give the number's location. what: as in "expected <what>".
  float Number(const char* what) {
    const std::string_view word = TakeWord();
    float value = 0;
    if (word.empty()) {
      Fail(absl::StrCat("the file ends where ", what, " should be"));
    } else if (!ParseFloat(word, &value)) {
      Fail(absl::StrCat("expected ", what, ", a number, not \"", std::string(word.substr(0, 40)),
                        "\""));
    }
    return status_.ok() ? value : 0;
  }
  int32_t Count(const char* what, int32_t min, int32_t max) {
    const float value = Number(what);
    if (status_.ok() && !(value >= static_cast<float>(min) && value <= static_cast<float>(max) &&
                          value == std::floor(value))) {
      Fail(absl::StrCat(what, " is ", value, ", but must be a whole number from ", min, " to ",
                        max));
    }
    return status_.ok() ? static_cast<int32_t>(value) : min;
  }

 private:
  static bool IsDelimiter(char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == ',';
  }
  std::string_view TakeWord() {
    while (!AtEnd() && IsDelimiter(text_[next_])) {
      if (text_[next_++] == '\n') {
        ++line_count_;
        line_begin_ = next_;
      }
    }
    const size_t begin = next_;
    while (!AtEnd() && !IsDelimiter(text_[next_])) ++next_;
    line_ = line_count_;
    column_ = begin - line_begin_ + 1;
    return text_.substr(begin, next_ - begin);
  }

  std::string name_;
  std::string_view text_;
  size_t next_ = 0;
  size_t line_count_ = 1, line_begin_ = 0;
  size_t line_ = 1, column_ = 1;  // Location of the last word.
  absl::Status status_;
};

struct IesHead {
  bool has_lamp_factor = true;  // Until 1995; later the number is unused.
  bool dims_when_tilted = false;
};

// The values before the numbers of the luminaire.
IesHead SkipHead(IesText* text) {
  IesHead head;
  for (bool is_first = true; !text->AtEnd(); is_first = false) {
    const std::string line(text->TakeLine());
    if (is_first) {
      head.has_lamp_factor =
          !absl::StrContains(line, "LM-63-2002") && !absl::StrContains(line, "LM-63-2019");
    }
    const size_t begin = std::min(line.find_first_not_of(" \t"), line.size());
    if (line.compare(begin, 5, "TILT=") != 0) continue;
    head.dims_when_tilted = !absl::StrContains(line, "NONE");
    if (!absl::StrContains(line, "INCLUDE")) return head;
    text->Number("the lamp-to-luminaire geometry");
    const int32_t count = text->Count("the number of tilt angles", 0, kCandelaCountMax);
    for (int32_t i = 0; i < 2 * count && text->status().ok(); ++i) text->Number("a tilt factor");
    return head;
  }
  text->Fail("there is no line TILT=NONE; is it an IES (LM-63) file?");
  return head;
}

std::vector<float> ReadAngles(IesText* text, int32_t count, const char* what, float max) {
  std::vector<float> angles;
  for (int32_t i = 0; i < count && text->status().ok(); ++i) {
    const float angle = text->Number(what);
    if (!(angle >= 0 && angle <= max)) {
      text->Fail(absl::StrCat(what, " is ", angle, ", outside of [0, ", max, "] degrees"));
    } else if (!angles.empty() && !(angle > angles.back())) {
      text->Fail(absl::StrCat(what, " is ", angle, " after ", angles.back(),
                              ", but angles must increase"));
    }
    angles.push_back(angle);
  }
  return angles;
}

// Expands the measured planes to the full circle, ascending in [0, 360): each as its angle and its
// index among the measured planes. Empty if they do not form a part that LM-63 defines.
std::vector<std::pair<float, size_t>> UnfoldPlanes(const std::vector<float>& measured) {
  std::vector<std::pair<float, size_t>> planes;
  const float first = measured.front(), last = measured.back();
  const bool is_quarter = first == 0 && last == 90, is_half = first == 0 && last == 180;
  const bool is_side_half = first == 90 && last == 270, is_whole = first == 0 && last > 180;
  if (measured.size() > 1 && !is_quarter && !is_half && !is_side_half && !is_whole) return planes;
  const auto add = [&](float angle, size_t plane) {
    planes.emplace_back(angle >= 360 ? angle - 360 : angle, plane);
  };
  for (size_t i = 0; i < measured.size(); ++i) {
    const float angle = measured[i];
    add(angle, i);
    if (is_quarter || is_half) add(360 - angle, i);
    if (is_quarter) add(180 - angle, i);
    if (is_quarter) add(180 + angle, i);
    if (is_side_half) add(540 - angle, i);
  }
  // A plane on a plane of symmetry is its own mirror image; of 0 and 360, the first one counts.
  std::stable_sort(planes.begin(), planes.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  planes.erase(std::unique(planes.begin(), planes.end(),
                           [](const auto& a, const auto& b) { return a.first == b.first; }),
               planes.end());
  return planes;
}

std::vector<float> ReadCandelas(IesText* text, int64_t count, double factor) {
  std::vector<float> candelas;
  for (int64_t i = 0; i < count && text->status().ok(); ++i) {
    const float value = static_cast<float>(static_cast<double>(text->Number("a candela")) * factor);
    if (!(value >= 0 && std::isfinite(value))) {
      text->Fail(absl::StrCat("a candela value is ", value,
                              " with its multipliers, but light must be finite and not negative"));
    }
    candelas.push_back(value);
  }
  return candelas;
}

}  // namespace

bool IsIesFileName(const std::string& name) { return absl::EndsWithIgnoreCase(name, ".ies"); }

absl::StatusOr<CandelaTable> ReadIes(const std::string& name, const std::string& path) {
  const absl::StatusOr<std::string> bytes = ReadText(path);
  if (!bytes.ok()) return Annotate(bytes.status(), name);
  IesText text(name, *bytes);
  const IesHead head = SkipHead(&text);
  text.Number("the number of lamps");
  text.Number("the lumens of a lamp");
  double factor = static_cast<double>(text.Number("the candela multiplier"));
  const int32_t vertical_count = text.Count("the number of vertical angles", 2, kCandelaCountMax);
  const int32_t horizontal_count = text.Count("the number of horizontal angles", 1,
                                              kCandelaCountMax / std::max(vertical_count, 1));
  if (text.Count("the photometric type", 1, 3) != 1) {
    text.Fail("photometry of types A and B is not supported; Sheaf supports type C, which is 1");
  }
  for (const char* what : {"the type of units", "the width", "the length", "the height"}) {
    text.Number(what);
  }
  factor *= static_cast<double>(text.Number("the ballast factor"));
  const double lamp_factor = static_cast<double>(text.Number("the ballast-lamp factor"));
  if (head.has_lamp_factor) factor *= lamp_factor;
  text.Number("the input watts");
  CandelaTable table;
  table.dims_when_tilted = head.dims_when_tilted;
  table.vertical_degrees = ReadAngles(&text, vertical_count, "a vertical angle", 180);
  const std::vector<float> measured =
      ReadAngles(&text, horizontal_count, "a horizontal angle", 360);
  if (!text.status().ok()) return text.status();
  const auto planes = UnfoldPlanes(measured);
  if (planes.empty()) {
    text.Fail(absl::StrCat("horizontal angles go from ", measured.front(), " to ", measured.back(),
                           " degrees; LM-63 has 0, 0 to 90, 0 to 180, 90 to 270 and 0 to 360"));
  }
  const std::vector<float> candelas =
      ReadCandelas(&text, int64_t{horizontal_count} * vertical_count, factor);
  if (!text.status().ok()) return text.status();
  for (const auto& [angle, plane] : planes) {
    table.horizontal_degrees.push_back(angle);
    const auto begin = candelas.begin() + static_cast<int64_t>(plane) * vertical_count;
    table.candelas.insert(table.candelas.end(), begin, begin + vertical_count);
  }
  return table;
}

}  // namespace sheaf
