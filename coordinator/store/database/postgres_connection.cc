// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/database/postgres_connection.h"

#include <libpq-fe.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "common/base/steady_time.h"

namespace sheaf::coordinator {
namespace {

// The OIDs of types, fixed in PostgreSQL's catalog (pg_type.dat).
constexpr Oid kBool = 16, kBytea = 17, kInt8 = 20, kInt2 = 21, kInt4 = 23, kText = 25;
constexpr Oid kFloat8 = 701;
constexpr int kBinary = 1;
// The oldest maintained version; Debian 12 has 15.
constexpr int kServerVersionMin = 130000;
// Limit of one attempt to connect, in seconds, and of unacknowledged data, in milliseconds.
constexpr char kConnectTimeout[] = "5";
constexpr char kTcpUserTimeout[] = "10000";
constexpr absl::Duration kReconnectInterval = absl::Milliseconds(50);
// A store has some ninety statements.
constexpr size_t kPreparedMax = 500;

std::string BigEndian(uint64_t value) {
  std::string bytes;
  for (int shift = 56; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xff);
  return bytes;
}

uint64_t FromBigEndian(const char* bytes, int count) {
  uint64_t value = 0;
  for (int i = 0; i < count; ++i) value = value << 8 | static_cast<unsigned char>(bytes[i]);
  return value;
}

std::string OneLine(const char* message) {
  const std::string text(absl::StripAsciiWhitespace(message == nullptr ? "" : message));
  return absl::StrReplaceAll(text, {{"\n", "; "}});
}

// By the classes of SQLSTATE.
absl::Status StatusFromState(const std::string& state, const std::string& message) {
  if (state == "23505") return absl::AlreadyExistsError(message);
  if (state == "53100") {  // With the system's message, as for files.
    return absl::ResourceExhaustedError(absl::StrCat(message, ": ", std::strerror(ENOSPC)));
  }
  if (absl::StartsWith(state, "28") || state == "42501") {
    return absl::PermissionDeniedError(message);
  }
  if (absl::StartsWith(state, "XX00") && state != "XX000") return absl::DataLossError(message);
  if (state == "22021" || state == "22P05") return absl::InvalidArgumentError(message);
  return absl::UnavailableError(message);
}

}  // namespace

PostgresValue PostgresInt64(int64_t value) {
  return {kInt8, BigEndian(static_cast<uint64_t>(value))};
}
PostgresValue PostgresDouble(double value) {
  return {kFloat8, BigEndian(std::bit_cast<uint64_t>(value))};
}
PostgresValue PostgresText(std::string_view text) { return {kText, std::string(text)}; }
PostgresValue PostgresBytes(std::string_view bytes) { return {kBytea, std::string(bytes)}; }

void PostgresResult::Clear::operator()(pg_result* result) const { PQclear(result); }

int PostgresResult::RowCount() const { return PQntuples(result_.get()); }

int64_t PostgresResult::ChangedRows() const {
  int64_t count = 0;
  // Empty after statements that change no rows.
  return absl::SimpleAtoi(PQcmdTuples(result_.get()), &count) ? count : 0;
}

std::string PostgresResult::Command() const { return PQcmdStatus(result_.get()); }

int64_t PostgresResult::Int64(int row, int column) const {
  const char* const bytes = PQgetvalue(result_.get(), row, column);
  const int length = PQgetlength(result_.get(), row, column);
  if (PQfformat(result_.get(), column) != kBinary) {
    int64_t value = 0;
    return absl::SimpleAtoi(absl::string_view(bytes, static_cast<size_t>(length)), &value) ? value
                                                                                           : 0;
  }
  const uint64_t value = FromBigEndian(bytes, length);
  switch (PQftype(result_.get(), column)) {
    case kInt8:
      return static_cast<int64_t>(value);
    case kInt4:
      return static_cast<int32_t>(value);
    case kInt2:
      return static_cast<int16_t>(value);
    case kBool:
      return value != 0 ? 1 : 0;
    default:
      return 0;
  }
}

double PostgresResult::Double(int row, int column) const {
  if (PQftype(result_.get(), column) != kFloat8) return static_cast<double>(Int64(row, column));
  const char* const bytes = PQgetvalue(result_.get(), row, column);
  return std::bit_cast<double>(FromBigEndian(bytes, PQgetlength(result_.get(), row, column)));
}

std::string PostgresResult::Text(int row, int column) const {
  return {PQgetvalue(result_.get(), row, column),
          static_cast<size_t>(PQgetlength(result_.get(), row, column))};
}

absl::StatusOr<std::unique_ptr<PostgresConnection>> PostgresConnection::Open(
    const std::string& url, const std::string& settings) {
  // The part before "dbname" applies unless the URL overrides it.
  const std::array<const char*, 5> names = {"connect_timeout", "tcp_user_timeout",
                                            "fallback_application_name", "dbname", nullptr};
  const std::array<const char*, 5> values = {kConnectTimeout, kTcpUserTimeout, "sheaf-coordinator",
                                             url.c_str(), nullptr};
  std::unique_ptr<PostgresConnection> connection(new PostgresConnection(
      PQconnectdbParams(names.data(), values.data(), /*expand_dbname=*/1), settings));
  if (connection->IsLost()) return connection->ConnectionError();
  if (absl::Status status = connection->Begin(); !status.ok()) return status;
  return connection;
}

PostgresConnection::~PostgresConnection() { PQfinish(connection_); }

std::string PostgresConnection::Name() const {
  const char* const database = PQdb(connection_);
  const char* const host = PQhost(connection_);
  const char* const port = PQport(connection_);
  return absl::StrCat("the PostgreSQL database ", database == nullptr ? "" : database, " at ",
                      host == nullptr ? "" : host, ":", port == nullptr ? "" : port);
}

bool PostgresConnection::IsLost() const { return lost_ || PQstatus(connection_) != CONNECTION_OK; }

absl::Status PostgresConnection::ConnectionError() const {
  return absl::UnavailableError(absl::StrCat(Name(), ": ", OneLine(PQerrorMessage(connection_))));
}

absl::Status PostgresConnection::Begin() {
  prepared_.clear();
  // Drop notices, such as that a table exists already.
  PQsetNoticeProcessor(
      connection_, [](void*, const char*) {}, nullptr);
  if (PQserverVersion(connection_) < kServerVersionMin) {
    return absl::FailedPreconditionError(
        absl::StrCat(Name(), ": the server's version is below ", kServerVersionMin / 10000));
  }
  const char* const encoding = PQparameterStatus(connection_, "server_encoding");
  if (encoding == nullptr || std::string_view(encoding) != "UTF8") {
    return absl::FailedPreconditionError(
        absl::StrCat(Name(), ": its encoding is ", encoding == nullptr ? "unknown" : encoding,
                     "; make a database with createdb --encoding UTF8 --template template0"));
  }
  return Run(absl::StrCat("SET client_encoding TO 'UTF8';", settings_)).status();
}

absl::Status PostgresConnection::Reconnect(absl::Duration wait_max) {
  const SteadyTime end = SteadyTime::Now() + wait_max;
  while (true) {
    PQreset(connection_);
    lost_ = false;
    if (!IsLost()) return Begin();
    if (end < SteadyTime::Now()) return ConnectionError();
    absl::SleepFor(kReconnectInterval);
  }
}

absl::StatusOr<PostgresResult> PostgresConnection::Checked(PostgresResult result, pg_result* raw) {
  const ExecStatusType status = PQresultStatus(raw);
  if (status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK || status == PGRES_EMPTY_QUERY) {
    return result;
  }
  const char* const state = PQresultErrorField(raw, PG_DIAG_SQLSTATE);
  if (state == nullptr) {
    lost_ = true;
    return ConnectionError();
  }
  // The server ends the connection after such an error.
  const char* const severity = PQresultErrorField(raw, PG_DIAG_SEVERITY_NONLOCALIZED);
  if (severity != nullptr && std::string_view(severity) != "ERROR") lost_ = true;
  return StatusFromState(
      state, absl::StrCat(Name(), ": ", OneLine(PQresultErrorField(raw, PG_DIAG_MESSAGE_PRIMARY))));
}

absl::StatusOr<PostgresResult> PostgresConnection::Run(const std::string& sql) {
  pg_result* const raw = PQexec(connection_, sql.c_str());
  return Checked(PostgresResult(raw), raw);
}

absl::StatusOr<std::string> PostgresConnection::NameOf(const std::string& sql,
                                                       const std::vector<PostgresValue>& values) {
  std::string key;
  std::vector<Oid> types;
  for (const PostgresValue& value : values) {
    types.push_back(value.type);
    absl::StrAppend(&key, value.type, " ");
  }
  key += sql;
  const auto found = prepared_.find(key);
  if (found != prepared_.end()) return found->second;
  if (prepared_.size() >= kPreparedMax) {
    if (absl::Status status = Run("DEALLOCATE ALL").status(); !status.ok()) return status;
    prepared_.clear();
  }
  const std::string name = absl::StrCat("s", prepared_.size());
  pg_result* const raw = PQprepare(connection_, name.c_str(), sql.c_str(),
                                   static_cast<int>(types.size()), types.data());
  if (absl::Status status = Checked(PostgresResult(raw), raw).status(); !status.ok()) return status;
  prepared_[key] = name;
  return name;
}

absl::StatusOr<PostgresResult> PostgresConnection::Run(const std::string& sql,
                                                       const std::vector<PostgresValue>& values) {
  const absl::StatusOr<std::string> name = NameOf(sql, values);
  if (!name.ok()) return name.status();
  std::vector<const char*> pointers;
  std::vector<int> lengths;
  for (const PostgresValue& value : values) {
    pointers.push_back(value.bytes.data());  // Not null, even without bytes.
    lengths.push_back(static_cast<int>(value.bytes.size()));
  }
  const std::vector<int> formats(values.size(), kBinary);
  pg_result* const raw = PQexecPrepared(connection_, name->c_str(), static_cast<int>(values.size()),
                                        pointers.data(), lengths.data(), formats.data(), kBinary);
  return Checked(PostgresResult(raw), raw);
}

}  // namespace sheaf::coordinator
