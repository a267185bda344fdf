// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of JobService by which operators share the farm.
#include "absl/strings/str_cat.h"
#include "common/base/printable.h"
#include "common/rpc/grpc_status.h"
#include "coordinator/service/grpc/caller.h"
#include "coordinator/service/grpc/job_service.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

// "user:anna weight 2 threads_max 64": the request, for the audit log.
std::string AskedText(const v1::SetShareRequest& request) {
  std::string text = Printable(request.subject());
  if (request.has_weight()) absl::StrAppend(&text, " weight ", request.weight());
  if (request.has_threads_max()) absl::StrAppend(&text, " threads_max ", request.threads_max());
  return text;
}

}  // namespace

absl::StatusOr<ShareView> JobService::TrySetShare(const v1::SetShareRequest& request) {
  const absl::StatusOr<ShareSubject> subject = ParseShareSubject(request.subject());
  if (!subject.ok()) return subject.status();
  if (!request.has_weight() && !request.has_threads_max()) {
    return absl::InvalidArgumentError("neither a weight nor threads_max is given");
  }
  return farm_->share_control().Set(*subject, [&](ShareSetting* setting) {
    if (request.has_weight()) setting->weight = request.weight();
    if (request.has_threads_max()) setting->threads_max = request.threads_max();
  });
}

grpc::Status JobService::SetShare(grpc::ServerContext* context, const v1::SetShareRequest* request,
                                  v1::Share* response) {
  const absl::StatusOr<ShareView> view = TrySetShare(*request);
  NoteInAudit(*context, access_, "SetShare", AskedText(*request), view.status());
  if (!view.ok()) return ToGrpcStatus(view.status());
  *response = ToWire(*view);
  return grpc::Status::OK;
}

grpc::Status JobService::ResetShare(grpc::ServerContext* context,
                                    const v1::ResetShareRequest* request,
                                    v1::ResetShareResponse* /*response*/) {
  const absl::StatusOr<ShareSubject> subject = ParseShareSubject(request->subject());
  const absl::Status reset =
      subject.ok() ? farm_->share_control().Reset(*subject) : subject.status();
  NoteInAudit(*context, access_, "ResetShare", Printable(request->subject()), reset);
  return ToGrpcStatus(reset);
}

grpc::Status JobService::ListShares(grpc::ServerContext* /*context*/,
                                    const v1::ListSharesRequest* /*request*/,
                                    v1::ListSharesResponse* response) {
  for (const ShareView& view : farm_->share_control().List()) {
    *response->add_shares() = ToWire(view);
  }
  return grpc::Status::OK;
}

}  // namespace sheaf::coordinator
