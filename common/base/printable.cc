// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/printable.h"

#include <cstdint>

#include "absl/strings/str_format.h"

namespace sheaf {
namespace {

// Length of the printable character at the front of text; 0 if there is none. Not printable are
// controls (including U+0080 to U+009F, which some terminals obey, and those that change the
// direction of text), surrogates, overlong forms and invalid UTF-8.
size_t PrintableBytes(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  if (byte(0) < 0x80) return byte(0) >= 0x20 && byte(0) != 0x7f ? 1 : 0;
  const size_t size = byte(0) >= 0xf0 ? 4 : byte(0) >= 0xe0 ? 3 : 2;
  if (byte(0) < 0xc2 || byte(0) > 0xf4 || text.size() < size) return 0;
  uint32_t code = byte(0) & (0xffu >> (size + 1));
  for (size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
    code = code << 6 | (byte(i) & 0x3f);
  }
  constexpr uint32_t kSmallest[] = {0, 0, 0xa0, 0x800, 0x10000};
  const bool turns = (code >= 0x202a && code <= 0x202e) || (code >= 0x2066 && code <= 0x2069);
  const bool separates = code == 0x2028 || code == 0x2029;
  const bool is_surrogate = code >= 0xd800 && code <= 0xdfff;
  const bool is_character = code >= kSmallest[size] && code <= 0x10ffff && !is_surrogate;
  return is_character && !turns && !separates ? size : 0;
}

}  // namespace

size_t FindUnprintable(std::string_view text) {
  for (size_t at = 0; at < text.size();) {
    const size_t size = PrintableBytes(text.substr(at));
    if (size == 0) return at;
    at += size;
  }
  return std::string_view::npos;
}

std::string Printable(std::string_view text, size_t shown_bytes_max) {
  std::string shown;
  for (size_t at = 0; at < text.size();) {
    const size_t size = PrintableBytes(text.substr(at));
    if (at + size > shown_bytes_max || at >= shown_bytes_max) return shown + "...";
    if (size > 0) {
      shown.append(text.substr(at, size));
    } else if (text[at] == '\n') {
      shown += "\\n";
    } else if (text[at] == '\t') {
      shown += ' ';
    } else {
      shown += absl::StrFormat("\\x%02x", static_cast<uint8_t>(text[at]));
    }
    at += size > 0 ? size : 1;
  }
  return shown;
}

std::string PrintableLines(std::string_view text) {
  std::string shown;
  while (true) {
    const size_t end = text.find('\n');
    shown += Printable(text.substr(0, end));
    if (end == std::string_view::npos) return shown;
    shown += '\n';
    text.remove_prefix(end + 1);
  }
}

}  // namespace sheaf
