// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/relative_name.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/base/printable.h"

namespace sheaf {
namespace {

constexpr size_t kShownBytesMax = 200;

// Empty: the name is good.
std::string WhyRefused(std::string_view name) {
  if (name.empty()) return "it is empty";
  if (name.size() > kRelativeNameBytesMax) {
    return absl::StrCat("it is longer than ", kRelativeNameBytesMax, " bytes");
  }
  if (name.front() == '/') return "it is absolute";
  if (FindUnprintable(name) != std::string_view::npos)
    return "it is not printable UTF-8; rename the file";
  if (name.find('\\') != std::string_view::npos) return "it contains \"\\\"";
  const std::vector<std::string> parts = absl::StrSplit(std::string(name), '/');
  if (parts.size() > kRelativeNamePartsMax) {
    return absl::StrCat("it has more than ", kRelativeNamePartsMax, " parts");
  }
  for (const std::string& part : parts) {
    if (part.empty()) return "a part of it is empty";
    if (part == "." || part == "..") return absl::StrCat("\"", part, "\" is a part of it");
    if (part.size() > kRelativeNamePartBytesMax) {
      return absl::StrCat("a part of it is longer than ", kRelativeNamePartBytesMax, " bytes");
    }
  }
  return "";
}

}  // namespace

absl::Status CheckRelativeName(std::string_view name) {
  const std::string why = WhyRefused(name);
  if (why.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("the file name \"", Printable(name, kShownBytesMax), "\" is refused: ", why));
}

}  // namespace sheaf
