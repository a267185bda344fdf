// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Many clients at once, each with a connection of its own over loopback: no call fails. Each call
// is sent once, so that nothing hides behind a retry.
#include <atomic>
#include <latch>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

constexpr int kConnections = 400;
constexpr int kCallsOfEach = 10;
constexpr int kConnectsMax = 20;

// gRPC 1.51 looks at errno some steps after connect(), where a step between may have left its own:
// EINVAL if abseil names its memory and the kernel lacks CONFIG_ANON_VMA_NAME, ENOENT if malloc
// counts processors. connect() to an address of TCP gives neither: such a call was never sent.
bool IsUnsent(const grpc::Status& status) {
  return status.error_code() == grpc::StatusCode::UNAVAILABLE &&
         absl::StrContains(status.error_message(), "failed to connect") &&
         (absl::EndsWith(status.error_message(), "Invalid argument") ||
          absl::EndsWith(status.error_message(), "No such file or directory"));
}

// Calls until the connection is made.
grpc::Status GetJob(v1::JobService::Stub& jobs, const std::string& name) {
  grpc::Status status;
  for (int connects = 0; connects < kConnectsMax; ++connects) {
    grpc::ClientContext context;
    SetDeadline(&context, kUnaryDeadline);
    v1::GetJobRequest request;
    request.set_name(name);
    v1::Job found;
    status = jobs.GetJob(&context, request, &found);
    if (!IsUnsent(status)) break;
    absl::SleepFor(absl::Milliseconds(100));
  }
  return status;
}

TEST_F(CoordinatorServerTest, FourHundredConcurrentChannelsLoseNoCall) {
  options_.listen_address = "127.0.0.1:0";
  Start();
  const v1::Job job = Create(Request(16));
  const std::string address = absl::StrCat("127.0.0.1:", server_->port());
  std::atomic<int> failed{0};
  std::latch together(kConnections);
  std::vector<std::jthread> clients;
  for (int i = 0; i < kConnections; ++i) {
    clients.emplace_back([&] {
      const auto jobs = v1::JobService::NewStub(MakeChannel(address));
      together.arrive_and_wait();
      for (int call = 0; call < kCallsOfEach; ++call) {
        const grpc::Status status = GetJob(*jobs, job.name());
        if (!status.ok() && ++failed == 1) ADD_FAILURE() << status.error_message();
      }
    });
  }
  clients.clear();
  EXPECT_EQ(failed, 0) << "of " << kConnections * kCallsOfEach << " calls";
}

}  // namespace
}  // namespace sheaf::coordinator
