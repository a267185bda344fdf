// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Many clients at once, each with a connection of its own over loopback: no call fails. Calls are
// made once, so that nothing hides behind a retry.
#include <atomic>
#include <latch>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "coordinator/service/server/coordinator_server_fixture.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr int kChannels = 400;
constexpr int kCallsOfEach = 10;

TEST_F(CoordinatorServerTest, FourHundredConcurrentChannelsLoseNoCall) {
  options_.listen_address = "127.0.0.1:0";
  Start();
  const v1::Job job = Create(Request(16));
  const std::string address = absl::StrCat("127.0.0.1:", server_->port());
  std::atomic<int> failed{0};
  std::latch together(kChannels);
  std::vector<std::jthread> clients;
  for (int i = 0; i < kChannels; ++i) {
    clients.emplace_back([&] {
      const auto jobs = v1::JobService::NewStub(MakeChannel(address));
      together.arrive_and_wait();
      for (int call = 0; call < kCallsOfEach; ++call) {
        grpc::ClientContext context;
        SetDeadline(&context, kUnaryDeadline);
        v1::GetJobRequest request;
        request.set_name(job.name());
        v1::Job found;
        const grpc::Status status = jobs->GetJob(&context, request, &found);
        if (!status.ok() && ++failed == 1) ADD_FAILURE() << status.error_message();
      }
    });
  }
  clients.clear();
  EXPECT_EQ(failed, 0) << "of " << kChannels * kCallsOfEach << " calls";
}

}  // namespace
}  // namespace sheaf::coordinator
