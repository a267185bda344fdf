// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/part_rows.h"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator::rows {
namespace {

// Numbers of rows that one statement may insert: the first that is at most the number left. Each
// statement is prepared once per connection, so there are few; with the columns of a row they stay
// far below SQLite's 32,766 parameters.
constexpr std::array<size_t, 4> kStatementRows = {128, 32, 8, 2};

absl::Status KeyHasPart() { return absl::AlreadyExistsError("the key has a part already"); }

size_t StatementRows(size_t left) {
  const auto fits = std::ranges::find_if(kStatementRows, [left](size_t n) { return n <= left; });
  return fits == kStatementRows.end() ? 1 : *fits;
}

// Inserts several rows by one statement, because PostgreSQL answers each statement after a round
// trip (docs/adr/0081). Reports for each row whether it is stored; a row whose key has a part is
// not.
// Requires: no two rows are equal.
absl::StatusOr<std::vector<bool>> InsertTogether(std::span<const PartRow* const> rows,
                                                 Database* database) {
  const std::string marks =
      absl::StrJoin(std::vector<std::string>(ColumnsOf<Sealed<PartRow>>().size(), "?"), ",");
  std::string sql = absl::StrCat("INSERT ", IntoTable<Sealed<PartRow>>("parts"));
  for (size_t i = 1; i < rows.size(); ++i) absl::StrAppend(&sql, ",(", marks, ")");
  Statement insert = database->Prepare(absl::StrCat(sql, " ON CONFLICT DO NOTHING RETURNING seal"));
  std::vector<int64_t> seals;
  for (const PartRow* row : rows) {
    const Sealed<PartRow> sealed = Seal(*row);
    seals.push_back(sealed.seal);
    BindRow(sealed, &insert);
  }
  std::set<int64_t> stored;
  while (true) {
    const absl::StatusOr<bool> row = insert.Step();
    if (!row.ok()) return row.status();
    if (!*row) break;
    stored.insert(insert.Int64(0));
  }
  std::vector<bool> is_stored;
  for (const int64_t seal : seals) is_stored.push_back(stored.contains(seal));
  return is_stored;
}

constexpr char kWhereKey[] =
    "WHERE job_id = ? AND frame_number = ? AND y0 = ? AND x0 = ? AND first = ? AND count = ? AND "
    "cells = ? AND kind = ?";

void BindKey(const PartKey& key, Statement* statement) {
  statement->Bind(key.frame.job_id)
      .Bind(key.frame.frame_number)
      .Bind(key.tile.y0)
      .Bind(key.tile.x0)
      .Bind(key.block.first)
      .Bind(key.block.count)
      .Bind(key.cells.mask)
      .Bind(StoredForm(key.kind));
}

}  // namespace

absl::Status InsertPart(const PartRow& row, Database* database) {
  // An error would end a transaction of PostgreSQL.
  Statement insert = database->Prepare(
      absl::StrCat("INSERT ", IntoTable<Sealed<PartRow>>("parts"), " ON CONFLICT DO NOTHING"));
  if (absl::Status status = BindRow(Seal(row), &insert).Run(); !status.ok()) return status;
  return database->ChangedRows() == 1 ? absl::OkStatus() : KeyHasPart();
}

