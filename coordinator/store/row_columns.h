// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rows as lists of named columns. For each row type one function lists its columns and the members
// that they store:
//
//     template <RowOf<TileCost> Row, typename Visitor>   // Row: TileCost or const TileCost.
//     void VisitColumns(Row& row, const Visitor& visit) {
//       visit("x0", row.tile.x0);
//       visit("cpu_ns", row.cpu_duration);
//     }
//
// The text of SELECT, INSERT and UPDATE and the code that binds and reads rows are derived from it,
// so no code refers to columns by number.
#pragma once

#include <concepts>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/time.h"
#include "common/film/error/rare_layers.h"
#include "common/film/film_outputs.h"
#include "common/scene/settings/techniques.h"
#include "coordinator/core/job/requirements.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/stored_times.h"

namespace sheaf::coordinator {

// A value that is stored as bytes instead of text.
struct StoredBytes {
  std::string bytes;
};

// "caustic 12 direct 3"; layer names contain no spaces.
std::string FormatLayers(const std::vector<LayerCount>& counts);
std::vector<LayerCount> ParseLayers(const std::string& text);

// A member as its column stores it: a whole number, a floating-point number, text or bytes.
template <typename T>
requires std::integral<T> || std::is_enum_v<T> int64_t StoredForm(T value) {
  return static_cast<int64_t>(value);
}
inline double StoredForm(float value) { return value; }
inline double StoredForm(double value) { return value; }
inline const std::string& StoredForm(const std::string& value) { return value; }
inline const StoredBytes& StoredForm(const StoredBytes& value) { return value; }
inline int64_t StoredForm(absl::Time value) { return ToNanoseconds(value); }
inline int64_t StoredForm(absl::Duration value) { return ToNanoseconds(value); }
inline int64_t StoredForm(TechniqueSet value) { return value.Number(); }
inline std::string StoredForm(const FilmOutputs& value) { return FormatOutputs(value); }
inline std::string StoredForm(const std::vector<LayerCount>& value) { return FormatLayers(value); }
inline std::string StoredForm(const std::vector<std::string>& tags) { return FormatTags(tags); }

// Binds a member as the statement's next parameter.
template <typename T>
void BindValue(const T& value, Statement* statement) {
  if constexpr (std::is_same_v<T, StoredBytes>) {
    statement->BindBytes(value.bytes);
  } else {
    statement->Bind(StoredForm(value));
  }
}

// Reads a member from a column of the statement's current row. Errors: kDataLoss.
template <typename T>
requires std::integral<T> || std::is_enum_v<T> absl::Status ReadValue(const Statement& row,
                                                                      int column, T* value) {
  *value = static_cast<T>(row.Int64(column));
  return absl::OkStatus();
}
template <std::floating_point T>
absl::Status ReadValue(const Statement& row, int column, T* value) {
  *value = static_cast<T>(row.Double(column));
  return absl::OkStatus();
}
inline absl::Status ReadValue(const Statement& row, int column, std::string* value) {
  *value = row.Text(column);
  return absl::OkStatus();
}
inline absl::Status ReadValue(const Statement& row, int column, StoredBytes* value) {
  value->bytes = row.Bytes(column);
  return absl::OkStatus();
}
inline absl::Status ReadValue(const Statement& row, int column, absl::Time* value) {
  *value = FromNanoseconds(row.Int64(column));
  return absl::OkStatus();
}
inline absl::Status ReadValue(const Statement& row, int column, absl::Duration* value) {
  *value = DurationFromNanoseconds(row.Int64(column));
  return absl::OkStatus();
}
absl::Status ReadValue(const Statement& row, int column, FilmOutputs* value);
absl::Status ReadValue(const Statement& row, int column, TechniqueSet* value);
inline absl::Status ReadValue(const Statement& row, int column, std::vector<LayerCount>* value) {
  *value = ParseLayers(row.Text(column));
  return absl::OkStatus();
}
inline absl::Status ReadValue(const Statement& row, int column, std::vector<std::string>* tags) {
  *tags = ParseTags(row.Text(column));
  return absl::OkStatus();
}

// The names of a row's columns, in the order in which they are bound and read.
template <typename Row>
std::vector<std::string> ColumnsOf() {
  std::vector<std::string> names;
  const Row row{};
  VisitColumns(row, [&](const char* name, const auto&) { names.push_back(name); });
  return names;
}

// "SELECT a, b FROM table ": a clause may follow.
template <typename Row>
std::string SelectFrom(const char* table) {
  return absl::StrCat("SELECT ", absl::StrJoin(ColumnsOf<Row>(), ", "), " FROM ", table, " ");
}

// "INTO table(a, b) VALUES(?,?)", after INSERT.
template <typename Row>
std::string IntoTable(const char* table) {
  const std::vector<std::string> names = ColumnsOf<Row>();
  return absl::StrCat("INTO ", table, "(", absl::StrJoin(names, ", "), ") VALUES(",
                      absl::StrJoin(std::vector<std::string>(names.size(), "?"), ","), ")");
}

// "INSERT INTO table(a, b) VALUES(?,?) ON CONFLICT(a) DO UPDATE SET ...": replaces the row with
// this key, if there is one. key: its columns, as "a, b".
template <typename Row>
std::string ReplaceIn(const char* table, const char* key) {
  const auto set = [](std::string* text, const std::string& name) {
    absl::StrAppend(text, name, " = excluded.", name);
  };
  return absl::StrCat("INSERT ", IntoTable<Row>(table), " ON CONFLICT(", key, ") DO UPDATE SET ",
                      absl::StrJoin(ColumnsOf<Row>(), ", ", set));
}

// "UPDATE table SET a = ?, b = ? ": a clause may follow.
template <typename Row>
std::string UpdateOf(const char* table) {
  return absl::StrCat("UPDATE ", table, " SET ", absl::StrJoin(ColumnsOf<Row>(), " = ?, "),
                      " = ? ");
}

// Binds all columns of the row as the statement's next parameters.
template <typename Row>
Statement& BindRow(const Row& row, Statement* statement) {
  VisitColumns(row, [&](const char*, const auto& value) { BindValue(value, statement); });
  return *statement;
}

// Reads the current row of a statement from SelectFrom<Row>. Errors: kDataLoss.
template <typename Row>
absl::Status ReadRow(const Statement& statement, Row* row) {
  absl::Status status;
  int column = 0;
  VisitColumns(*row, [&](const char*, auto& value) {
    status.Update(ReadValue(statement, column++, &value));
  });
  return status;
}

// Passes every row of the statement to take(row), which returns a status. Errors: those of Step,
// kDataLoss, those of `take`.
template <typename Row, typename Take>
absl::Status ReadRows(Statement* statement, const Take& take) {
  while (true) {
    const absl::StatusOr<bool> there = statement->Step();
    if (!there.ok()) return there.status();
    if (!*there) return absl::OkStatus();
    Row row;
    if (absl::Status status = ReadRow(*statement, &row); !status.ok()) return status;
    if (absl::Status status = take(std::move(row)); !status.ok()) return status;
  }
}

}  // namespace sheaf::coordinator
