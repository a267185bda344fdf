// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/call_gate.h"

#include <grpc/grpc_security_constants.h>

#include <string>
#include <string_view>

#include "absl/time/clock.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/protocol_calls.h"

namespace sheaf::coordinator {

namespace {

std::string_view ValueOf(const grpc::AuthMetadataProcessor::InputMetadata& metadata,
                         const char* key, std::string_view otherwise) {
  const auto found = metadata.find(key);
  return found == metadata.end() ? otherwise
                                 : std::string_view(found->second.data(), found->second.size());
}

}  // namespace

grpc::Status CallGate::Process(const InputMetadata& metadata, grpc::AuthContext* context,
                               OutputMetadata* /*consumed*/, OutputMetadata* /*response*/) {
  const std::string_view operation = ValueOf(metadata, ":path", "/");
  const std::vector<grpc::string_ref> certificates =
      context->FindPropertyValues(GRPC_X509_PEM_CERT_PROPERTY_NAME);
  const std::string certificate =
      certificates.empty() ? ""
                           : std::string(certificates.front().data(), certificates.front().size());
  const absl::Status admitted =
      access_->Admit(certificate, operation, "a gRPC client", absl::Now());
  if (!admitted.ok()) return ToGrpcStatus(admitted);
  return ToGrpcStatus(CheckCaller(operation, ValueOf(metadata, kProtocolKey, "")));
}

}  // namespace sheaf::coordinator
