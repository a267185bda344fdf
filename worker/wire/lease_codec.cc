// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/wire/lease_codec.h"

#include "common/rpc/settings_codec.h"

namespace sheaf::worker {
namespace {

static_assert(static_cast<int>(TaskKind::kTraining) == v1::TASK_KIND_TRAINING &&
              v1::TaskKind_ARRAYSIZE == 3);

template <class Work>
v1::ResultKey KeyOfWork(const Work& work) {
  v1::ResultKey key;
  key.set_frame_digest(work.frame_digest);
  *key.mutable_tile() = sheaf::ToWire(work.tile);
  key.mutable_block()->set_first(work.block.first);
  key.mutable_block()->set_count(work.block.count);
  key.set_cell_size_px(work.cells.size_px);
  key.set_cells(work.cells.mask);
  key.set_kind(static_cast<v1::TaskKind>(work.kind));
  return key;
}

}  // namespace

v1::ResultKey KeyOf(const Lease& lease) { return KeyOfWork(lease); }
v1::ResultKey KeyOf(const FinishedPart& part) { return KeyOfWork(part); }

void ReadKey(const v1::ResultKey& key, Lease* lease) {
  lease->frame_digest = key.frame_digest();
  lease->tile = sheaf::FromWire(key.tile());
  lease->block = {key.block().first(), key.block().count()};
  lease->cells = {key.cell_size_px(), key.cells()};
  lease->kind = static_cast<TaskKind>(key.kind());
}

v1::LeaseFailure::Kind ToWire(FailureKind kind) {
  switch (kind) {
    case FailureKind::kReleased:
      return v1::LeaseFailure::KIND_RELEASED;
    case FailureKind::kInfrastructure:
      return v1::LeaseFailure::KIND_INFRASTRUCTURE;
    case FailureKind::kScene:
      return v1::LeaseFailure::KIND_SCENE;
    case FailureKind::kMemory:
      return v1::LeaseFailure::KIND_MEMORY;
    case FailureKind::kInternal:
      return v1::LeaseFailure::KIND_INTERNAL;
  }
  return v1::LeaseFailure::KIND_INTERNAL;
}

FailureKind FromWire(v1::LeaseFailure::Kind kind) {
  switch (kind) {
    case v1::LeaseFailure::KIND_INFRASTRUCTURE:
      return FailureKind::kInfrastructure;
    case v1::LeaseFailure::KIND_SCENE:
      return FailureKind::kScene;
    case v1::LeaseFailure::KIND_MEMORY:
      return FailureKind::kMemory;
    default:
      return FailureKind::kInternal;
  }
}

}  // namespace sheaf::worker
