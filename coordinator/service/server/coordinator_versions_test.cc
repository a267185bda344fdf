// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Programs of other versions of the protocol, and tools that say no version, call a coordinator; a
// coordinator that says no version is called.
#include <grpcpp/create_channel.h>
#include <grpcpp/security/server_credentials.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/rpc/protocol_calls.h"
#include "coordinator/service/grpc/worker_versions.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_access_fixture.h"

namespace sheaf::coordinator {
namespace {

// A channel of a program that understands these versions.
std::shared_ptr<grpc::Channel> ChannelOfVersions(
    const std::string& address, const ProtocolRange& range,
    const std::shared_ptr<grpc::ChannelCredentials>& credentials =
        grpc::InsecureChannelCredentials()) {
  return grpc::experimental::CreateCustomChannelWithInterceptors(
      address, credentials, grpc::ChannelArguments(), ProtocolOfClient(range));
}

grpc::Status ListJobs(const std::shared_ptr<grpc::Channel>& channel, grpc::ClientContext* context) {
  SetDeadline(context, kPatience);
  v1::ListJobsResponse response;
  return v1::JobService::NewStub(channel)->ListJobs(context, v1::ListJobsRequest(), &response);
}

class CoordinatorVersionsTest : public CoordinatorServerTest {
 protected:
  void SetUp() override {
    options_.listen_address = "127.0.0.1:0";
    Start();
    address_ = absl::StrCat("127.0.0.1:", server_->port());
  }
  grpc::Status CallAs(const ProtocolRange& range) {
    grpc::ClientContext context;
    return ListJobs(ChannelOfVersions(address_, range), &context);
  }

