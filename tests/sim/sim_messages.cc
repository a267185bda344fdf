// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/sim_messages.h"

#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/base/check.h"

namespace sheaf::sim {

worker::Lease ToWorkerLease(const coordinator::LeaseGrant& grant) {
  worker::Lease lease;
  lease.lease_id = grant.lease.lease_id;
  lease.attempt = grant.lease.attempt;
  lease.frame_name =
      absl::StrCat("jobs/", grant.lease.frame.job_id, "/frames/", grant.lease.frame.frame_number);
  lease.frame_digest = grant.frame_digest;
  lease.tile = grant.lease.tile_rect;
  lease.block = grant.lease.task.block;
  lease.cells = grant.lease.cells;
  lease.kind = grant.lease.kind;
  lease.scene = grant.scene;
  lease.settings = grant.settings;
  lease.token = grant.token;
  lease.field = grant.lease.field;
  return lease;
}

coordinator::ResultReport ToReport(const std::string& worker_id, const std::string& identity,
                                   const worker::FinishedPart& part) {
  coordinator::ResultReport report;
  report.frame_digest = part.frame_digest;
  report.tile = part.tile;
  report.block = part.block;
  report.cells = part.cells;
  report.kind = part.kind;
  report.lease_id = part.lease_id;
  report.token = part.token;
  report.field = part.field.sha256_hex;
  report.worker_id = worker_id;
  report.identity = identity;
  report.digest = part.digest;
  report.ray_count = part.ray_count;
  report.cpu_duration = absl::Seconds(part.cpu_seconds);
  return report;
}

coordinator::FrameId FrameOf(const worker::Lease& lease) {
  const std::vector<std::string> words = absl::StrSplit(lease.frame_name, '/');
  coordinator::FrameId id;
  SHEAF_CHECK(words.size() == 4 && absl::SimpleAtoi(words[1], &id.job_id) &&
              absl::SimpleAtoi(words[3], &id.frame_number));
  return id;
}

worker::Lease LeaseOf(const worker::FinishedPart& part) {
  worker::Lease lease;
  lease.frame_digest = part.frame_digest;
  lease.tile = part.tile;
  lease.block = part.block;
  lease.cells = part.cells;
  lease.kind = part.kind;
  lease.field = part.field;
  return lease;
}

}  // namespace sheaf::sim
