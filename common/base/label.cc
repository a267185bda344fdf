// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/label.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "common/base/printable.h"

namespace sheaf {

std::string WhyNoLabel(const std::string& text) {
  const auto is_label_byte = [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '-' || c == '_' ||
           c == '@';
  };
  const bool fits = !text.empty() && text.size() <= kLabelBytesMax;
  if (fits && std::ranges::all_of(text, is_label_byte)) return "";
  return absl::StrCat("\"", Printable(text.substr(0, kLabelBytesMax)), "\" is not 1 to ",
                      kLabelBytesMax, " letters, digits, '.', '-', '_' or '@'");
}

}  // namespace sheaf
