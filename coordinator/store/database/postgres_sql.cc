// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/database/postgres_sql.h"

#include <array>
#include <cstddef>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace sheaf::coordinator {
namespace {

constexpr std::array<std::pair<std::string_view, std::string_view>, 4> kWords = {{
    {"INTEGER", "BIGINT"},
    {"REAL", "DOUBLE PRECISION"},
    {"BLOB", "BYTEA"},
    {"AUTOINCREMENT", ""},
}};
constexpr std::string_view kWithoutRowid = "WITHOUT ROWID";

bool IsWordCharacter(char c) { return absl::ascii_isalnum(c) || c == '_'; }

// The length of the quoted text at the start of `sql`; 0 if there is none. A doubled quote within
// it ends one text and begins another, with the same effect.
size_t QuotedLength(std::string_view sql) {
  if (sql.empty() || (sql[0] != '\'' && sql[0] != '"')) return 0;
  const size_t end = sql.find(sql[0], 1);
  return end == std::string_view::npos ? sql.size() : end + 1;
}

size_t LengthWhile(std::string_view text, bool (*holds)(char)) {
  size_t length = 0;
  while (length < text.size() && holds(text[length])) ++length;
  return length;
}

}  // namespace

std::string PostgresParameters(std::string_view sql) {
  std::string result;
  int count = 0;
  while (!sql.empty()) {
    size_t length = QuotedLength(sql);
    if (length == 0 && sql[0] == '?') {
      const size_t digits =
          LengthWhile(sql.substr(1), [](char c) { return absl::ascii_isdigit(c); });
      length = 1 + digits;
      absl::StrAppend(&result, "$");
      if (digits == 0) {
        absl::StrAppend(&result, ++count);
      } else {
        result.append(sql.substr(1, digits));
      }
    } else {
      if (length == 0) length = 1;
      result.append(sql.substr(0, length));
    }
    sql.remove_prefix(length);
  }
  return result;
}

std::string PostgresScript(std::string_view sql) {
  std::string result;
  while (!sql.empty()) {
    size_t length = QuotedLength(sql);
    if (length == 0 && sql.starts_with(kWithoutRowid)) {
      sql.remove_prefix(kWithoutRowid.size());
      continue;
    }
    if (length == 0) length = LengthWhile(sql, IsWordCharacter);
    if (length == 0) length = 1;
    std::string_view word = sql.substr(0, length);
    for (const auto& [from, to] : kWords) {
      if (word == from) word = to;
    }
    result.append(word);
    sql.remove_prefix(length);
  }
  return result;
}

bool IsQuery(std::string_view sql) {
  const size_t begin = sql.find_first_not_of(" \n");
  return begin != std::string_view::npos && sql.substr(begin).starts_with("SELECT");
}

}  // namespace sheaf::coordinator
