// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests who is let in to which call of which service, who is refused, and the audit log.
#include <google/protobuf/descriptor.h>

#include <atomic>
#include <filesystem>
#include <latch>
#include <set>
#include <thread>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "common/base/file.h"
#include "common/rpc/certificate_renewal.h"
#include "common/rpc/enrolment.h"
#include "common/rpc/farm_connection.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/tls_credentials.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "sheaf/v1/access.grpc.pb.h"
#include "tests/support/farm/coordinator_access_fixture.h"

namespace sheaf::coordinator {
namespace {

// All methods of the services that the coordinator registers.
std::set<std::string> AllOperations() {
  std::set<std::string> operations = {
      "/grpc.health.v1.Health/Check", "/grpc.health.v1.Health/Watch",
      "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"};
  const auto* pool = google::protobuf::DescriptorPool::generated_pool();
  // One message of each file links the file's descriptors in.
  for (const google::protobuf::FileDescriptor* file :
       {v1::EnrollRequest::descriptor()->file(), v1::CreateJobRequest::descriptor()->file(),
        v1::FindMissingRequest::descriptor()->file(), v1::PlanWriteRequest::descriptor()->file(),
        v1::SynchronizeRequest::descriptor()->file()}) {
    EXPECT_NE(pool->FindFileByName(file->name()), nullptr);
    for (int i = 0; i < file->service_count(); ++i) {
      for (int j = 0; j < file->service(i)->method_count(); ++j) {
        operations.insert(absl::StrCat("/", file->service(i)->full_name(), "/",
                                       file->service(i)->method(j)->name()));
      }
    }
  }
  return operations;
}

TEST_F(CoordinatorAccessTest, TheRoleTableNamesEachMethodOfEachService) {
  std::set<std::string> named;
  for (const OperationRule& rule : RoleTable()) {
    if (rule.operation[0] == '/') named.insert(rule.operation);
  }
  EXPECT_EQ(named, AllOperations());
}

TEST_F(CoordinatorAccessTest, EachCallIsLetInByTheTableAlone) {
  Start();
  const std::pair<std::optional<Role>, std::shared_ptr<grpc::Channel>> callers[] = {
      {std::nullopt, ChannelWithoutCertificate()},
      {Role::kWork, ChannelOf(kNode, Role::kWork)},
      {Role::kView, ChannelOf({IdentityKind::kUser, "vera"}, Role::kView)},
      {Role::kSubmit, ChannelOf({IdentityKind::kUser, "sam"}, Role::kSubmit)},
      {Role::kOperate, ChannelOf({IdentityKind::kUser, "olga"}, Role::kOperate)},
      {Role::kAdminister, ChannelOf({IdentityKind::kUser, "adam"}, Role::kAdminister)}};
  for (const auto& [role, channel] : callers) {
    for (const std::string& operation : AllOperations()) {
      const absl::Status status = Call(channel, operation);
      // An empty token is refused by the handler of Enroll, which everybody reaches.
      const bool enrolling = absl::StrContains(operation, "/Enroll");
      const bool refused = enrolling ? !absl::IsInvalidArgument(status) : WasRefused(status);
      EXPECT_EQ(refused, !Permits(*RequirementOf(operation), role))
          << (role ? RoleName(*role) : "no role") << " " << operation << ": " << status;
    }
  }
  EXPECT_TRUE(AuditHas("a gRPC client", "GetJob", "UNAUTHENTICATED"));
  EXPECT_TRUE(AuditHas("worker:node7", "CreateJob", "PERMISSION_DENIED"));
  EXPECT_TRUE(AuditHas("user:vera", "CancelJob", "PERMISSION_DENIED"));
}

TEST_F(CoordinatorAccessTest, PlainTextGetsNoAnswer) {
  Start();
  const absl::Status status = GetJob(MakeChannel(Address()));
  EXPECT_TRUE(absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status)) << status;
}

TEST_F(CoordinatorAccessTest, AClientWithoutACertificateIsToldSo) {
  Start();
  const CredentialStore none(directory_ + "/none");
  const auto message = [&](const std::string& address, bool insecure) {
    const absl::Status status = ConnectionTo(address, none, insecure).status();
    EXPECT_TRUE(absl::IsUnauthenticated(status)) << status;
    return std::string(status.message());
  };
  using ::testing::HasSubstr;
  EXPECT_THAT(message(Address(), false),
              HasSubstr(absl::StrCat("speaks TLS, and no certificate for ", Address())));
  EXPECT_THAT(message(Address(), false), HasSubstr("sheaf login"));
  // Not an address of loopback, and reaches it.
  const std::string remote = absl::StrCat("[::ffff:127.0.0.1]:", server_->port());
  EXPECT_THAT(message(remote, false), HasSubstr("--insecure"));
  EXPECT_THAT(message(remote, true), HasSubstr("speaks TLS"));
  Enrol(kAnna, Role::kView);
  const CredentialStore annas(directory_ + "/clients/user:anna");
  const absl::StatusOr<FarmConnection> connection = ConnectionTo(Address(), annas, false);
  ASSERT_TRUE(connection.ok()) << connection.status();
  EXPECT_TRUE(connection->files.has_value());
}

TEST_F(CoordinatorAccessTest, PlainTextIsForLoopbackOrOnRequest) {
  std::filesystem::remove_all(AccessControl::Directory(directory_));
  Start();
  const CredentialStore none(directory_ + "/none");
  const std::string remote = absl::StrCat("[::ffff:127.0.0.1]:", server_->port());
  EXPECT_TRUE(absl::IsUnauthenticated(ConnectionTo(remote, none, false).status()));
  for (const std::string& address : {Address(), remote}) {
    const absl::StatusOr<FarmConnection> connection = ConnectionTo(address, none, true);
    ASSERT_TRUE(connection.ok()) << connection.status();
    EXPECT_TRUE(absl::IsInvalidArgument(GetJob(connection->Open())));
  }
  EXPECT_TRUE(ConnectionTo(Address(), none, false).ok());
  EXPECT_TRUE(ConnectionTo("127.0.0.1:1", none, false).ok()) << "no server is there yet";
}

TEST_F(CoordinatorAccessTest, AClientTrustsItsOwnAuthorityOnly) {
  Start();
  CertificateTerms terms;
  terms.use = CertificateUse::kAuthority;
  terms.common_name = "another farm";
  terms.not_before = absl::Now() - absl::Hours(1);
  terms.not_after = absl::Now() + absl::Hours(1);
  const std::string other = *MakeAuthorityCertificate(terms, GenerateKey());
  const absl::Status status =
      Call(MakeChannel(Address(), EnrolmentCredentials(other)), "/sheaf.v1.AccessService/Enroll");
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
}

TEST_F(CoordinatorAccessTest, AServerUnderAnotherNameIsRefusedByItsClients) {
  std::filesystem::remove_all(AccessControl::Directory(directory_));
  ASSERT_TRUE(CertificateAuthority::Create(AccessControl::Directory(directory_),
                                           {"farm.example.org"}, absl::Now())
                  .ok());
  Start();
  EXPECT_TRUE(
      absl::IsUnavailable(Call(ChannelWithoutCertificate(), "/sheaf.v1.AccessService/Enroll")));
}

TEST_F(CoordinatorAccessTest, RevocationEndsAnOpenConnectionAtItsNextCall) {
  Start();
  const auto anna = ChannelOf(kAnna, Role::kView);
  EXPECT_FALSE(WasRefused(GetJob(anna)));
  // As the command does it, in another process.
  ASSERT_TRUE((*AccessControl::Open(directory_))->identities().Revoke(kAnna, absl::Now()).ok());
  EXPECT_TRUE(absl::IsUnauthenticated(GetJob(anna)));
  EXPECT_TRUE(AuditHas("a gRPC client", "GetJob", "UNAUTHENTICATED: user:anna is revoked"));
}

TEST_F(CoordinatorAccessTest, RevocationEndsAWatch) {
  Start();
  const std::string name = Create(Request(1 << 20)).name();
  const auto watcher = v1::JobService::NewStub(ChannelOf(kAnna, Role::kView));
  grpc::ClientContext context;
  SetDeadline(&context, kPatience);
  v1::WatchJobRequest request;
  request.set_name(name);
  const auto reader = watcher->WatchJob(&context, request);
  v1::Job job;
  ASSERT_TRUE(reader->Read(&job));
  ASSERT_TRUE(server_->access()->identities().Revoke(kAnna, absl::Now()).ok());
  while (reader->Read(&job)) {
  }
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::UNAUTHENTICATED);
}

