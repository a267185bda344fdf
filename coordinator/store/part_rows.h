// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reading rows of the table of parts; shared by the two files of SqliteJobStore.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/sqlite_database.h"

namespace sheaf::coordinator {

// Begins every query for rows of parts.
inline constexpr char kPartColumns[] =
    "SELECT job_id, frame_number, x0, y0, x1, y1, first, count, sha256, size_bytes, worker_id, "
    "ray_count, nonfinite_count, cpu_ns, cell_size_px, cells FROM parts ";

// The row a query of kPartColumns stands at.
inline PartRow ReadPartRow(const SqliteStatement& row) {
  PartRow part;
  const auto edge = [&](int column) { return static_cast<int32_t>(row.Int64(column)); };
  part.key.frame = {static_cast<uint64_t>(row.Int64(0)), edge(1)};
  part.key.tile = {edge(2), edge(3), edge(4), edge(5)};
  part.key.block = {static_cast<uint64_t>(row.Int64(6)), static_cast<uint64_t>(row.Int64(7))};
  part.key.cells = {edge(14), static_cast<uint64_t>(row.Int64(15))};
  part.digest = {row.Text(8), static_cast<uint64_t>(row.Int64(9))};
  part.worker_id = row.Text(10);
  part.cost = {static_cast<uint64_t>(row.Int64(11)), static_cast<uint64_t>(row.Int64(12)),
               absl::Nanoseconds(row.Int64(13)), part.digest.size_bytes};
  return part;
}

// All rows of such a query.
inline absl::StatusOr<std::vector<PartRow>> ReadPartRows(SqliteStatement* query) {
  std::vector<PartRow> rows;
  while (true) {
    const absl::StatusOr<bool> there = query->Step();
    if (!there.ok()) return there.status();
    if (!*there) return rows;
    rows.push_back(ReadPartRow(*query));
  }
}

}  // namespace sheaf::coordinator
