// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// How a program reaches a coordinator: with the credentials that a store has for its address, or in
// plain text, which it never does silently beyond its own machine.
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/tls/credential_store.h"

namespace sheaf {

struct FarmConnection {
  std::string address;
  std::optional<CredentialFiles> files;  // None: neither encrypted nor authenticated.

  // Makes a channel, as MakeChannel does.
  std::shared_ptr<grpc::Channel> Open() const;
};

// How long a server may take to answer whether it speaks TLS; then the question stays open.
inline constexpr absl::Duration kTlsProbeTimeout = absl::Seconds(2);

// Looks the address up in the store. Without credentials it asks the coordinator, if one answers,
// whether it speaks TLS. insecure: another machine may be reached in plain text; it is warned of.
// Errors: kInvalidArgument (the address); kUnauthenticated: there are no credentials, and the
// coordinator speaks TLS or is on another machine; the message says how to get some.
absl::StatusOr<FarmConnection> ConnectionTo(const std::string& address,
                                            const CredentialStore& store, bool insecure);

}  // namespace sheaf