TEST_F(CoordinatorAccessTest, AnExpiredCertificateIsRefusedOnAnOpenConnectionToo) {
  // A slow machine may take longer for the first call than the certificate lasts.
  absl::Duration lifetime = absl::Seconds(3);
  std::shared_ptr<grpc::Channel> anna;
  for (bool was_refused = true; was_refused && lifetime < kPatience; lifetime *= 2) {
    options_.certificate_lifetimes.user = lifetime;
    Start();
    anna = ChannelOf(kAnna, Role::kView);
    was_refused = WasRefused(GetJob(anna));
  }
  ASSERT_LT(lifetime, kPatience);
  absl::SleepFor(options_.certificate_lifetimes.user + absl::Seconds(1));
  EXPECT_TRUE(absl::IsUnauthenticated(GetJob(anna)));
  EXPECT_TRUE(AuditHas("a gRPC client", "GetJob",
                       "UNAUTHENTICATED: the certificate of user:anna has expired"));
}

TEST_F(CoordinatorAccessTest, AReplayedTokenEnrolsNobody) {
  Start();
  const std::string secret = Token(kAnna, Role::kView);
  const auto enrol = [&](const std::string& folder) {
    return sheaf::Enroll(Address(), TokenText(secret),
                         CredentialStore(absl::StrCat(directory_, "/clients/", folder)))
        .status();
  };
  EXPECT_TRUE(enrol("first").ok());
  EXPECT_TRUE(absl::IsUnauthenticated(enrol("thief")));
  EXPECT_TRUE(AuditHas("ipv4:127.0.0.1", "Enroll", "ok"));
  EXPECT_TRUE(AuditHas("ipv4:127.0.0.1", "Enroll", "UNAUTHENTICATED"));
}

