// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// S3Objects against a server that checks each signature and causes faults.
#include "common/objects/s3_objects.h"

#include <algorithm>
#include <thread>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/file.h"
#include "gtest/gtest.h"
#include "tests/support/farm/s3_test_server.h"

namespace sheaf {
namespace {

using FaultKind = S3TestServer::FaultKind;

FileDigest DigestOf(const std::string& bytes) { return {Sha256Hex(bytes), bytes.size()}; }

class S3ObjectsTest : public ::testing::Test {
 protected:
  S3TestServer fake_;
  S3Server server_{fake_.Options()};
  S3Objects objects_{&server_, "parts"};

  void ExpectError(const absl::Status& status, absl::StatusCode code, const std::string& words) {
    EXPECT_EQ(status.code(), code) << status;
    EXPECT_TRUE(absl::StrContains(status.message(), words)) << status;
    EXPECT_FALSE(absl::StrContains(status.message(), "test+secret")) << status;
  }
};

TEST_F(S3ObjectsTest, StoresReadsListsAndRemoves) {
  ASSERT_TRUE(objects_.Check().ok()) << objects_.Check();
  ASSERT_TRUE(objects_.Put("7/1/a.exr", "first", PutMode::kReplace).ok());
  ASSERT_TRUE(objects_.Put("7/2/b.exr", std::string("se\0ond", 6), PutMode::kReplace).ok());
  ASSERT_TRUE(objects_.Put("8/1/c.exr", "", PutMode::kReplace).ok());
  EXPECT_TRUE(fake_.objects().contains("p/parts/7/1/a.exr"));
  EXPECT_EQ(objects_.Get("7/1/a.exr", DigestOf("first")).value_or("?"), "first");
  EXPECT_EQ(objects_.Get("8/1/c.exr", DigestOf("")).value_or("?"), "");
  EXPECT_EQ(objects_.GetRange("7/1/a.exr", 2, 2).value_or("?"), "rs");
  EXPECT_EQ(objects_.GetRange("7/1/a.exr", 5, 2).value_or("?"), "");
  EXPECT_EQ(objects_.Head("7/2/b.exr").value_or(0), 6u);
  std::vector<std::string> keys;
  ASSERT_TRUE(objects_.List("7/", [&](const StoredObject& o) { keys.push_back(o.key); }).ok());
  EXPECT_EQ(keys, (std::vector<std::string>{"7/1/a.exr", "7/2/b.exr"}));
  EXPECT_EQ(*objects_.ListFolders(""), (std::vector<std::string>{"7", "8"}));
  EXPECT_EQ(*objects_.ListFolders("7/"), (std::vector<std::string>{"1", "2"}));
  EXPECT_TRUE(objects_.Remove("7/1/a.exr").ok());
  EXPECT_TRUE(objects_.Remove("7/1/a.exr").ok());
  EXPECT_TRUE(absl::IsNotFound(objects_.Get("7/1/a.exr", DigestOf("first")).status()));
  EXPECT_TRUE(absl::IsNotFound(objects_.Head("7/1/a.exr").status()));
  EXPECT_TRUE(objects_.RemoveFolder("7/").ok());
  EXPECT_EQ(fake_.objects().size(), 1u);
  EXPECT_EQ(server_.Counts().retries, 0u);
}

TEST_F(S3ObjectsTest, ListsAndRemovesBeyondOnePage) {
  fake_.SetPageObjectsMax(3);
  for (int i = 0; i < 10; ++i) fake_.PutDirectly(absl::StrCat("p/parts/4/", i), "x");
  int count = 0;
  ASSERT_TRUE(objects_.List("4/", [&](const StoredObject&) { ++count; }).ok());
  EXPECT_EQ(count, 10);
  ASSERT_TRUE(objects_.RemoveFolder("4/").ok());
  EXPECT_TRUE(fake_.objects().empty());
}

TEST_F(S3ObjectsTest, DoesNotReplaceWhatIsThere) {
  ASSERT_TRUE(objects_.Put("1/1/a", "one", PutMode::kIfAbsent).ok());
  EXPECT_TRUE(absl::IsAlreadyExists(objects_.Put("1/1/a", "two", PutMode::kIfAbsent)));
  EXPECT_EQ(fake_.objects().at("p/parts/1/1/a"), "one");
  fake_.ForgetConditions();
  EXPECT_TRUE(objects_.Put("1/1/a", "two", PutMode::kIfAbsent).ok());
  const int before = fake_.request_count();
  EXPECT_TRUE(objects_.Put("1/1/b", "two", PutMode::kIfAbsent).ok());
  EXPECT_EQ(fake_.request_count(), before + 1) << "a server without conditions is asked once";
}

TEST_F(S3ObjectsTest, RepeatsWhatPasses) {
  fake_.Cause({"PUT", FaultKind::kStatus, 503, "SlowDown"});
  fake_.Cause({"PUT", FaultKind::kReset});
  EXPECT_TRUE(objects_.Put("1/1/a", "bytes", PutMode::kReplace).ok());
  fake_.Cause({"GET", FaultKind::kTruncate});
  fake_.Cause({"GET", FaultKind::kOtherBytes});
  fake_.Cause({"GET", FaultKind::kStatus, 500});
  EXPECT_EQ(objects_.Get("1/1/a", DigestOf("bytes")).value_or("?"), "bytes");
  // libcurl repeats by itself what a kept connection loses.
  EXPECT_GE(server_.Counts().retries, 4u);
  EXPECT_EQ(server_.Counts().failures, 0u);
}

TEST_F(S3ObjectsTest, AStoredObjectWhoseAnswerIsLostIsThere) {
  fake_.Cause({"PUT", FaultKind::kResetAfterwards});
  const absl::Status status = objects_.Put("1/1/a", "bytes", PutMode::kIfAbsent);
  EXPECT_TRUE(absl::IsAlreadyExists(status)) << status;
  EXPECT_EQ(fake_.objects().at("p/parts/1/1/a"), "bytes");
}

TEST_F(S3ObjectsTest, EndsAfterTheLastAttempt) {
  fake_.Cause({"PUT", FaultKind::kStatus, 503, "SlowDown"}, kS3AttemptsMax);
  ExpectError(objects_.Put("1/1/a", "bytes", PutMode::kReplace), absl::StatusCode::kUnavailable,
              "503 SlowDown");
  EXPECT_EQ(fake_.request_count(), kS3AttemptsMax);
  EXPECT_EQ(server_.Counts().failures, 1u);
}

TEST_F(S3ObjectsTest, SaysWhatToDoAboutRefusals) {
  fake_.Cause({"PUT", FaultKind::kStatus, 403, "AccessDenied"});
  ExpectError(objects_.Put("1/1/a", "b", PutMode::kReplace), absl::StatusCode::kPermissionDenied,
              "key TESTKEY may not do this");
  fake_.Cause({"PUT", FaultKind::kStatus, 507, "InsufficientStorage"});
  ExpectError(objects_.Put("1/1/a", "b", PutMode::kReplace), absl::StatusCode::kResourceExhausted,
              "no room left");
  fake_.Cause({"GET", FaultKind::kStatus, 404, "NoSuchBucket"});
  ExpectError(objects_.Check(), absl::StatusCode::kFailedPrecondition, "make the bucket");
  EXPECT_EQ(fake_.request_count(), 3) << "nothing of that passes";
  S3Options other = fake_.Options();
  other.credentials.secret_access_key = "wrong";
  S3Server stranger(other);
  ExpectError(S3Objects(&stranger, "parts").Check(), absl::StatusCode::kPermissionDenied,
              "check AWS_SECRET_ACCESS_KEY");
  other = fake_.Options();
  other.credentials.access_key_id = "NOBODY";
  S3Server unknown(other);
  ExpectError(S3Objects(&unknown, "parts").Check(), absl::StatusCode::kPermissionDenied,
              "does not know key NOBODY");
  fake_.SetClockAhead(absl::Hours(1));
  ExpectError(objects_.Check(), absl::StatusCode::kPermissionDenied, "clocks");
}

TEST_F(S3ObjectsTest, TellsThatNobodyAnswers) {
  S3Options options = fake_.Options();
  options.endpoint = "http://127.0.0.1:1";
  S3Server nobody(options);
  ExpectError(S3Objects(&nobody, "parts").Check(), absl::StatusCode::kUnavailable, "127.0.0.1:1");
}

TEST_F(S3ObjectsTest, BytesThatStayWrongAreLost) {
  fake_.PutDirectly("p/parts/1/1/a", "other");
  ExpectError(objects_.Get("1/1/a", DigestOf("bytes")).status(), absl::StatusCode::kDataLoss,
              "do not match");
  fake_.PutDirectly("p/parts/1/1/a", std::string(200'000, 'x'));
  ExpectError(objects_.Get("1/1/a", DigestOf("bytes")).status(), absl::StatusCode::kDataLoss,
              "longer");
}

TEST_F(S3ObjectsTest, SendsLargeFilesInPieces) {
  std::string bytes(kS3SinglePutBytesMax + kS3PieceBytes / 2, 'a');
  bytes[kS3PieceBytes] = 'b';
  const std::string path = ::testing::TempDir() + "/s3_large";
  ASSERT_TRUE(WriteFileOnce(path, bytes).ok());
  fake_.Cause({"PUT", FaultKind::kReset});
  ASSERT_TRUE(objects_.PutFile("ab/large", path).ok());
  EXPECT_EQ(Sha256Hex(fake_.objects().at("p/parts/ab/large")), Sha256Hex(bytes));
  fake_.Cause({"PUT", FaultKind::kStatus, 403, "AccessDenied"});
  EXPECT_TRUE(absl::IsPermissionDenied(objects_.PutFile("ab/refused", path)));
  EXPECT_FALSE(fake_.objects().contains("p/parts/ab/refused"));
  EXPECT_EQ(fake_.upload_count(), 0) << "its pieces are removed";
}

// Sends what a worker sends that has a ticket.
int StatusOfTicket(PutTicket ticket, const std::string& bytes) {
  HttpClient http("");
  HttpRequest request;
  request.method = "PUT";
  request.url = ticket.url;
  request.headers = ticket.headers;
  request.body = bytes;
  const absl::StatusOr<HttpResponse> response = http.Send(request, nullptr);
  return response.ok() ? response->status : 0;
}

TEST_F(S3ObjectsTest, ATicketStoresTheseBytesAndNoOthers) {
  const std::optional<PutTicket> ticket = objects_.TicketToPut("1/1/a", DigestOf("bytes"));
  ASSERT_TRUE(ticket.has_value());
  EXPECT_FALSE(absl::StrContains(ticket->url, "secret"));
  EXPECT_EQ(StatusOfTicket(*ticket, "other"), 400);
  EXPECT_EQ(StatusOfTicket(*ticket, "longer than that"), 403);
  PutTicket elsewhere = *ticket;
  elsewhere.url.replace(elsewhere.url.find("/1/1/a"), 6, "/1/1/b");
  EXPECT_EQ(StatusOfTicket(elsewhere, "bytes"), 403);
  EXPECT_EQ(StatusOfTicket(*ticket, "bytes"), 200);
  EXPECT_EQ(objects_.Get("1/1/a", DigestOf("bytes")).value_or("?"), "bytes");
  fake_.SetClockAhead(kS3TicketLifetime + absl::Seconds(5));
  EXPECT_EQ(StatusOfTicket(*ticket, "bytes"), 403);
}

TEST_F(S3ObjectsTest, ManyThreadsStoreAtOnce) {
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([this, t] {
      for (int i = 0; i < 10; ++i) {
        EXPECT_TRUE(objects_.Put(absl::StrCat(t, "/", i), "x", PutMode::kIfAbsent).ok());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(fake_.objects().size(), 40u);
}

}  // namespace
}  // namespace sheaf
