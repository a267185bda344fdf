// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/access_service.h"

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/rpc/grpc_status.h"
#include "coordinator/service/grpc/caller.h"

namespace sheaf::coordinator {
namespace {

void SetTime(absl::Time time, google::protobuf::Timestamp* wire) {
  wire->set_seconds(absl::ToUnixSeconds(time));
  wire->set_nanos(static_cast<int32_t>(
      absl::ToInt64Nanoseconds(time - absl::FromUnixSeconds(wire->seconds()))));
}

}  // namespace

grpc::Status AccessService::Enroll(grpc::ServerContext* context, const v1::EnrollRequest* request,
                                   v1::EnrollResponse* response) {
  const absl::Time now = absl::Now();
  const absl::StatusOr<AccessControl::IssuedCertificate> issued = access_->Enroll(
      request->token_secret(), request->certificate_request_pem(), CallerAddress(*context), now);
  if (!issued.ok()) {
    access_->audit().NoteRefused(context->peer(), "Enroll", issued.status(), now);
    return ToGrpcStatus(issued.status());
  }
  const std::string identity = FormatIdentity(issued->identity.id);
  access_->audit().Note(context->peer(), "Enroll", identity, absl::OkStatus());
  response->set_certificate_pem(issued->certificate_pem);
  response->set_identity(identity);
  response->set_role(RoleName(issued->identity.role));
  SetTime(now, response->mutable_coordinator_time());
  return grpc::Status::OK;
}

absl::StatusOr<Caller> AccessService::IdentifiedCaller(const grpc::ServerContext& context) const {
  absl::StatusOr<Caller> caller = CallerOf(context, access_);
  if (caller.ok() && !caller->identity) {
    return absl::UnauthenticatedError("the caller shows no certificate");
  }
  return caller;
}

grpc::Status AccessService::RenewCertificate(grpc::ServerContext* context,
                                             const v1::RenewCertificateRequest* request,
                                             v1::RenewCertificateResponse* response) {
  const absl::Time now = absl::Now();
  const absl::StatusOr<Caller> caller = IdentifiedCaller(*context);
  if (!caller.ok()) return ToGrpcStatus(caller.status());
  const absl::StatusOr<AccessControl::IssuedCertificate> issued =
      access_->Renew(*caller, request->certificate_request_pem(), now);
  NoteInAudit(*context, access_, "RenewCertificate", caller->Name(), issued.status());
  if (!issued.ok()) return ToGrpcStatus(issued.status());
  response->set_certificate_pem(issued->certificate_pem);
  SetTime(now, response->mutable_coordinator_time());
  return grpc::Status::OK;
}

grpc::Status AccessService::IssuePageToken(grpc::ServerContext* context,
                                           const v1::IssuePageTokenRequest* /*request*/,
                                           v1::IssuePageTokenResponse* response) {
  if (http_port_ == 0) {
    return ToGrpcStatus(
        absl::FailedPreconditionError("the coordinator serves no page; start it with --http"));
  }
  const absl::StatusOr<Caller> caller = IdentifiedCaller(*context);
  if (!caller.ok()) return ToGrpcStatus(caller.status());
  NoteInAudit(*context, access_, "IssuePageToken", caller->Name(), absl::OkStatus());
  response->set_token(access_->IssuePageToken(*caller, absl::Now()));
  response->set_http_port(http_port_);
  return grpc::Status::OK;
}

}  // namespace sheaf::coordinator
