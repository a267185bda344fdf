// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/caller.h"

#include <grpcpp/security/auth_context.h>

#include <memory>
#include <vector>

namespace sheaf::coordinator {

std::string CallerIdentity(const grpc::ServerContext& context) {
  constexpr char kCommonName[] = "x509_common_name";  // gRPC's name of the property.
  const std::shared_ptr<const grpc::AuthContext> caller = context.auth_context();
  if (caller == nullptr || !caller->IsPeerAuthenticated()) return "";
  const std::vector<grpc::string_ref> names = caller->FindPropertyValues(kCommonName);
  return names.empty() ? "" : std::string(names.front().data(), names.front().size());
}

}  // namespace sheaf::coordinator
