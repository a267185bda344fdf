// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// gRPC channels and servers of all Sheaf programs, with the same message limits and keepalive on
// both sides. Connections are encrypted where both sides have certificates (tls_credentials.h); a
// server without one listens on loopback unless told otherwise (RequireSafeAddress).
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/server_builder.h>

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace sheaf {

// Limits of messages, the same for every program.
inline constexpr int kMessageBytesMax = 64 << 20;                // A job of 100,000 frames.
inline constexpr size_t kStreamChunkBytesMax = size_t{1} << 20;  // Bytes of a part, image or blob.
// Limit of one connection attempt. At a round trip of 0.8 s TCP, HTTP/2 and two round trips of TLS
// take 3.2 s; a lost packet doubles a wait of 1 s, 2 s and so on.
inline constexpr absl::Duration kConnectTimeout = absl::Seconds(20);
inline constexpr absl::Duration kKeepaliveInterval = absl::Seconds(20);
// A ping waits behind the data that fills a slow link, up to a chunk in each direction.
inline constexpr absl::Duration kKeepaliveTimeout = absl::Seconds(20);
// A server gives a connection this long for TLS, as a client does, and closes it when it has had no
// call for this long. Calls of a connection beyond the maximum wait in the client.
inline constexpr absl::Duration kHandshakeTimeout = kConnectTimeout;
inline constexpr absl::Duration kIdleConnectionMax = absl::Minutes(10);
inline constexpr int kCallsPerConnectionMax = 1000;
// Threads of a server that wait for calls, at most. gRPC ends a thread after its call if there are
// more, and 2 if nothing is said: it then starts a thread for most calls of a busy server.
inline constexpr int kIdleThreadsMax = 64;
// Includes connecting.
inline constexpr absl::Duration kUnaryDeadline = absl::Seconds(60);
// Limit of one attempt: an image of 400 MB on a link of 1 Mbit/s. Keepalive detects a peer that is
// gone.
inline constexpr absl::Duration kStreamDeadline = absl::Hours(1);

// Returns a channel to "host:port". It connects at the first call and again whenever the connection
// is lost, after at most two seconds. Without credentials it is neither encrypted nor
// authenticated.
std::shared_ptr<grpc::Channel> MakeChannel(
    const std::string& address,
    const std::shared_ptr<grpc::ChannelCredentials>& credentials = nullptr);

// Sets the deadline of a call. Every call has one, except watches that last as long as a job.
void SetDeadline(grpc::ClientContext* context, absl::Duration duration);

// Applies the limits above and keepalive to a server, and makes a port in use an error.
void ApplyServerLimits(grpc::ServerBuilder* builder);

// Refuses to listen, without encryption, on addresses that other machines can reach.
// Errors: kInvalidArgument (malformed); kFailedPrecondition naming the flag that allows it.
absl::Status RequireSafeAddress(const std::string& address, bool insecure_remote_allowed);

}  // namespace sheaf
