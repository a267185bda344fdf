// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/farm_connection.h"

#include <chrono>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/rpc/address.h"
#include "common/rpc/address_list.h"
#include "common/rpc/channel.h"
#include "common/rpc/enrolment.h"
#include "common/rpc/tls_credentials.h"

namespace sheaf {
namespace {

// Makes a connection without a call, so an unverified server learns nothing.
bool SpeaksTls(const std::string& address) {
  const auto channel = MakeChannel(address, UnverifiedTlsCredentials());
  const auto deadline =
      std::chrono::system_clock::now() + absl::ToChronoNanoseconds(kTlsProbeTimeout);
  grpc_connectivity_state state = channel->GetState(/*try_to_connect=*/true);
  while (state == GRPC_CHANNEL_IDLE || state == GRPC_CHANNEL_CONNECTING) {
    if (!channel->WaitForStateChange(state, deadline)) break;
    state = channel->GetState(/*try_to_connect=*/true);
  }
  return state == GRPC_CHANNEL_READY;
}

absl::Status NoCertificateError(const char* what, const std::string& address, const char* or_else) {
  return absl::UnauthenticatedError(
      absl::StrCat(what, address, " is stored here; run sheaf login ", address,
                   " with a token of sheaf-coordinator enroll user NAME (a worker: sheaf-worker "
                   "--token FILE with one of enroll worker NAME)",
                   or_else));
}

}  // namespace

std::shared_ptr<grpc::Channel> FarmConnection::Open() const {
  return MakeChannel(address, files ? MutualTlsCredentials(*files) : nullptr);
}

absl::StatusOr<FarmConnection> ConnectionTo(const std::string& address,
                                            const CredentialStore& store, bool insecure) {
  FarmConnection connection{address, std::nullopt};
  bool remote = false;
  for (const std::string& each : SplitAddresses(address)) {
    // Coordinators of one farm have one authority.
    if (!connection.files) connection.files = store.Find(each);
    const absl::StatusOr<Address> parsed = ParseAddress(each);
    if (!parsed.ok()) return parsed.status();
    remote = remote || !IsLoopback(*parsed);
  }
  if (connection.files) {
    const absl::StatusOr<std::string> certificate =
        ReadWholeFile(connection.files->certificate_path, kPemBytesMax);
    if (certificate.ok()) WarnOfClock(*certificate);
    return connection;
  }
  if (remote && !insecure) {
    return NoCertificateError("no certificate for the coordinator at ", address,
                              ", or, for experiments on a network that you trust, connect without "
                              "encryption by --insecure");
  }
  if (SpeaksTls(address)) {
    return NoCertificateError("the coordinator speaks TLS, and no certificate for ", address, "");
  }
  if (remote) {
    LogWarning(absl::StrCat("--insecure: the connection to ", address,
                            " is neither encrypted nor authenticated"));
  }
  return connection;
}

}  // namespace sheaf
