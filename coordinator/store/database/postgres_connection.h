// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PostgresConnection: one connection to a PostgreSQL server, by libpq. All access to libpq goes
// through this file.
//
// Source: "libpq - C Library" and "PostgreSQL Error Codes" of PostgreSQL's manual.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

struct pg_conn;
struct pg_result;

namespace sheaf::coordinator {

// A parameter in libpq's binary form.
struct PostgresValue {
  uint32_t type = 0;  // The OID of its type.
  std::string bytes;
};
PostgresValue PostgresInt64(int64_t value);
PostgresValue PostgresDouble(double value);
PostgresValue PostgresText(std::string_view text);
PostgresValue PostgresBytes(std::string_view bytes);

// The rows of a statement. Rows and columns count from 0; a column without a value reads as 0 or
// "".
class PostgresResult {
 public:
  explicit PostgresResult(pg_result* result) : result_(result) {}
  int RowCount() const;
  // How many rows the statement inserted, changed or removed.
  int64_t ChangedRows() const;
  // The server's answer, e.g. "COMMIT".
  std::string Command() const;
  int64_t Int64(int row, int column) const;
  double Double(int row, int column) const;
  std::string Text(int row, int column) const;

 private:
  struct Clear {
    void operator()(pg_result* result) const;
  };
  std::unique_ptr<pg_result, Clear> result_;
};

// Thread safety: one thread at a time.
class PostgresConnection {
 public:
  // url: postgresql://USER@HOST:PORT/DATABASE, or "host=... dbname=...". settings: statements with
  // which each connection begins. Errors: kUnavailable, kPermissionDenied, kFailedPrecondition (the
  // server is too old, or its database does not hold UTF-8), with its name and without a password.
  static absl::StatusOr<std::unique_ptr<PostgresConnection>> Open(const std::string& url,
                                                                  const std::string& settings);
  ~PostgresConnection();
  PostgresConnection(const PostgresConnection&) = delete;
  PostgresConnection& operator=(const PostgresConnection&) = delete;

  // "the PostgreSQL database farm at db.example.org:5432".
  std::string Name() const;
  // Whether the connection ended: the last statement may or may not have been executed.
  bool IsLost() const;
  // Connects again; tries until `wait_max` has passed. Errors: those of Open.
  absl::Status Reconnect(absl::Duration wait_max);

  // Runs statements without parameters, separated by semicolons, and returns the rows of the last.
  // Errors: kAlreadyExists (a key exists already), kResourceExhausted (disk full),
  // kPermissionDenied, kDataLoss, kInvalidArgument (text that the database cannot hold),
  // kUnavailable.
  absl::StatusOr<PostgresResult> Run(const std::string& sql);
  // Runs one statement; its text is parsed once for each connection.
  absl::StatusOr<PostgresResult> Run(const std::string& sql,
                                     const std::vector<PostgresValue>& values);

 private:
  PostgresConnection(pg_conn* connection, std::string settings)
      : connection_(connection), settings_(std::move(settings)) {}
  absl::Status Begin();
  absl::Status ConnectionError() const;
  absl::StatusOr<PostgresResult> Checked(PostgresResult result, pg_result* raw);
  absl::StatusOr<std::string> NameOf(const std::string& sql,
                                     const std::vector<PostgresValue>& values);

  pg_conn* const connection_;
  const std::string settings_;
  bool lost_ = false;                            // libpq's own status may say so one call later.
  std::map<std::string, std::string> prepared_;  // Names of prepared statements, by types and text.
};

}  // namespace sheaf::coordinator
