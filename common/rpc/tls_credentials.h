// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// gRPC's TLS credentials from Sheaf's certificates. Files are read again while a program runs, so
// renewed certificates need no restart; connections keep the certificate with which they began.
#pragma once

#include <grpcpp/security/credentials.h>
#include <grpcpp/security/server_credentials.h>

#include <memory>
#include <string>

#include "absl/time/time.h"
#include "common/tls/credential_store.h"

namespace sheaf {

// How often certificate files are looked at.
inline constexpr absl::Duration kCertificateRefreshInterval = absl::Seconds(10);

// The client side of mutual TLS. The server must show a certificate of the authority for the name
// or address that the client calls.
std::shared_ptr<grpc::ChannelCredentials> MutualTlsCredentials(
    const CredentialFiles& files, absl::Duration refresh = kCertificateRefreshInterval);

// For a client that has no certificate yet: it verifies the server alone.
std::shared_ptr<grpc::ChannelCredentials> EnrolmentCredentials(const std::string& authority_pem);

// Verifies no server and proves no identity; only tests whether a server speaks TLS. Must not be
// used for calls.
std::shared_ptr<grpc::ChannelCredentials> UnverifiedTlsCredentials();

// The server side. TLS makes a client that shows a certificate prove that it has the key; whether
// the certificate is valid, the processor decides at each call, so that refusals have words and a
// connection does not outlive a certificate or a revocation.
std::shared_ptr<grpc::ServerCredentials> TlsServerCredentials(
    const CredentialFiles& files, const std::shared_ptr<grpc::AuthMetadataProcessor>& processor,
    absl::Duration refresh = kCertificateRefreshInterval);

}  // namespace sheaf