absl::Status InsertParts(std::span<const PartRow* const> rows, std::vector<absl::Status>* outcomes,
                         Database* database) {
  outcomes->assign(rows.size(), absl::OkStatus());
  for (size_t first = 0; first < rows.size();) {
    const size_t count = StatementRows(rows.size() - first);
    if (count == 1) {
      absl::Status& outcome = (*outcomes)[first];
      outcome = InsertPart(*rows[first], database);
      // A key that exists already affects only its own row. Other errors may have ended the
      // transaction, and later rows would then be inserted outside it.
      if (!outcome.ok() && !absl::IsAlreadyExists(outcome)) return outcome;
    } else {
      const absl::StatusOr<std::vector<bool>> is_stored =
          InsertTogether(rows.subspan(first, count), database);
      if (!is_stored.ok()) return is_stored.status();
      for (size_t i = 0; i < count; ++i) {
        if (!(*is_stored)[i]) (*outcomes)[first + i] = KeyHasPart();
      }
    }
    first += count;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<PartRow>> LoadPartRows(uint64_t job_id, std::vector<PartRow>* lost,
                                                  Database* database) {
  Statement query =
      database->Prepare(absl::StrCat(SelectFrom<Sealed<PartRow>>("parts"), "WHERE job_id = ?"));
  query.Bind(job_id);
  return ReadPartRows(&query, lost);
}

absl::StatusOr<std::optional<PartRow>> FindPart(const PartKey& key, Database* database) {
  Statement query =
      database->Prepare(absl::StrCat(SelectFrom<Sealed<PartRow>>("parts"), kWhereKey));
  BindKey(key, &query);
  absl::StatusOr<std::vector<PartRow>> rows = ReadPartRows(&query);
  if (!rows.ok()) return rows.status();
  if (rows->empty()) return std::optional<PartRow>();
  return std::optional<PartRow>(std::move(rows->front()));
}

absl::StatusOr<std::vector<PartRow>> FindTileParts(const FrameId& frame, const PixelRect& tile,
                                                   TaskKind kind, Database* database) {
  Statement query = database->Prepare(
      absl::StrCat(SelectFrom<Sealed<PartRow>>("parts"),
                   "WHERE job_id = ? AND frame_number = ? AND kind = ? AND y0 = ? AND x0 = ? "
                   "ORDER BY first"));
  query.Bind(frame.job_id)
      .Bind(frame.frame_number)
      .Bind(StoredForm(kind))
      .Bind(tile.y0)
      .Bind(tile.x0);
  return ReadPartRows(&query);
}

absl::StatusOr<std::vector<PartRow>> ListParts(uint64_t job_id, Database* database) {
  Statement query =
      database->Prepare(absl::StrCat(SelectFrom<Sealed<PartRow>>("parts"), "WHERE job_id = ?"));
  query.Bind(job_id);
  return ReadPartRows(&query);
}

absl::StatusOr<std::vector<PartRow>> FindPartsOf(const std::string& identity, Database* database) {
  Statement query = database->Prepare(
      absl::StrCat(SelectFrom<Sealed<PartRow>>("parts"), "WHERE identity = ? ORDER BY job_id"));
  query.Bind(identity);
  return ReadPartRows(&query);
}

absl::StatusOr<std::vector<JobStore::TileCost>> TileCosts(const FrameId& frame,
                                                          Database* database) {
  Statement query = database->Prepare(
      absl::StrCat(SelectFrom<JobStore::TileCost>("parts"),
                   "WHERE job_id = ? AND frame_number = ? AND kind = ? GROUP BY y0, x0, y1, x1"));
  query.Bind(frame.job_id).Bind(frame.frame_number).Bind(StoredForm(TaskKind::kCamera));
  std::vector<JobStore::TileCost> costs;
  absl::Status read =
      ReadRows<JobStore::TileCost>(&query, [&costs](const JobStore::TileCost& cost) {
        costs.push_back(cost);
        return absl::OkStatus();
      });
  if (!read.ok()) return read;
  return costs;
}

absl::StatusOr<uint64_t> DeletePart(const PartKey& key, Database* database) {
  Statement removal =
      database->Prepare(absl::StrCat("DELETE FROM parts ", kWhereKey, " RETURNING size_bytes"));
  BindKey(key, &removal);
  uint64_t bytes = 0;
  while (true) {
    const absl::StatusOr<bool> removed = removal.Step();
    if (!removed.ok()) return removed.status();
    if (!*removed) return bytes;
    bytes = static_cast<uint64_t>(removal.Int64(0));
  }
}

absl::StatusOr<uint64_t> DeleteFrameParts(const FrameId& frame, Database* database) {
  Statement sum = database->Prepare(
      "SELECT CAST(COALESCE(SUM(size_bytes), 0) AS BIGINT) FROM parts "
      "WHERE job_id = ? AND frame_number = ?");
  const absl::StatusOr<bool> row = sum.Bind(frame.job_id).Bind(frame.frame_number).Step();
  if (!row.ok()) return row.status();
  const auto bytes = static_cast<uint64_t>(sum.Int64(0));
  absl::Status status = database->Prepare("DELETE FROM parts WHERE job_id = ? AND frame_number = ?")
                            .Bind(frame.job_id)
                            .Bind(frame.frame_number)
                            .Run();
  if (!status.ok()) return status;
  return bytes;
}

absl::StatusOr<uint64_t> PartsBytes(Database* database) {
  Statement bytes =
      database->Prepare("SELECT CAST(COALESCE(SUM(size_bytes), 0) AS BIGINT) FROM parts");
  const absl::StatusOr<bool> sum = bytes.Step();
  if (!sum.ok()) return sum.status();
  return static_cast<uint64_t>(bytes.Int64(0));
}

absl::StatusOr<bool> HasParts(const FrameId& frame, Database* database) {
  Statement any =
      database->Prepare("SELECT 1 FROM parts WHERE job_id = ? AND frame_number = ? LIMIT 1");
  return any.Bind(frame.job_id).Bind(frame.frame_number).Step();
}

absl::StatusOr<std::map<uint64_t, uint64_t>> PartsBytesByJob(Database* database) {
  std::map<uint64_t, uint64_t> bytes;
  Statement query = database->Prepare(
      "SELECT job_id, CAST(SUM(size_bytes) AS BIGINT) FROM parts GROUP BY job_id");
  while (true) {
    const absl::StatusOr<bool> row = query.Step();
    if (!row.ok()) return row.status();
    if (!*row) return bytes;
    bytes[static_cast<uint64_t>(query.Int64(0))] = static_cast<uint64_t>(query.Int64(1));
  }
}

absl::StatusOr<std::optional<FrameId>> OldestDeliveredWithParts(Database* database) {
  Statement query = database->Prepare(
      "SELECT parts.job_id, parts.frame_number FROM parts JOIN frames USING(job_id, frame_number) "
      "JOIN jobs USING(job_id) WHERE (delivered = 1 OR phase = ?) AND pinned = 0 "
      "ORDER BY parts.job_id, parts.frame_number LIMIT 1");
  const absl::StatusOr<bool> row = query.Bind(StoredForm(JobPhase::kFailed)).Step();
  if (!row.ok()) return row.status();
  if (!*row) return std::optional<FrameId>();
  return std::optional<FrameId>(
      FrameId{static_cast<uint64_t>(query.Int64(0)), static_cast<int32_t>(query.Int64(1))});
}

}  // namespace sheaf::coordinator::rows
