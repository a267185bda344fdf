// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of JobService for retention: pins, and immediate removals.
#include "absl/strings/str_cat.h"
#include "common/rpc/grpc_status.h"
#include "coordinator/service/grpc/caller.h"
#include "coordinator/service/grpc/job_service.h"

namespace sheaf::coordinator {

grpc::Status JobService::CollectGarbage(grpc::ServerContext* context,
                                        const v1::CollectGarbageRequest* request,
                                        v1::CollectGarbageResponse* response) {
  const absl::StatusOr<std::vector<RemovalView>> removals =
      farm_->CollectGarbage(request->dry_run());
  if (!request->dry_run()) {
    const std::string what =
        removals.ok() ? absl::StrCat(removals->size(), " removals") : std::string("nothing");
    NoteInAudit(*context, access_, "CollectGarbage", what, removals.status());
  }
  if (!removals.ok()) return ToGrpcStatus(removals.status());
  for (const RemovalView& view : *removals) *response->add_removals() = ToWire(view);
  return grpc::Status::OK;
}

}  // namespace sheaf::coordinator
