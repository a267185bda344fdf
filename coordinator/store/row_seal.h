// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Seals: digests of a row's columns, stored in the row. SQLite checks the structure of a database,
// not its values; a changed bit in a seed or in a number of samples would give another image.
#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "coordinator/store/row_columns.h"

namespace sheaf::coordinator {

// The seal of rows that versions of Sheaf without seals wrote: it is not checked.
inline constexpr int64_t kNoSeal = 0;

// A digest of the text as a number that is not kNoSeal.
int64_t SealOfText(const std::string& text);

// The seal of the columns that visit_columns passes to its argument, a visitor of names and values.
template <typename VisitAll>
int64_t SealOfColumns(const VisitAll& visit_columns) {
  std::string text;
  visit_columns([&text](const char* name, const auto& value) {
    const auto& stored = StoredForm(value);
    using Stored = std::remove_cvref_t<decltype(stored)>;
    if constexpr (std::is_same_v<Stored, StoredBytes>) {
      absl::StrAppend(&text, name, " ", stored.bytes, "\n");
    } else if constexpr (std::is_same_v<Stored, double>) {
      // SQLite stores a negative zero as 0.
      absl::StrAppendFormat(&text, "%s %.17g\n", name, stored == 0 ? 0.0 : stored);
    } else {
      absl::StrAppend(&text, name, " ", stored, "\n");
    }
  });
  return SealOfText(text);
}

// A row and its seal, in the column `seal`.
template <typename Row>
struct Sealed {
  Row row;
  int64_t seal = kNoSeal;

  // Whether the row is unchanged since it was written.
  bool IsWhole() const { return seal == kNoSeal || seal == Seal(row).seal; }
};

template <typename Row>
Sealed<Row> Seal(Row row) {
  const int64_t seal =
      SealOfColumns([&row](const auto& visit) { VisitColumns(std::as_const(row), visit); });
  return {std::move(row), seal};
}

template <typename Row, typename Visitor>
void VisitColumns(Sealed<Row>& sealed, const Visitor& visit) {
  VisitColumns(sealed.row, visit);
  visit("seal", sealed.seal);
}
template <typename Row, typename Visitor>
void VisitColumns(const Sealed<Row>& sealed, const Visitor& visit) {
  VisitColumns(sealed.row, visit);
  visit("seal", sealed.seal);
}

}  // namespace sheaf::coordinator
