// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CallGate: the one place that admits or refuses gRPC calls. gRPC asks it before every TLS call of
// every service, including streams, health and reflection, so no handler can forget to. Callers
// whose versions of the protocol do not fit are refused here too (protocol_calls.h); without TLS
// PlainServerCredentials does that alone.
#pragma once

#include <grpcpp/security/auth_metadata_processor.h>

#include "coordinator/access/access_control.h"

namespace sheaf::coordinator {

class CallGate final : public grpc::AuthMetadataProcessor {
 public:
  // `access` must outlive the server.
  explicit CallGate(AccessControl* access) : access_(access) {}

  // It decides from memory, in microseconds.
  bool IsBlocking() const override { return false; }
  grpc::Status Process(const InputMetadata& metadata, grpc::AuthContext* context,
                       OutputMetadata* consumed, OutputMetadata* response) override;

 private:
  AccessControl* const access_;
};

}  // namespace sheaf::coordinator
