// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/channel.h"

#include <grpc/grpc.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/support/channel_arguments.h>

#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "common/rpc/address.h"
#include "common/rpc/address_list.h"
#include "common/rpc/protocol_calls.h"

namespace sheaf {
namespace {

// Reconnection waits: short enough to find a restarted coordinator at once.
constexpr int kReconnectBackoffInitialMs = 100;
constexpr int kReconnectBackoffMaxMs = 2000;

// Sockets that no call waits for are read by a timer of gRPC alone, every 5 s unless this says
// otherwise when gRPC starts. The end of an attempt to connect would not be noticed before.
[[maybe_unused]] const int kPollIntervalSet =
    ::setenv("GRPC_CLIENT_CHANNEL_BACKUP_POLL_INTERVAL_MS", "100", /*overwrite=*/0);

// Keeps gRPC from cleaning up after its last object: it does so in a thread that the end of the
// process does not wait for, and which then uses what static destructors have freed. Source:
// https://github.com/grpc/grpc/issues/23604.
void HoldGrpc() { [[maybe_unused]] static const bool is_held = (grpc_init(), true); }

// Builds of absl that check themselves, as Debian's, search for cycles at each lock of gRPC's
// mutexes: a twentieth of a busy server's time. Their locks are not ours to judge.
void KeepMutexesCheap() { absl::SetMutexDeadlockDetectionMode(absl::OnDeadlockCycle::kIgnore); }

int Milliseconds(absl::Duration duration) {
  return static_cast<int>(absl::ToInt64Milliseconds(duration));
}

// Coordinators that share a state directory have one certificate, with the names of all: it is
// checked for the first of them, whichever is called.
void NameFirstHost(const std::string& addresses, grpc::ChannelArguments* arguments) {
  const absl::StatusOr<Address> first = ParseAddress(SplitAddresses(addresses).front());
  if (!first.ok()) return;
  arguments->SetSslTargetNameOverride(first->host);
  arguments->SetString(GRPC_ARG_DEFAULT_AUTHORITY, first->host);
}

}  // namespace

std::shared_ptr<grpc::Channel> MakeChannel(
    const std::string& address, const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
  HoldGrpc();
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMessageBytesMax);
  arguments.SetMaxSendMessageSize(kMessageBytesMax);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, Milliseconds(kKeepaliveInterval));
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, Milliseconds(kKeepaliveTimeout));
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, kReconnectBackoffInitialMs);
  // Despite its name this limits the duration of one connection attempt; it delays no other
  // attempt.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, Milliseconds(kConnectTimeout));
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, HasSeveralAddresses(address)
                                                          ? Milliseconds(kFollowInterval)
                                                          : kReconnectBackoffMaxMs);
  if (HasSeveralAddresses(address)) NameFirstHost(address, &arguments);
  // Channels of one process do not share connections: a worker's upload must not delay its
  // heartbeat.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::experimental::CreateCustomChannelWithInterceptors(
      ChannelTarget(address),
      credentials != nullptr ? credentials : grpc::InsecureChannelCredentials(), arguments,
      ProtocolOfClient());
}

void SetDeadline(grpc::ClientContext* context, absl::Duration duration) {
  context->set_deadline(std::chrono::system_clock::now() + absl::ToChronoNanoseconds(duration));
}

void ApplyServerLimits(grpc::ServerBuilder* builder) {
  HoldGrpc();
  KeepMutexesCheap();
  builder->SetSyncServerOption(grpc::ServerBuilder::SyncServerOption::MAX_POLLERS,
                               kIdleThreadsMax);
  builder->SetMaxReceiveMessageSize(kMessageBytesMax);
  builder->SetMaxSendMessageSize(kMessageBytesMax);
  builder->AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder->AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS,
                              Milliseconds(kHandshakeTimeout));
  builder->AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, Milliseconds(kIdleConnectionMax));
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kCallsPerConnectionMax);
  // Accept the pings that MakeChannel sends, also on an idle connection.
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                              Milliseconds(kKeepaliveInterval / 2));
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
}

absl::Status RequireSafeAddress(const std::string& address, bool insecure_remote_allowed) {
  const absl::StatusOr<Address> parsed = ParseAddress(address);
  if (!parsed.ok()) return parsed.status();
  if (insecure_remote_allowed || IsLoopback(*parsed)) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      "will not listen on ", address,
      ": connections are neither encrypted nor authenticated, and other machines could reach it; "
      "run sheaf-coordinator init once, which makes certificates, or listen on 127.0.0.1 (for "
      "experiments on a network you trust: --insecure-allow-remote)"));
}

}  // namespace sheaf
