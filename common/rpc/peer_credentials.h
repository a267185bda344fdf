// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Mutual TLS between two workers of a farm. Both show the certificates with which they are enrolled
// at the coordinator; TLS makes each prove that it has its key. These certificates state no host
// names and are a client's, so each side verifies the other's here, as the coordinator does: issued
// by the farm's authority, valid now, and a worker's.
#pragma once

#include <grpcpp/security/credentials.h>
#include <grpcpp/security/server_credentials.h>

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/tls/credential_store.h"

namespace sheaf {

// How the common name of a worker's certificate begins.
inline constexpr char kWorkerNamePrefix[] = "worker:";

// Whether the certificate is a worker's of the authority's farm. identity: its common name; empty:
// any worker's. Errors: kUnauthenticated, saying why not.
absl::Status VerifyWorkerCertificate(const std::string& certificate_pem,
                                     const std::string& authority_pem, const std::string& identity,
                                     absl::Time now);

// For a channel to the worker with this identity. Errors: those of reading files.
absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> PeerChannelCredentials(
    const CredentialFiles& files, const std::string& identity);

// For a worker that serves the farm's other workers. Errors: those of reading files.
absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> PeerServerCredentials(
    const CredentialFiles& files);

}  // namespace sheaf