TEST_F(CoordinatorAccessTest, OfManyConcurrentEnrolmentsWithOneTokenOneSucceeds) {
  Start();
  const EnrolmentToken token = TokenText(Token(kNode, Role::kWork));
  constexpr int kMachines = 8;
  std::atomic<int> enrolled{0};
  std::latch together(kMachines);
  {
    std::vector<std::jthread> machines;
    for (int i = 0; i < kMachines; ++i) {
      machines.emplace_back([&, i] {
        together.arrive_and_wait();
        const CredentialStore store(absl::StrCat(directory_, "/clients/", i));
        if (sheaf::Enroll(Address(), token, store).ok()) ++enrolled;
      });
    }
  }
  EXPECT_EQ(enrolled, 1);
}

TEST_F(CoordinatorAccessTest, SubmittersControlTheirOwnJobsAndOperatorsAll) {
  Start();
  const auto stub = [&](const IdentityId& id, Role role) {
    return v1::JobService::NewStub(ChannelOf(id, role));
  };
  const auto anna = stub(kAnna, Role::kSubmit), ben = stub(kBen, Role::kSubmit);
  const auto olga = stub({IdentityKind::kUser, "olga"}, Role::kOperate);
  v1::Job job;
  grpc::ClientContext creating;
  ASSERT_TRUE(anna->CreateJob(&creating, Request(16), &job).ok());
  EXPECT_EQ(job.owner(), "anna");
  const auto code = [&](const auto& call, auto request) {
    grpc::ClientContext context;
    request.set_name(job.name());
    v1::Job changed;
    return call(&context, request, &changed).error_code();
  };
  const auto all_of = [&](v1::JobService::Stub* by) {
    return std::vector<grpc::StatusCode>{
        code([&](auto... a) { return by->PauseJob(a...); }, v1::PauseJobRequest()),
        code([&](auto... a) { return by->ResumeJob(a...); }, v1::ResumeJobRequest()),
        code([&](auto... a) { return by->SetJobPriority(a...); }, v1::SetJobPriorityRequest()),
        code([&](auto... a) { return by->CancelJob(a...); }, v1::CancelJobRequest())};
  };
  const std::vector<grpc::StatusCode> refused(4, grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(all_of(ben.get()), refused);
  EXPECT_EQ(code([&](auto... a) { return ben->RefineJob(a...); }, v1::RefineJobRequest()),
            grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(code([&](auto... a) { return ben->KillTasks(a...); }, v1::KillTasksRequest()),
            grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_TRUE(AuditHas("user:ben", "KillTasks", "PERMISSION_DENIED"));
  EXPECT_TRUE(AuditHas("user:ben", "CancelJob", "PERMISSION_DENIED: the job belongs to anna"));
  EXPECT_EQ(all_of(olga.get()), std::vector<grpc::StatusCode>(4, grpc::StatusCode::OK));
  EXPECT_TRUE(AuditHas("user:anna", "CreateJob", "ok"));
  EXPECT_TRUE(AuditHas("user:olga", "CancelJob", "ok"));
}

TEST_F(CoordinatorAccessTest, AnOwnerSurvivesARestart) {
  Start();
  const auto anna = v1::JobService::NewStub(ChannelOf(kAnna, Role::kSubmit));
  v1::Job job;
  grpc::ClientContext creating;
  ASSERT_TRUE(anna->CreateJob(&creating, Request(16), &job).ok());
  Start();
  EXPECT_EQ(Get(job.name()).owner(), "anna");
}

TEST_F(CoordinatorAccessTest, AWorkerWorksThroughTheRotationOfItsCertificate) {
  options_.certificate_lifetimes.worker = absl::Seconds(20);
  Start();
  const CredentialFiles files = Enrol(kNode, Role::kWork);
  const std::string first = *ReadWholeFile(files.certificate_path);
  const CertificateRenewal renewal(Address(), files, absl::Milliseconds(200));
  SyntheticWorker worker(ChannelOf(files), "node7-1");
  const SteadyTime end = SteadyTime::Now() + kPatience;
  int renewals = 0;
  std::string last = first;
  while (renewals < 2 && SteadyTime::Now() < end) {
    ASSERT_TRUE(worker.Synchronize(0).ok());
    const std::string now = *ReadWholeFile(files.certificate_path);
    renewals += now != last;
    last = now;
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_GE(renewals, 2);
  EXPECT_TRUE(worker.Synchronize(0).ok());
  EXPECT_TRUE(AuditHas("worker:node7", "RenewCertificate", "ok"));
}

TEST_F(CoordinatorAccessTest, NobodyKeepsOthersFromWorking) {
  options_.farm.limits.owner_jobs_max = 1;
  options_.identity_limits.upload_bytes_per_day_max = 10;
  options_.identity_limits.user_streams_max = 1;
  options_.identity_limits.calls_burst_max = 20;
  options_.identity_limits.calls_per_second_max = 0.001;
  Start();
  const auto channel = ChannelOf(kAnna, Role::kSubmit);
  const auto anna = v1::JobService::NewStub(channel);
  v1::Job job;
  const auto create = [&](const std::string& request_id) {
    grpc::ClientContext context;
    return FromGrpcStatus(anna->CreateJob(&context, Request(1 << 20, request_id), &job));
  };
  EXPECT_TRUE(create("1").ok());
  EXPECT_TRUE(create("1").ok()) << "the same call, sent again, makes no second job";
  const absl::Status refused = create("2");
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_TRUE(absl::StrContains(refused.message(), "the limit of a user")) << refused;

  const auto upload = [&](uint64_t size_bytes) {
    grpc::ClientContext context;
    v1::WriteBlobResponse written;
    const auto writer = v1::ContentService::NewStub(channel)->WriteBlob(&context, &written);
    v1::WriteBlobRequest begin;
    begin.mutable_digest()->set_sha256_hex(std::string(64, '0'));
    begin.mutable_digest()->set_size_bytes(size_bytes);
    writer->Write(begin);
    writer->WritesDone();
    return FromGrpcStatus(writer->Finish());
  };
  const absl::Status too_large = upload(11);
  EXPECT_TRUE(absl::IsResourceExhausted(too_large)) << too_large;
  EXPECT_TRUE(absl::IsInvalidArgument(upload(10))) << "it is within the limit, but no byte comes";
  EXPECT_TRUE(absl::IsInvalidArgument(upload(10))) << "bytes that did not come do not count";
  EXPECT_TRUE(AuditHas("user:anna", "WriteBlob", "RESOURCE_EXHAUSTED"));

  grpc::ClientContext watching;
  SetDeadline(&watching, kPatience);
  v1::WatchJobRequest watch;
  watch.set_name(job.name());
  v1::Job seen;
  const auto watcher = anna->WatchJob(&watching, watch);
  ASSERT_TRUE(watcher->Read(&seen));
  grpc::ClientContext watching_again;
  const auto second = anna->WatchJob(&watching_again, watch);
  EXPECT_FALSE(second->Read(&seen));
  EXPECT_EQ(second->Finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  watching.TryCancel();

  int calls = 0;
  while (!absl::IsResourceExhausted(GetJob(channel)) && calls < 30) ++calls;
  EXPECT_LT(calls, 20);
  EXPECT_TRUE(AuditHas("user:anna", "GetJob", "RESOURCE_EXHAUSTED"));
  const absl::Status other = GetJob(ChannelOf(kBen, Role::kView));
  EXPECT_FALSE(absl::IsResourceExhausted(other)) << other;
  using ::testing::ElementsAre;
  EXPECT_THAT(server_->access()->use().Refused(), ElementsAre(1, 0, 1, 1, 0, 0));
}

TEST_F(CoordinatorAccessTest, ARenewedCertificateIsTheCallersOwn) {
  Start();
  const CredentialFiles files = Enrol(kAnna, Role::kView);
  Enrol(kBen, Role::kAdminister);
  ASSERT_TRUE(*RenewCertificate(Address(), files, 0));
  EXPECT_EQ(ReadCertificate(*ReadWholeFile(files.certificate_path))->common_name, "user:anna");
}

}  // namespace
}  // namespace sheaf::coordinator
