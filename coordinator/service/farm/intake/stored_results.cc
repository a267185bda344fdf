// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of ResultIntake for results whose bytes their senders store themselves (docs/adr/0083).
// The coordinator reads them back to merge them, and so can compare their digest.
#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "coordinator/service/farm/intake/result_intake.h"

namespace sheaf::coordinator {

Scheduler::FoundTask ResultIntake::FindTask(const ResultReport& report) const {
  return tables_.scheduler.FindTask(report.frame_digest, report.tile, report.block, report.cells,
                                    report.lease_id, report.kind, report.field);
}

PartRow ResultIntake::RowOf(const ResultReport& report, const FrameId& frame) {
  PartRow row;
  row.key = {frame, report.tile, report.block, report.cells, report.kind};
  row.digest = report.digest;
  row.worker_id = report.worker_id;
  row.identity = report.Sender();
  row.field = report.field;
  return row;
}

absl::StatusOr<std::optional<PutTicket>> ResultIntake::TicketFor(const ResultReport& report) {
  if (absl::Status allowed = CheckSender(report); !allowed.ok()) return allowed;
  Scheduler::FoundTask found;
  {
    const MutexLock lock(&tables_.mutex);
    found = FindTask(report);
  }
  if (found.kind != Scheduler::FoundTask::Kind::kWanted) return std::optional<PutTicket>();
  return store_.TicketFor(RowOf(report, found.frame));
}

absl::StatusOr<ResultOutcome> ResultIntake::AddStored(const ResultReport& report) {
  if (absl::Status allowed = CheckSender(report); !allowed.ok()) return allowed;
  Scheduler::FoundTask found;
  {
    const MutexLock lock(&tables_.mutex);
    found = FindTask(report);
  }
  using Kind = Scheduler::FoundTask::Kind;
  if (found.kind != Kind::kWanted && found.kind != Kind::kCovered) {
    return absl::FailedPreconditionError("the result is no longer wanted");
  }
  const absl::StatusOr<std::string> bytes = store_.ReadPart(RowOf(report, found.frame));
  if (bytes.ok()) return Add(report, *bytes);
  if (!absl::IsNotFound(bytes.status()) && !absl::IsDataLoss(bytes.status())) {
    disk_.Note(bytes.status());
    return absl::UnavailableError(std::string(bytes.status().message()));
  }
  LogWarning(
      absl::StrCat("worker ", report.worker_id,
                   " is to send a result that it says it has stored: ", bytes.status().message()));
  return absl::FailedPreconditionError(std::string(bytes.status().message()));
}

}  // namespace sheaf::coordinator
