// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqlJobStore that stores rounds.
#include <array>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/stored_rows.h"
#include "coordinator/store/stored_times.h"

namespace sheaf::coordinator {
namespace {

// A cell in the column `tiles`, in the byte order of x86-64, the only supported instruction set.
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

absl::StatusOr<StoredRound> Unpacked(Sealed<CellRoundRow> sealed) {
  CellRoundRow& row = sealed.row;
  if (!sealed.IsWhole()) {
    return absl::DataLossError(absl::StrCat("round ", row.round.record.round, " of frame ",
                                            row.round.frame_number, " of jobs/", row.job_id,
                                            " changed since it was stored"));
  }
  absl::Status status = UnpackCells(row.cells.bytes, &row.round.record);
  if (!status.ok()) return status;
  return std::move(row.round);
}

}  // namespace

absl::Status SqlJobStore::AddRound(const FrameId& frame, const RoundRecord& round) {
  const MutexLock lock(&database_mutex_);
  return InsertRound(frame, round);
}

absl::Status SqlJobStore::InsertRound(const FrameId& frame, const RoundRecord& round) {
  Statement insert = database_->Prepare(absl::StrCat(
      "INSERT ", IntoTable<Sealed<CellRoundRow>>("rounds"), " ON CONFLICT DO NOTHING"));
  CellRoundRow row{frame.job_id, {frame.frame_number, round}, {PackCells(round)}};
  return BindRow(Seal(std::move(row)), &insert).Run();
}

absl::Status SqlJobStore::ReopenJob(uint64_t job_id, const std::vector<ReopenedFrame>& frames) {
  const MutexLock lock(&database_mutex_);
  return InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) -> absl::Status {
    absl::Status status =
        database_
            ->Prepare(
                "UPDATE jobs SET phase = 0, failure = '', end_ns = ?1, parts_removed_ns = CASE "
                "WHEN (SELECT COUNT(*) FROM frames WHERE job_id = ?2) = ?3 THEN ?1 "
                "ELSE parts_removed_ns END WHERE job_id = ?2")
            .Bind(ToNanoseconds(absl::InfiniteFuture()))
            .Bind(job_id)
            .Bind(static_cast<int64_t>(frames.size()))
            .Run();
    if (status.ok()) status = SealState(job_id);
    for (const ReopenedFrame& frame : frames) {
      if (!status.ok()) return status;
      const FrameId id{job_id, frame.spec.frame_number};
      status = database_
                   ->Prepare(
                       "UPDATE frames SET correction_count = correction_count + 1 "
                       "WHERE job_id = ? AND frame_number = ? AND delivered = 1 AND ? = 1")
                   .Bind(job_id)
                   .Bind(id.frame_number)
                   .Bind(int64_t{frame.is_correction})
                   .Run();
      if (!status.ok()) return status;
      Statement update = database_->Prepare(
          absl::StrCat(UpdateOf<ReopenedRow>("frames"), "WHERE job_id = ? AND frame_number = ?"));
      const int64_t seal = Seal(FrameSpecRow{job_id, frame.spec}).seal;
      status = BindRow(ReopenedRow{false, frame.spec.settings.samples, frame.spec.stop,
                                   frame.spec.resumed, seal},
                       &update)
                   .Bind(job_id)
                   .Bind(id.frame_number)
                   .Run();
      if (!status.ok()) return status;
      if (status = NoteApproval(id, frame.spec.settings.samples); !status.ok()) return status;
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

absl::StatusOr<std::vector<StoredRound>> SqlJobStore::LoadRounds(uint64_t job_id, bool with_cells) {
  const MutexLock lock(&database_mutex_);
  std::vector<StoredRound> rounds;
  const auto take = [&rounds](absl::StatusOr<StoredRound> round) {
    if (round.ok()) rounds.push_back(*std::move(round));
    return round.status();
  };
  const std::string select =
      with_cells ? SelectFrom<Sealed<CellRoundRow>>("rounds") : SelectFrom<StoredRound>("rounds");
  Statement query =
      database_->Prepare(absl::StrCat(select, "WHERE job_id = ? ORDER BY frame_number, round"));
  query.Bind(job_id);
  absl::Status read =
      with_cells
          ? ReadRows<Sealed<CellRoundRow>>(
                &query, [&](Sealed<CellRoundRow> row) { return take(Unpacked(std::move(row))); })
          : ReadRows<StoredRound>(&query, take);
  if (!read.ok()) return Explained(read);
  return rounds;
}

absl::StatusOr<std::vector<RoundRecord>> SqlJobStore::LoadFrameRounds(const FrameId& frame) {
  const MutexLock lock(&database_mutex_);
  Statement query =
      database_->Prepare(absl::StrCat(SelectFrom<Sealed<CellRoundRow>>("rounds"),
                                      "WHERE job_id = ? AND frame_number = ? ORDER BY round"));
  query.Bind(frame.job_id).Bind(frame.frame_number);
  std::vector<RoundRecord> rounds;
  absl::Status read = ReadRows<Sealed<CellRoundRow>>(&query, [&rounds](Sealed<CellRoundRow> row) {
    absl::StatusOr<StoredRound> round = Unpacked(std::move(row));
    if (round.ok()) rounds.push_back(std::move(round->record));
    return round.status();
  });
  if (!read.ok()) return read;
  return rounds;
}

}  // namespace sheaf::coordinator
