// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The calls of FarmClient that continue held work, and drain workers.
#include <grpcpp/client_context.h>

#include "cli/job/farm_client.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"

namespace sheaf::cli {

absl::StatusOr<v1::Job> FarmClient::ReleaseJob(const std::string& name) {
  v1::ReleaseJobRequest request;
  request.set_name(name);
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->ReleaseJob(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return job;
}

absl::StatusOr<v1::Job> FarmClient::ApproveFrames(const v1::ApproveFramesRequest& request) {
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->ApproveFrames(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return job;
}

absl::StatusOr<std::vector<v1::Worker>> FarmClient::DrainWorkers(
    const v1::DrainWorkersRequest& request) {
  v1::DrainWorkersResponse response;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->DrainWorkers(context, request, &response));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return std::vector<v1::Worker>(response.workers().begin(), response.workers().end());
}

absl::StatusOr<std::vector<v1::Worker>> FarmClient::UndrainWorkers(
    const v1::UndrainWorkersRequest& request) {
  v1::UndrainWorkersResponse response;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->UndrainWorkers(context, request, &response));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return std::vector<v1::Worker>(response.workers().begin(), response.workers().end());
}

}  // namespace sheaf::cli
