// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/grpc_status.h"

#include <string>

#include "gtest/gtest.h"
#include "sheaf/v1/job.pb.h"

namespace sheaf {
namespace {

TEST(GrpcStatusTest, EveryCanonicalCodeSurvivesTheRoundTrip) {
  for (int code = 1; code <= 16; ++code) {
    const absl::Status before(static_cast<absl::StatusCode>(code), "what, why");
    const grpc::Status wire = ToGrpcStatus(before);
    EXPECT_EQ(static_cast<int>(wire.error_code()), code);
    EXPECT_EQ(FromGrpcStatus(wire), before);
  }
}

TEST(GrpcStatusTest, CodeNamesMatchOnBothSides) {
  EXPECT_EQ(ToGrpcStatus(absl::ResourceExhaustedError("")).error_code(),
            grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ToGrpcStatus(absl::UnavailableError("")).error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(ToGrpcStatus(absl::DataLossError("")).error_code(), grpc::StatusCode::DATA_LOSS);
}

TEST(GrpcStatusTest, OkStaysOk) {
  EXPECT_TRUE(ToGrpcStatus(absl::OkStatus()).ok());
  EXPECT_TRUE(FromGrpcStatus(grpc::Status::OK).ok());
}

TEST(GrpcStatusTest, ConnectionErrorsAreDescribedPlainly) {
  const auto words = [](grpc::StatusCode code, const char* message) {
    return std::string(FromGrpcStatus({code, message}).message());
  };
  EXPECT_EQ(words(grpc::StatusCode::UNAVAILABLE,
                  "failed to connect to all addresses; last error: UNKNOWN: ipv4:127.0.0.1:7610: "
                  "Failed to connect to remote host: Connection refused"),
            "the connection was refused");
  EXPECT_EQ(words(grpc::StatusCode::UNAVAILABLE,
                  "failed to connect to all addresses; last error: UNKNOWN: ipv4:127.0.0.1:7610: "
                  "tcp handshaker shutdown"),
            "it does not answer");
  EXPECT_EQ(words(grpc::StatusCode::DEADLINE_EXCEEDED, "Deadline Exceeded"), "no answer in time");
  // The coordinator's own messages, and other codes, stay unchanged.
  EXPECT_EQ(words(grpc::StatusCode::UNAVAILABLE, "the coordinator is stopping"),
            "the coordinator is stopping");
  EXPECT_EQ(words(grpc::StatusCode::INTERNAL, "Socket closed"), "Socket closed");
}

TEST(GrpcStatusTest, TimeoutsNameTheAddressAndARemedy) {
  const absl::Status silence =
      NoCoordinatorAnswers("farm:7400", absl::UnavailableError("the connection was refused"));
  EXPECT_EQ(silence, absl::UnavailableError(
                         "no coordinator answers at farm:7400: the connection was refused; start "
                         "one with sheaf-coordinator, or name another with --coordinator "
                         "HOST:PORT"));
  const absl::Status full = absl::ResourceExhaustedError("the disk is full");
  EXPECT_EQ(NoCoordinatorAnswers("farm:7400", full), full);
}

TEST(GrpcStatusTest, ForeignCodeBecomesUnknown) {
  const grpc::Status foreign(grpc::StatusCode::DO_NOT_USE, "odd");
  EXPECT_EQ(FromGrpcStatus(foreign).code(), absl::StatusCode::kUnknown);
}

TEST(GrpcStatusTest, ACallThatCouldNotBeReadNamesTheTextThatIsNotUtf8) {
  const grpc::Status unread(grpc::StatusCode::INTERNAL, "");
  EXPECT_NE(FromGrpcStatus(unread).message().find("without a reason"), std::string::npos);
  v1::GetJobRequest request;
  request.set_name("jobs/\xe9");
  testing::internal::CaptureStderr();
  EXPECT_FALSE(request.SerializeAsString().empty());
  EXPECT_EQ(FromGrpcStatus(unread).message(),
            "GetJobRequest.name: is not UTF-8; write it in UTF-8");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << "protobuf prints nothing";
  EXPECT_NE(FromGrpcStatus(unread).message().find("without a reason"), std::string::npos);
}

}  // namespace
}  // namespace sheaf
