// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/number.h"

#include <cmath>
#include <string>

namespace sheaf {
namespace {

// from_chars returns result_out_of_range for both too large and too small numbers. The decimal
// exponent distinguishes them: only numbers of magnitude below 1 can underflow.
template <typename T>
bool ParseFloating(std::string_view text, T* value) {
  if (number_internal::ParseWhole(text, value)) return true;
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  if (text.empty() || text.size() > 400) return false;
  T ignored = 0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), ignored);
  if (error != std::errc::result_out_of_range || rest != text.data() + text.size()) return false;
  const size_t exponent = text.find_first_of("eE");
  const bool is_tiny =
      exponent != std::string_view::npos && exponent + 1 < text.size() && text[exponent + 1] == '-';
  if (!is_tiny) return false;
  *value = text.front() == '-' ? T(-0.0) : T(0);
  return true;
}

}  // namespace

bool ParseFloat(std::string_view text, float* value) { return ParseFloating(text, value); }
bool ParseDouble(std::string_view text, double* value) { return ParseFloating(text, value); }

}  // namespace sheaf
