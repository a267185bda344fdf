// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/caller.h"

#include <grpc/grpc_security_constants.h>
#include <grpcpp/security/auth_context.h>

#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {
namespace {

std::string FirstProperty(const grpc::ServerContext& context, const char* name) {
  const std::shared_ptr<const grpc::AuthContext> auth = context.auth_context();
  if (auth == nullptr) return "";
  const std::vector<grpc::string_ref> values = auth->FindPropertyValues(name);
  return values.empty() ? "" : std::string(values.front().data(), values.front().size());
}

}  // namespace

std::string CallerIdentity(const grpc::ServerContext& context) {
  return FirstProperty(context, GRPC_X509_CN_PROPERTY_NAME);
}

std::string CallerAddress(const grpc::ServerContext& context) {
  const std::string peer = context.peer();
  return peer.substr(0, peer.rfind(':'));
}

absl::StatusOr<Caller> CallerOf(const grpc::ServerContext& context, AccessControl* access) {
  if (access == nullptr) return Caller{};
  return access->Authenticate(FirstProperty(context, GRPC_X509_PEM_CERT_PROPERTY_NAME),
                              absl::Now());
}

std::string OwnerOf(const grpc::ServerContext& context) {
  const absl::StatusOr<IdentityId> id = ParseIdentity(CallerIdentity(context));
  return id.ok() ? id->name : kLocalOwner;
}

absl::Status RequireJobControl(const grpc::ServerContext& context, AccessControl* access,
                               const std::string& owner) {
  const absl::StatusOr<Caller> caller = CallerOf(context, access);
  if (!caller.ok()) return caller.status();
  return caller->identity ? AccessControl::AuthorizeJob(*caller, owner) : absl::OkStatus();
}

absl::StatusOr<IdentityUse::Stream> OpenStream(const grpc::ServerContext& context,
                                               AccessControl* access, const char* operation) {
  if (access == nullptr) return IdentityUse::Stream();
  const std::string name = CallerIdentity(context);
  const absl::StatusOr<IdentityId> id = ParseIdentity(name);
  if (!id.ok()) return IdentityUse::Stream();  // Within the process.
  absl::StatusOr<IdentityUse::Stream> stream = access->use().OpenStream(*id);
  if (!stream.ok()) {
    access->NoteRefused(absl::StrCat(name, " at ", context.peer()), operation, stream.status(),
                        absl::Now());
  }
  return stream;
}

void NoteInAudit(const grpc::ServerContext& context, AccessControl* access, const char* what,
                 const std::string& target, const absl::Status& outcome) {
  if (access == nullptr) return;
  const std::string identity = CallerIdentity(context);
  access->audit().Note(
      absl::StrCat(identity.empty() ? kLocalOwner : identity, " at ", context.peer()), what, target,
      outcome);
}

}  // namespace sheaf::coordinator
