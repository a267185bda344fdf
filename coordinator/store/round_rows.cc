// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/round_rows.h"

#include <array>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator::rows {
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

absl::Status InsertRound(const FrameId& frame, const RoundRecord& round, Database* database) {
  Statement insert = database->Prepare(absl::StrCat(
      "INSERT ", IntoTable<Sealed<CellRoundRow>>("rounds"), " ON CONFLICT DO NOTHING"));
  CellRoundRow row{frame.job_id, {frame.frame_number, round}, {PackCells(round)}};
  return BindRow(Seal(std::move(row)), &insert).Run();
}

absl::StatusOr<std::vector<StoredRound>> LoadRounds(uint64_t job_id, bool with_cells,
                                                    Database* database) {
  std::vector<StoredRound> rounds;
  const auto take = [&rounds](absl::StatusOr<StoredRound> round) {
    if (round.ok()) rounds.push_back(*std::move(round));
    return round.status();
  };
  const std::string select =
      with_cells ? SelectFrom<Sealed<CellRoundRow>>("rounds") : SelectFrom<StoredRound>("rounds");
  Statement query =
      database->Prepare(absl::StrCat(select, "WHERE job_id = ? ORDER BY frame_number, round"));
  query.Bind(job_id);
  absl::Status read =
      with_cells
          ? ReadRows<Sealed<CellRoundRow>>(
                &query, [&](Sealed<CellRoundRow> row) { return take(Unpacked(std::move(row))); })
          : ReadRows<StoredRound>(&query, take);
  if (!read.ok()) return read;
  return rounds;
}

absl::StatusOr<std::vector<RoundRecord>> LoadFrameRounds(const FrameId& frame, Database* database) {
  Statement query =
      database->Prepare(absl::StrCat(SelectFrom<Sealed<CellRoundRow>>("rounds"),
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

}  // namespace sheaf::coordinator::rows
