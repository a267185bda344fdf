// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A coordinator with certificates, over mutual TLS on loopback, and clients that enrol.
#pragma once

#include <grpcpp/generic/generic_stub.h>

#include <memory>
#include <string>

#include <gtest/gtest.h>
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "common/base/file.h"
#include "common/rpc/enrolment.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/tls_credentials.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {

inline const IdentityId kAnna{IdentityKind::kUser, "anna"};
inline const IdentityId kBen{IdentityKind::kUser, "ben"};
inline const IdentityId kNode{IdentityKind::kWorker, "node7"};

class CoordinatorAccessTest : public CoordinatorServerTest {
 protected:
  CoordinatorAccessTest() {
    options_.listen_address = "127.0.0.1:0";
    const absl::Status created = CertificateAuthority::Create(
        AccessControl::Directory(directory_), {"localhost", "127.0.0.1"}, absl::Now());
    EXPECT_TRUE(created.ok()) << created;
  }

  std::string Address() const { return absl::StrCat("127.0.0.1:", server_->port()); }
  std::string Token(const IdentityId& id, Role role) {
    const absl::StatusOr<std::string> secret =
        server_->access()->identities().MakeToken(id, role, absl::Now(), kTokenLifetime);
    EXPECT_TRUE(secret.ok()) << secret.status();
    return secret.value_or("");
  }
  EnrolmentToken TokenText(const std::string& secret) {
    return {secret, server_->access()->authority().certificate_pem()};
  }
  // The files of an identity that is enrolled over the network, in a store of its own.
  CredentialFiles Enrol(const IdentityId& id, Role role) {
    const absl::StatusOr<Enrolment> enrolled =
        sheaf::Enroll(Address(), TokenText(Token(id, role)),
                      CredentialStore(absl::StrCat(directory_, "/clients/", FormatIdentity(id))));
    EXPECT_TRUE(enrolled.ok()) << enrolled.status();
    return enrolled.ok() ? enrolled->files : CredentialFiles{};
  }
  std::shared_ptr<grpc::Channel> ChannelOf(const CredentialFiles& files) {
    return MakeChannel(Address(), MutualTlsCredentials(files, absl::Seconds(1)));
  }
  std::shared_ptr<grpc::Channel> ChannelOf(const IdentityId& id, Role role) {
    return ChannelOf(Enrol(id, role));
  }
  std::shared_ptr<grpc::Channel> ChannelWithoutCertificate() {
    return MakeChannel(Address(),
                       EnrolmentCredentials(server_->access()->authority().certificate_pem()));
  }
  // Calls any method with an empty request, which is valid for every method. An admitted call is
  // answered by an error of the handler.
  absl::Status Call(const std::shared_ptr<grpc::Channel>& channel, const std::string& operation) {
    grpc::GenericStub stub(channel);
    grpc::ClientContext context;
    SetDeadline(&context, kPatience);
    grpc::CompletionQueue queue;
    const auto call = stub.PrepareCall(&context, operation, &queue);
    call->StartCall(reinterpret_cast<void*>(1));
    const auto wait = [&queue] {
      void* tag = nullptr;
      bool ok = false;
      return queue.Next(&tag, &ok) && ok;
    };
    wait();
    call->WriteLast(grpc::ByteBuffer(nullptr, 0), grpc::WriteOptions(), reinterpret_cast<void*>(2));
    wait();
    grpc::ByteBuffer answer;
    call->Read(&answer, reinterpret_cast<void*>(3));
    if (wait()) context.TryCancel();  // An endless stream: it was let in.
    grpc::Status status;
    call->Finish(&status, reinterpret_cast<void*>(4));
    wait();
    queue.Shutdown();
    return FromGrpcStatus(status);
  }
  static bool WasRefused(const absl::Status& status) {
    return absl::IsUnauthenticated(status) || absl::IsPermissionDenied(status);
  }
  absl::Status GetJob(const std::shared_ptr<grpc::Channel>& channel) {
    return Call(channel, "/sheaf.v1.JobService/GetJob");
  }
  std::string Audit() const { return ReadWholeFile(directory_ + "/audit.log").value_or(""); }
  bool AuditHas(const std::string& who, const std::string& what, const std::string& outcome) {
    const std::string text = Audit();
    for (const absl::string_view line : absl::StrSplit(text, '\n')) {
      if (absl::StrContains(line, absl::StrCat("\"who\":\"", who)) &&
          absl::StrContains(line, absl::StrCat("\"what\":\"", what, "\"")) &&
          absl::StrContains(line, absl::StrCat("\"outcome\":\"", outcome))) {
        return true;
      }
    }
    return false;
  }
};

}  // namespace sheaf::coordinator
