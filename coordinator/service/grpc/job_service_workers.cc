// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of JobService that drains workers.
#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/rpc/grpc_status.h"
#include "coordinator/service/grpc/caller.h"
#include "coordinator/service/grpc/job_service.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

// Errors: kInvalidArgument.
absl::StatusOr<ChosenWorkers> ChosenBy(const google::protobuf::RepeatedPtrField<std::string>& names,
                                       const std::string& host) {
  ChosenWorkers chosen{{}, host};
  for (const std::string& name : names) {
    absl::string_view id = name;
    if (!absl::ConsumePrefix(&id, "workers/") || id.empty() || id.size() > kWorkerTextBytesMax) {
      return absl::InvalidArgumentError(
          absl::StrCat("names: \"", name, "\" is not of the form workers/ID"));
    }
    chosen.worker_ids.emplace_back(id);
  }
  if (host.size() > kWorkerTextBytesMax) {
    return absl::InvalidArgumentError(
        absl::StrCat("host: is over ", kWorkerTextBytesMax, " bytes"));
  }
  return chosen;
}

}  // namespace

void JobService::AddWorkers(const std::vector<std::string>& ids,
                            google::protobuf::RepeatedPtrField<v1::Worker>* workers) const {
  for (const WorkerView& view : farm_->ListWorkers()) {
    if (std::ranges::binary_search(ids, view.worker_id)) *workers->Add() = ToWire(view);
  }
}

grpc::Status JobService::DrainWorkers(grpc::ServerContext* context,
                                      const v1::DrainWorkersRequest* request,
                                      v1::DrainWorkersResponse* response) {
  const absl::StatusOr<ChosenWorkers> chosen = ChosenBy(request->names(), request->host());
  if (!chosen.ok()) return ToGrpcStatus(chosen.status());
  const absl::StatusOr<std::vector<std::string>> ids =
      farm_->DrainWorkers(*chosen, request->then_exit());
  if (!ids.ok()) {
    NoteInAudit(*context, access_, "DrainWorkers", "nothing", ids.status());
    return ToGrpcStatus(ids.status());
  }
  for (const std::string& id : *ids) {
    NoteInAudit(*context, access_, "DrainWorkers", absl::StrCat("workers/", id), absl::OkStatus());
  }
  AddWorkers(*ids, response->mutable_workers());
  return grpc::Status::OK;
}

grpc::Status JobService::UndrainWorkers(grpc::ServerContext* context,
                                        const v1::UndrainWorkersRequest* request,
                                        v1::UndrainWorkersResponse* response) {
  const absl::StatusOr<ChosenWorkers> chosen = ChosenBy(request->names(), request->host());
  if (!chosen.ok()) return ToGrpcStatus(chosen.status());
  const absl::StatusOr<std::vector<std::string>> ids = farm_->UndrainWorkers(*chosen);
  if (!ids.ok()) {
    NoteInAudit(*context, access_, "UndrainWorkers", "nothing", ids.status());
    return ToGrpcStatus(ids.status());
  }
  for (const std::string& id : *ids) {
    NoteInAudit(*context, access_, "UndrainWorkers", absl::StrCat("workers/", id),
                absl::OkStatus());
  }
  AddWorkers(*ids, response->mutable_workers());
  return grpc::Status::OK;
}

}  // namespace sheaf::coordinator
