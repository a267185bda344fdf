// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/call_gate.h"

#include <grpc/grpc_security_constants.h>

#include <string>
#include <string_view>

#include "absl/time/clock.h"
#include "common/rpc/grpc_status.h"

namespace sheaf::coordinator {

grpc::Status CallGate::Process(const InputMetadata& metadata, grpc::AuthContext* context,
                               OutputMetadata* /*consumed*/, OutputMetadata* /*response*/) {
  const auto path = metadata.find(":path");
  const std::string_view operation =
      path == metadata.end() ? "/" : std::string_view(path->second.data(), path->second.size());
  const std::vector<grpc::string_ref> certificates =
      context->FindPropertyValues(GRPC_X509_PEM_CERT_PROPERTY_NAME);
  const std::string certificate =
      certificates.empty() ? ""
                           : std::string(certificates.front().data(), certificates.front().size());
  return ToGrpcStatus(access_->Admit(certificate, operation, "a gRPC client", absl::Now()));
}

}  // namespace sheaf::coordinator
