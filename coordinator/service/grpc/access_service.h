// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AccessService over gRPC: certificates for machines and users.
#pragma once

#include "coordinator/access/access_control.h"
#include "sheaf/v1/access.grpc.pb.h"

namespace sheaf::coordinator {

class AccessService final : public v1::AccessService::Service {
 public:
  // `access` must outlive the service. http_port: the page's; 0 if there is none.
  AccessService(AccessControl* access, int http_port) : access_(access), http_port_(http_port) {}

  grpc::Status Enroll(grpc::ServerContext* context, const v1::EnrollRequest* request,
                      v1::EnrollResponse* response) override;
  grpc::Status RenewCertificate(grpc::ServerContext* context,
                                const v1::RenewCertificateRequest* request,
                                v1::RenewCertificateResponse* response) override;
  grpc::Status IssuePageToken(grpc::ServerContext* context,
                              const v1::IssuePageTokenRequest* request,
                              v1::IssuePageTokenResponse* response) override;

 private:
  // The caller, who has an identity. Errors: kUnauthenticated.
  absl::StatusOr<Caller> IdentifiedCaller(const grpc::ServerContext& context) const;

  AccessControl* const access_;
  const int http_port_;
};

}  // namespace sheaf::coordinator
