// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Numbers of scene and mesh files: correctly rounded, independent of the locale, whole words only.
#pragma once

#include <charconv>
#include <cstdint>
#include <string_view>
#include <system_error>

namespace sheaf {
namespace number_internal {

template <typename T>
bool ParseWhole(std::string_view text, T* value) {
  const char* begin = text.data();
  const char* const end = begin + text.size();
  if (begin != end && *begin == '+') ++begin;
  // Rejects "nan", "inf" and "+-1", which from_chars would accept.
  if (begin == end || !((*begin >= '0' && *begin <= '9') || *begin == '.' ||
                        (*begin == '-' && begin == text.data()))) {
    return false;
  }
  if (*begin == '-' && (begin + 1 == end || begin[1] == 'n' || begin[1] == 'i')) return false;
  const auto [rest, error] = std::from_chars(begin, end, *value);
  return error == std::errc() && rest == end;
}

}  // namespace number_internal

// True if all of text is a number that T can hold; otherwise *value is unspecified. Floating-point
// values too small for T become 0 or denormal; values too large are rejected.
bool ParseFloat(std::string_view text, float* value);
bool ParseDouble(std::string_view text, double* value);
inline bool ParseInteger(std::string_view text, int32_t* value) {
  return number_internal::ParseWhole(text, value);
}
inline bool ParseInteger(std::string_view text, uint32_t* value) {
  return number_internal::ParseWhole(text, value);
}
inline bool ParseInteger(std::string_view text, int64_t* value) {
  return number_internal::ParseWhole(text, value);
}
inline bool ParseInteger(std::string_view text, uint64_t* value) {
  return number_internal::ParseWhole(text, value);
}

}  // namespace sheaf
