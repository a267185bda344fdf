// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The calls of FarmClient for retention on the coordinator.
#include <grpcpp/client_context.h>

#include "cli/job/farm_client.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"

namespace sheaf::cli {

absl::StatusOr<v1::Job> FarmClient::PinJob(const std::string& name) {
  v1::PinJobRequest request;
  request.set_name(name);
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->PinJob(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return job;
}

absl::StatusOr<v1::Job> FarmClient::UnpinJob(const std::string& name) {
  v1::UnpinJobRequest request;
  request.set_name(name);
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->UnpinJob(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return job;
}

absl::StatusOr<v1::CollectGarbageResponse> FarmClient::CollectGarbage(bool dry_run) {
  v1::CollectGarbageRequest request;
  request.set_dry_run(dry_run);
  v1::CollectGarbageResponse response;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->CollectGarbage(context, request, &response));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return response;
}

absl::StatusOr<v1::ListUsageResponse> FarmClient::ListUsage(const v1::ListUsageRequest& request) {
  v1::ListUsageResponse response;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->ListUsage(context, request, &response));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return response;
}

}  // namespace sheaf::cli
