// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The caller of a gRPC call. CallGate has admitted the call; handlers get its identity here.
#pragma once

#include <grpcpp/server_context.h>

#include <string>

#include "absl/status/statusor.h"
#include "coordinator/access/access_control.h"

namespace sheaf::coordinator {

// "user:NAME" or "worker:NAME": the common name of the caller's certificate, which CallGate has
// verified. Empty without TLS, and for calls within the process.
std::string CallerIdentity(const grpc::ServerContext& context);

// The caller's address without its port: "ipv4:192.0.2.7".
std::string CallerAddress(const grpc::ServerContext& context);

// The caller with its role, as of now: an identity may be revoked while a long call runs.
// access: null without certificates. A caller without TLS has no identity. Errors:
// kUnauthenticated.
absl::StatusOr<Caller> CallerOf(const grpc::ServerContext& context, AccessControl* access);

// The owner of jobs that the caller submits: a user's name, or kLocalOwner without TLS.
std::string OwnerOf(const grpc::ServerContext& context);

// Checks that the caller may control a job of the owner; without TLS every caller may. Errors:
// kPermissionDenied, kUnauthenticated.
absl::Status RequireJobControl(const grpc::ServerContext& context, AccessControl* access,
                               const std::string& owner);

// Counts a streaming call among its caller's open streams, until the result is destroyed; a no-op
// without TLS. operation: for the audit log. Errors: kResourceExhausted, recorded.
absl::StatusOr<IdentityUse::Stream> OpenStream(const grpc::ServerContext& context,
                                               AccessControl* access, const char* operation);

// Records that the call changed the target, or why it did not. access: may be null.
void NoteInAudit(const grpc::ServerContext& context, AccessControl* access, const char* what,
                 const std::string& target, const absl::Status& outcome);

}  // namespace sheaf::coordinator