  std::string address_;
};

TEST_F(CoordinatorVersionsTest, NeighboursAreServed) {
  for (const ProtocolRange& range :
       {kProtocol, ProtocolRange{1, 1}, ProtocolRange{kProtocolVersion, kProtocolVersion + 1}}) {
    const grpc::Status status = CallAs(range);
    EXPECT_TRUE(status.ok()) << FormatProtocol(range) << ' ' << status.error_message();
  }
}

TEST_F(CoordinatorVersionsTest, ToolsThatSayNoVersionAreServedAndAnsweredWithOne) {
  grpc::ClientContext context;
  const grpc::Status status =
      ListJobs(grpc::CreateChannel(address_, grpc::InsecureChannelCredentials()), &context);
  EXPECT_TRUE(status.ok()) << status.error_message();
  const auto& answer = context.GetServerInitialMetadata();
  const auto said = answer.find(kProtocolKey);
  ASSERT_NE(said, answer.end());
  EXPECT_EQ(std::string(said->second.data(), said->second.size()), FormatProtocol(kProtocol));
}

TEST_F(CoordinatorVersionsTest, ANewerWorkerIsRefusedInWordsBeforeItsCallIsMade) {
  const auto count = [this] {
    grpc::ClientContext context;
    v1::ListWorkersResponse response;
    EXPECT_TRUE(jobs_->ListWorkers(&context, v1::ListWorkersRequest(), &response).ok());
    return response.workers_size();
  };
  SyntheticWorker newer(ChannelOfVersions(address_, {kProtocolVersion + 1, kProtocolVersion + 2}),
                        "host-1-newer");
  const absl::Status status = newer.Synchronize(1);
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_EQ(status.message(),
            absl::StrCat("this program speaks versions ", kProtocolVersion + 1, " to ",
                         kProtocolVersion + 2, " of Sheaf's protocol, and the coordinator version ",
                         kProtocolVersion,
                         ": the coordinator's program is older; update it, or use its release here "
                         "meanwhile"));
  EXPECT_EQ(count(), 0) << "its handler was called";
  SyntheticWorker neighbour(ChannelOfVersions(address_, {1, 1}), "host-2-older");
  EXPECT_TRUE(neighbour.Synchronize(1).ok());
  EXPECT_EQ(count(), 1);
}

TEST_F(CoordinatorVersionsTest, StreamsAreRefusedToo) {
  const v1::Job job = Create(Request(16));
  const auto channel = ChannelOfVersions(address_, {kProtocolVersion + 1, kProtocolVersion + 1});
  grpc::ClientContext context;
  SetDeadline(&context, kPatience);
  v1::WatchJobRequest request;
  request.set_name(job.name());
  const auto reader = v1::JobService::NewStub(channel)->WatchJob(&context, request);
  v1::Job message;
  EXPECT_FALSE(reader->Read(&message));
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::FAILED_PRECONDITION);
}

TEST_F(CoordinatorVersionsTest, MalformedVersionsAreRefused) {
  grpc::ClientContext context;
  context.AddMetadata(kProtocolKey, "newest");
  const grpc::Status status =
      ListJobs(grpc::CreateChannel(address_, grpc::InsecureChannelCredentials()), &context);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_NE(status.error_message().find("sheaf-protocol: \"newest\""), std::string::npos)
      << status.error_message();
}

TEST_F(CoordinatorAccessTest, OtherVersionsAreRefusedOverTlsToo) {
  Start();
  const CredentialFiles files = Enrol(kAnna, Role::kView);
  const auto list_jobs_as = [&](const ProtocolRange& range) {
    grpc::ClientContext context;
    return ListJobs(
        ChannelOfVersions(Address(), range, MutualTlsCredentials(files, absl::Seconds(1))),
        &context);
  };
  EXPECT_TRUE(list_jobs_as({kProtocolVersion, kProtocolVersion + 1}).ok());
  const grpc::Status status = list_jobs_as({kProtocolVersion + 1, kProtocolVersion + 2});
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_NE(status.error_message().find("the coordinator's program is older"), std::string::npos)
      << status.error_message();
}

// A coordinator that takes every call and says no version.
class OldCoordinator final : public v1::JobService::Service {
 public:
  OldCoordinator() {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  std::string address() const { return absl::StrCat("127.0.0.1:", port_); }

  grpc::Status ListJobs(grpc::ServerContext* /*context*/, const v1::ListJobsRequest* /*request*/,
                        v1::ListJobsResponse* /*response*/) override {
    return grpc::Status::OK;
  }
  grpc::Status GetJob(grpc::ServerContext* /*context*/, const v1::GetJobRequest* /*request*/,
                      v1::Job* /*response*/) override {
    return {grpc::StatusCode::NOT_FOUND, "there is no such job"};
  }

 private:
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

TEST(OldCoordinatorTest, IsRefusedOnlyByProgramsThatNoLongerUnderstandIt) {
  const OldCoordinator old;
  grpc::ClientContext neighbour, later, asking;
  EXPECT_TRUE(ListJobs(MakeChannel(old.address()), &neighbour).ok());
  const auto channel = ChannelOfVersions(old.address(), {2, 3});
  const grpc::Status refused = ListJobs(channel, &later);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(refused.error_message(),
            "this program speaks versions 2 to 3 of Sheaf's protocol, and the coordinator version "
            "1: the coordinator's program is older; update it, or use its release here meanwhile");
  v1::Job job;
  EXPECT_EQ(
      v1::JobService::NewStub(channel)->GetJob(&asking, v1::GetJobRequest(), &job).error_code(),
      grpc::StatusCode::NOT_FOUND)
      << "an error of the call itself";
}

TEST(WorkerVersionsTest, OlderWorkersAreToldOfOnce) {
  WorkerVersions versions;
  EXPECT_FALSE(versions.Note("host-1-new", kProtocolVersion));
  EXPECT_TRUE(versions.Note("host-2-old", kProtocolVersion - 1));
  EXPECT_FALSE(versions.Note("host-2-old", kProtocolVersion - 1));
  EXPECT_TRUE(versions.Note("host-3-old", kProtocolVersion - 1));
}

}  // namespace
}  // namespace sheaf::coordinator
