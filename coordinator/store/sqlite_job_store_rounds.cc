// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqliteJobStore that keeps rounds.
#include <array>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "coordinator/store/sqlite_job_store.h"
#include "coordinator/store/stored_times.h"

namespace sheaf::coordinator {
namespace {

// A cell in the column `tiles`, in the byte order of x86-64, the one instruction set there is.
struct PackedCell {
  uint64_t samples, samples_next;
  int64_t pixel_count;
  double error_sum, error_square_sum;
};
static_assert(sizeof(PackedCell) == 40);

std::string PackCells(const RoundRecord& round) {
  std::string bytes;
  bytes.reserve(round.cells.size() * sizeof(PackedCell));
  for (size_t i = 0; i < round.cells.size(); ++i) {
    const CellRound& cell = round.cells[i];
    const uint64_t next = round.samples_next.empty() ? 0 : round.samples_next[i];
    const PackedCell packed{cell.samples, next, cell.error.pixel_count, cell.error.sum,
                            cell.error.square_sum};
    std::array<char, sizeof packed> of_cell;
    std::memcpy(of_cell.data(), &packed, sizeof packed);
    bytes.append(of_cell.data(), of_cell.size());
  }
  return bytes;
}

// Errors: kDataLoss.
absl::Status UnpackCells(const std::string& bytes, RoundRecord* round) {
  if (bytes.empty() || bytes.size() % sizeof(PackedCell) != 0) {
    return absl::DataLossError(
        absl::StrCat("round ", round->round, " of a frame has ", bytes.size(), " bytes of cells"));
  }
  for (size_t at = 0; at < bytes.size(); at += sizeof(PackedCell)) {
    PackedCell packed;
    std::memcpy(&packed, bytes.data() + at, sizeof packed);
    round->cells.push_back(
        {packed.samples, {packed.pixel_count, packed.error_sum, packed.error_square_sum}});
    if (packed.samples_next != 0) round->samples_next.push_back(packed.samples_next);
  }
  if (!round->samples_next.empty() && round->samples_next.size() != round->cells.size()) {
    return absl::DataLossError(absl::StrCat("round ", round->round, " of a frame lacks cells"));
  }
  return absl::OkStatus();
}

constexpr char kRoundColumns[] =
    "SELECT frame_number, round, relative_mse, relative_mse_upper, predicted_relative_mse, "
    "sample_count, wall_ns, ray_count, nonfinite_count, cpu_ns, part_bytes, stop_reason, "
    "sample_count_expected";

// Requires: the columns are kRoundColumns, and those of cells after them where they are wanted.
absl::StatusOr<std::vector<StoredRound>> ReadRounds(SqliteStatement* query, bool with_cells) {
  std::vector<StoredRound> rounds;
  while (true) {
    const absl::StatusOr<bool> row = query->Step();
    if (!row.ok()) return row.status();
    if (!*row) return rounds;
    const auto count = [&](int column) { return static_cast<uint64_t>(query->Int64(column)); };
    StoredRound stored;
    stored.frame_number = static_cast<int32_t>(query->Int64(0));
    RoundRecord& round = stored.record;
    round.round = static_cast<int32_t>(query->Int64(1));
    round.relative_mse = query->Double(2);
    round.relative_mse_upper = query->Double(3);
    round.predicted_relative_mse = query->Double(4);
    round.sample_count = count(5);
    round.wall_duration = absl::Nanoseconds(query->Int64(6));
    round.cost = {count(7), count(8), absl::Nanoseconds(query->Int64(9)), count(10)};
    round.stop_reason = static_cast<StopReason>(query->Int64(11));
    round.sample_count_expected = count(12);
    if (with_cells) {
      if (absl::Status status = UnpackCells(query->Bytes(13), &round); !status.ok()) return status;
    }
    rounds.push_back(std::move(stored));
  }
}

}  // namespace

absl::Status SqliteJobStore::AddRound(const FrameId& frame, const RoundRecord& round) {
  const MutexLock lock(&database_mutex_);
  return InsertRound(frame, round);
}

absl::Status SqliteJobStore::InsertRound(const FrameId& frame, const RoundRecord& round) {
  return database_
      ->Prepare(
          "INSERT OR IGNORE INTO rounds(job_id, frame_number, round, relative_mse, "
          "relative_mse_upper, predicted_relative_mse, sample_count, wall_ns, ray_count, "
          "nonfinite_count, cpu_ns, part_bytes, stop_reason, sample_count_expected, tiles) "
          "VALUES(?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)")
      .Bind(frame.job_id)
      .Bind(frame.frame_number)
      .Bind(round.round)
      .Bind(round.relative_mse)
      .Bind(round.relative_mse_upper)
      .Bind(round.predicted_relative_mse)
      .Bind(round.sample_count)
      .Bind(absl::ToInt64Nanoseconds(round.wall_duration))
      .Bind(round.cost.ray_count)
      .Bind(round.cost.nonfinite_count)
      .Bind(absl::ToInt64Nanoseconds(round.cost.cpu_duration))
      .Bind(round.cost.part_bytes)
      .Bind(static_cast<int32_t>(round.stop_reason))
      .Bind(round.sample_count_expected)
      .BindBytes(PackCells(round))
      .Run();
}

absl::Status SqliteJobStore::ReopenJob(uint64_t job_id, const std::vector<ReopenedFrame>& frames) {
  const MutexLock lock(&database_mutex_);
  return InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) -> absl::Status {
    absl::Status status =
        database_->Prepare("UPDATE jobs SET phase = 0, failure = '', end_ns = ? WHERE job_id = ?")
            .Bind(ToNanoseconds(absl::InfiniteFuture()))
            .Bind(job_id)
            .Run();
    for (const ReopenedFrame& frame : frames) {
      if (!status.ok()) return status;
      const FrameId id{job_id, frame.spec.frame_number};
      const StopRule& stop = frame.spec.stop;
      status = database_
                   ->Prepare(
                       "UPDATE frames SET delivered = 0, samples = ?, target_error = ?, "
                       "time_max_ns = ?, cpu_max_ns = ?, first_round_samples = ? "
                       "WHERE job_id = ? AND frame_number = ?")
                   .Bind(frame.spec.settings.samples)
                   .Bind(stop.target_error)
                   .Bind(ToNanoseconds(stop.time_max))
                   .Bind(ToNanoseconds(stop.cpu_max))
                   .Bind(stop.first_round_samples)
                   .Bind(job_id)
                   .Bind(id.frame_number)
                   .Run();
      if (!status.ok()) return status;
      status = database_->Prepare("DELETE FROM rounds WHERE job_id = ? AND frame_number = ?")
                   .Bind(job_id)
                   .Bind(id.frame_number)
                   .Run();
      for (const RoundRecord& round : frame.rounds) {
        if (status.ok()) status = InsertRound(id, round);
      }
    }
    return status;
  });
}

