// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to a worker as the coordinator's reply. A renderer can handle all leases
// that it accepts, and the ledger of leases takes them in any order.
#include <string>

#include "tests/fuzz/fuzz_target.h"
#include "worker/agent/lease_ledger.h"
#include "worker/wire/coordinator_messages.h"

namespace sheaf::worker {
namespace {

void CheckLease(const Lease& lease) {
  SHEAF_CHECK(!lease.tile.IsEmpty() && lease.settings.window.Contains(lease.tile));
  SHEAF_CHECK(IsAligned(lease.block) && lease.block.End() <= lease.settings.samples);
  SHEAF_CHECK(WhyNoCells(lease.tile, lease.cells).empty());
  SHEAF_CHECK(lease.settings.max_depth >= 0);
}

}  // namespace

SHEAF_FUZZ_TARGET(worker_replies) {
  v1::SynchronizeResponse response;
  if (!response.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return;
  const absl::StatusOr<DesiredState> desired = FromWire(response);
  if (!desired.ok()) return;
  for (const Lease& lease : desired->leases) CheckLease(lease);
  SHEAF_CHECK(desired->next_synchronize.count() > 0);
  SHEAF_CHECK(desired->lease_duration.count() >= 0);
  LeaseLedger ledger;
  ledger.Apply(ledger.TakeSnapshot().sequence, desired->leases);
  if (const auto task = ledger.TakeNext()) {
    ledger.BeginRendering(task->lease.lease_id);
    ledger.Finish(task->lease.lease_id);
  }
  ledger.Apply(ledger.TakeSnapshot().sequence, desired->leases);
}

}  // namespace sheaf::worker
