// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The call of FarmClient that gets a task to render it again.
#include <grpcpp/client_context.h>

#include "cli/job/farm_client.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"

namespace sheaf::cli {

absl::Status FarmClient::ReadTaskBundle(
    const v1::ReadTaskBundleRequest& request,
    const std::function<absl::Status(const v1::ReadTaskBundleResponse&)>& take) {
  absl::Status taken;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) -> absl::Status {
        const auto reader = jobs_->ReadTaskBundle(context, request);
        v1::ReadTaskBundleResponse response;
        while (taken.ok() && reader->Read(&response)) taken = take(response);
        if (taken.ok()) return FromGrpcStatus(reader->Finish());
        context->TryCancel();
        reader->Finish();
        return absl::AbortedError("the bundle is not taken");  // No attempt changes that.
      },
      kStreamDeadline);
  return taken.ok() ? status : taken;
}

}  // namespace sheaf::cli