absl::StatusOr<std::vector<StoredRound>> SqliteJobStore::LoadRounds(uint64_t job_id,
                                                                    bool with_cells) {
  const MutexLock lock(&database_mutex_);
  SqliteStatement query = database_->Prepare(
      absl::StrCat(kRoundColumns, with_cells ? ", tiles" : "",
                   " FROM rounds WHERE job_id = ? ORDER BY frame_number, round"));
  query.Bind(job_id);
  return ReadRounds(&query, with_cells);
}

absl::StatusOr<std::vector<RoundRecord>> SqliteJobStore::LoadFrameRounds(const FrameId& frame) {
  const MutexLock lock(&database_mutex_);
  SqliteStatement query = database_->Prepare(absl::StrCat(
      kRoundColumns, ", tiles FROM rounds WHERE job_id = ? AND frame_number = ? ORDER BY round"));
  query.Bind(frame.job_id).Bind(frame.frame_number);
  absl::StatusOr<std::vector<StoredRound>> stored = ReadRounds(&query, /*with_cells=*/true);
  if (!stored.ok()) return stored.status();
  std::vector<RoundRecord> rounds;
  for (StoredRound& round : *stored) rounds.push_back(std::move(round.record));
  return rounds;
}

}  // namespace sheaf::coordinator
