// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AccessService over gRPC: certificates for machines and people.
#pragma once

#include "coordinator/access/access_control.h"
#include "sheaf/v1/access.grpc.pb.h"

namespace sheaf::coordinator {

class AccessService final : public v1::AccessService::Service {
 public:
  // `access` must outlive the service.
  explicit AccessService(AccessControl* access) : access_(access) {}

  grpc::Status Enroll(grpc::ServerContext* context, const v1::EnrollRequest* request,
                      v1::EnrollResponse* response) override;
  grpc::Status RenewCertificate(grpc::ServerContext* context,
                                const v1::RenewCertificateRequest* request,
                                v1::RenewCertificateResponse* response) override;

 private:
  AccessControl* const access_;
};

}  // namespace sheaf::coordinator
