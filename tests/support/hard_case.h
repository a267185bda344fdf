// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HardCase: one figure of a row of docs/hard-cases.md. A test expects it and records it in one
// call, so that the page which tests/hard_cases/hard_cases.py writes shows the values that the test
// compared.
#pragma once

#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <type_traits>

#include "gtest/gtest.h"

namespace sheaf {

// A value of any arithmetic type, as a double.
struct Figure {
  template <typename T, typename = std::enable_if_t<std::is_arithmetic_v<T>>>
  Figure(T v) : value(static_cast<double>(v)) {}  // NOLINT: tests write plain numbers.
  double value;
};

struct HardCase {
  // As in the document: "G1".
  std::string row;
  // The measured quantity in a few words. A later figure with the same text replaces it.
  std::string figure;
  Figure expected;
  Figure measured;
  // The measured value may deviate by kStandardErrorsMax standard errors plus the tolerance.
  Figure standard_error = 0;
  Figure tolerance = 0;
  // The result of the naive formula for the same input, computed in single precision, and that
  // formula in a few words. nullopt if the document says why there is none.
  std::optional<Figure> naive = std::nullopt;
  std::string naive_by = "";
};

inline constexpr double kStandardErrorsMax = 5;

// A value within the text of a figure: "1.5", "1e-09".
inline std::string InWords(Figure value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.7g", value.value);
  return text;
}

namespace hard_case_internal {

// JSON has neither NaN nor infinity, so these become strings.
inline std::string NumberText(double value) {
  if (std::isnan(value)) return "\"nan\"";
  if (std::isinf(value)) return value > 0 ? "\"inf\"" : "\"-inf\"";
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

}  // namespace hard_case_internal

// Fails the test if the measured value is outside its error bar or is NaN. Records the figure as a
// property of the test, "hard_case ROW FIGURE", whose value is a JSON object; names and texts must
// not contain quotes or backslashes.
inline void ExpectHardCase(const HardCase& c) {
  using hard_case_internal::NumberText;
  const double bar = kStandardErrorsMax * c.standard_error.value + c.tolerance.value;
  EXPECT_LE(std::fabs(c.measured.value - c.expected.value), bar)
      << c.row << ", " << c.figure << ": measured " << c.measured.value << " for "
      << c.expected.value;
  ::testing::Test::RecordProperty(
      "hard_case " + c.row + " " + c.figure,
      "{\"expected\": " + NumberText(c.expected.value) +
          ", \"measured\": " + NumberText(c.measured.value) + ", \"standard_error\": " +
          NumberText(c.standard_error.value) + ", \"tolerance\": " + NumberText(c.tolerance.value) +
          (c.naive ? ", \"naive\": " + NumberText(c.naive->value) : "") + ", \"naive_by\": \"" +
          c.naive_by + "\"}");
}

}  // namespace sheaf
