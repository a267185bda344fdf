// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A coordinator whose parts and scenes lie on an S3 server: the same images, also where the server
// fails, where results are stored by their senders, and after a start with an empty cache.
#include <filesystem>
#include <utility>

#include "absl/strings/match.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_server_fixture.h"
#include "tests/support/farm/s3_test_server.h"

namespace sheaf::coordinator {
namespace {

using FaultKind = S3TestServer::FaultKind;
using Response = v1::UploadResultsResponse;

class CoordinatorObjectsTest : public CoordinatorServerTest {
 protected:
  CoordinatorObjectsTest() {
    const S3Options of_server = fake_.Options();
    variables_ = {{"AWS_ACCESS_KEY_ID", of_server.credentials.access_key_id},
                  {"AWS_SECRET_ACCESS_KEY", of_server.credentials.secret_access_key},
                  {"AWS_ENDPOINT_URL", of_server.endpoint},
                  {"AWS_REGION", of_server.region}};
    options_.objects_url = "s3://farm/p";
    options_.environment = [this](const std::string& name) -> std::optional<std::string> {
      const auto found = variables_.find(name);
      if (found == variables_.end()) return std::nullopt;
      return found->second;
    };
  }

  v1::CreateJobRequest SmallTiles(uint64_t samples) {
    v1::CreateJobRequest request = Request(samples);
    request.mutable_partition()->set_tile_size_px(16);
    request.mutable_partition()->set_pass_sample_count(16);
    return request;
  }
  int CountObjects(const std::string& folder) const {
    int count = 0;
    for (const auto& [key, bytes] : fake_.objects()) {
      count += absl::StartsWith(key, "p/" + folder) ? 1 : 0;
    }
    return count;
  }
  // The ticket for an upload; empty where the coordinator gives none.
  PutTicket Plan(const SyntheticWorker::Upload& upload) {
    const auto stub = v1::WorkerService::NewStub(server_->InProcessChannel());
    grpc::ClientContext context;
    v1::PlanUploadsRequest request;
    *request.add_results() = upload.header;
    v1::PlanUploadsResponse response;
    const grpc::Status status = stub->PlanUploads(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(response.tickets_size(), 1);
    if (response.tickets_size() != 1) return {};
    PutTicket ticket{response.tickets(0).url(), {}};
    for (const v1::HttpHeader& header : response.tickets(0).headers()) {
      ticket.headers.emplace_back(header.name(), header.value());
    }
    return ticket;
  }
  static int Put(const PutTicket& ticket, const std::string& bytes) {
    HttpClient http("");
    sheaf::HttpRequest request;
    request.method = "PUT";
    request.url = ticket.url;
    request.headers = ticket.headers;
    request.body = bytes;
    const absl::StatusOr<sheaf::HttpResponse> response = http.Send(request, nullptr);
    return response.ok() ? response->status : 0;
  }

  S3TestServer fake_;
  std::map<std::string, std::string> variables_;
};

TEST_F(CoordinatorObjectsTest, AFailingServerGivesTheSameImage) {
  options_.farm.merge_bytes_max = 0;  // Tiles are built from parts that are read again.
  Start();
  const v1::Job job = Create(SmallTiles(40));
  EXPECT_EQ(CountObjects("content/"), 2);
  fake_.Cause({"PUT", FaultKind::kStatus, 503, "SlowDown"});
  fake_.Cause({"PUT", FaultKind::kReset});
  fake_.Cause({"PUT", FaultKind::kResetAfterwards});
  fake_.Cause({"GET", FaultKind::kTruncate});
  const absl::StatusOr<int> accepted = MakeWorker("w").RenderAll();
  ASSERT_TRUE(accepted.ok()) << accepted.status();
  const v1::Job after = Watch(job.name());
  EXPECT_EQ(after.frames(0).image_digest(), ExpectedDigest(40));
  EXPECT_EQ(CountObjects("parts/1/1/"), *accepted);
  EXPECT_FALSE(std::filesystem::exists(directory_ + "/parts/1"));
  EXPECT_GE(Counter("sheaf_objects_retries_total"), 2);
}

TEST_F(CoordinatorObjectsTest, AStartGoesOnWithWhatTheServerHas) {
  Start();
  const v1::Job job = Create(SmallTiles(40));
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(3).ok());
  ASSERT_EQ(worker.RenderOne().value_or(Response::OUTCOME_UNSPECIFIED), Response::OUTCOME_ACCEPTED);
  ASSERT_EQ(worker.RenderOne().value_or(Response::OUTCOME_UNSPECIFIED), Response::OUTCOME_ACCEPTED);
  const std::map<std::string, std::string> before = fake_.objects();
  std::string lost;
  for (const auto& [key, bytes] : before) {
    if (absl::StartsWith(key, "p/parts/1/1/")) lost = key;
  }
  fake_.PutDirectly(lost, "damaged");
  fake_.PutDirectly("p/parts/1/1/left-over.exr", "never acknowledged");
  server_.reset();
  std::filesystem::remove_all(directory_ + "/content");
  Start();
  EXPECT_FALSE(fake_.objects().contains("p/parts/1/1/left-over.exr"));
  EXPECT_FALSE(fake_.objects().contains(lost)) << "it is rendered again";
  ASSERT_TRUE(MakeWorker("v").RenderAll().ok());
  EXPECT_EQ(Watch(job.name()).frames(0).image_digest(), ExpectedDigest(40));
  const v1::Digest scene = PutScene();
  EXPECT_TRUE(server_->farm().blobs().PathOf({scene.sha256_hex(), scene.size_bytes()}).ok());
}

TEST_F(CoordinatorObjectsTest, ResultsThatTheirSenderStoresGiveTheSameImage) {
  Start();
  const v1::Job job = Create(SmallTiles(16));
  SyntheticWorker worker = MakeWorker("w");
  int stored_count = 0;
  while (worker.Synchronize(1).ok() && !worker.leases().empty()) {
    SyntheticWorker::Upload upload = worker.MakeUpload(worker.leases().front());
    upload.header.set_stored(true);
    EXPECT_TRUE(absl::IsFailedPrecondition(worker.Send({upload.header, ""}).status()))
        << "nothing is stored so far";
    const PutTicket ticket = Plan(upload);
    EXPECT_NE(Put(ticket, upload.bytes + "x"), 200);
    ASSERT_EQ(Put(ticket, upload.bytes), 200);
    EXPECT_EQ(worker.Send({upload.header, ""}).value_or(Response::OUTCOME_UNSPECIFIED),
              Response::OUTCOME_ACCEPTED);
    EXPECT_EQ(worker.Send({upload.header, ""}).value_or(Response::OUTCOME_UNSPECIFIED),
              Response::OUTCOME_DUPLICATE_EQUAL);
    EXPECT_TRUE(Plan(upload).url.empty()) << "it is no longer wanted";
    ++stored_count;
  }
  EXPECT_GT(stored_count, 1);
  EXPECT_EQ(Watch(job.name()).frames(0).image_digest(), ExpectedDigest(16));
  EXPECT_EQ(CountObjects("parts/1/1/"), stored_count);
}

TEST_F(CoordinatorObjectsTest, AStrangerGetsNoTicket) {
  Start();
  Create(SmallTiles(16));
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  SyntheticWorker::Upload upload = worker.MakeUpload(worker.leases().front());
  upload.header.set_worker_id("stranger");
  const auto stub = v1::WorkerService::NewStub(server_->InProcessChannel());
  grpc::ClientContext context;
  v1::PlanUploadsRequest request;
  *request.add_results() = upload.header;
  v1::PlanUploadsResponse response;
  EXPECT_EQ(stub->PlanUploads(&context, request, &response).error_code(),
            grpc::StatusCode::PERMISSION_DENIED);
}

TEST_F(CoordinatorObjectsTest, ARefusalIsToldAndNothingIsLost) {
  Start();
  const v1::Job job = Create(SmallTiles(16));
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  fake_.Cause({"PUT", FaultKind::kStatus, 403, "AccessDenied"});
  const absl::Status refused = worker.RenderOne().status();
  EXPECT_TRUE(absl::IsUnavailable(refused)) << "a worker keeps its result: " << refused;
  EXPECT_THAT(std::string(refused.message()), ::testing::HasSubstr("key TESTKEY may not do this"));
  EXPECT_THAT(Get(job.name()).waiting_reason(), ::testing::HasSubstr("TESTKEY"));
  ASSERT_TRUE(worker.Synchronize(1).ok());
  fake_.Cause({"PUT", FaultKind::kStatus, 507, "InsufficientStorage"});
  EXPECT_TRUE(absl::IsResourceExhausted(worker.RenderOne().status()));
  ASSERT_TRUE(worker.RenderAll().ok());
  EXPECT_EQ(Watch(job.name()).frames(0).image_digest(), ExpectedDigest(16));
}

TEST_F(CoordinatorObjectsTest, AStoreHasOneCoordinator) {
  Start();
  CoordinatorOptions second = options_;
  second.farm.state_directory = directory_ + "-2";
  const absl::Status taken = CoordinatorServer::Start(second).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(taken)) << taken;
  EXPECT_THAT(std::string(taken.message()), ::testing::HasSubstr("name another prefix"));
  second.objects_url = "s3://farm/q";
  EXPECT_TRUE(CoordinatorServer::Start(second).ok());
  std::filesystem::remove_all(directory_ + "-2");
}

TEST_F(CoordinatorObjectsTest, AStartSaysWhatIsWrong) {
  variables_["AWS_SECRET_ACCESS_KEY"] = "hidden+words";
  const absl::Status refused = CoordinatorServer::Start(options_).status();
  EXPECT_TRUE(absl::IsPermissionDenied(refused)) << refused;
  EXPECT_THAT(std::string(refused.message()), ::testing::HasSubstr("check AWS_SECRET_ACCESS_KEY"));
  EXPECT_THAT(std::string(refused.message()), ::testing::Not(::testing::HasSubstr("hidden+words")));
}

}  // namespace
}  // namespace sheaf::coordinator
