// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The calls of FarmClient by which operators share the farm.
#include <grpcpp/client_context.h>

#include "cli/job/farm_client.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"

namespace sheaf::cli {

absl::StatusOr<v1::Share> FarmClient::SetShare(const v1::SetShareRequest& request) {
  v1::Share share;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->SetShare(context, request, &share));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return share;
}

absl::Status FarmClient::ResetShare(const std::string& subject) {
  v1::ResetShareRequest request;
  request.set_subject(subject);
  v1::ResetShareResponse response;
  return Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->ResetShare(context, request, &response));
      },
      kUnaryDeadline);
}

absl::StatusOr<std::vector<v1::Share>> FarmClient::ListShares() {
  v1::ListSharesResponse response;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->ListShares(context, v1::ListSharesRequest(), &response));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return std::vector<v1::Share>(response.shares().begin(), response.shares().end());
}

}  // namespace sheaf::cli
