// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/retry.h"

#include <string>
#include <vector>

#include "common/base/retry_after.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

// A simulated clock that sleeping advances; nothing waits.
struct SimulatedWorld {
  SteadyTime time;
  std::vector<absl::Duration> waits;
  bool stopping = false;

  RetryEnvironment Environment() {
    RetryEnvironment environment;
    environment.now = [this] { return time; };
    environment.sleep = [this](absl::Duration duration) {
      waits.push_back(duration);
      time += duration;
      return !stopping;
    };
    environment.uniform = [] { return 0.0; };
    return environment;
  }
};

TEST(RetryLoopTest, RetriesTransientFailures) {
  SimulatedWorld world;
  int calls = 0;
  const absl::Status status = RetryLoop(
      RetryPolicy{}, Idempotency::kIdempotent, world.Environment(), [&]() -> absl::Status {
        return ++calls < 3 ? absl::UnavailableError("away") : absl::OkStatus();
      });
  EXPECT_TRUE(status.ok());
  EXPECT_EQ(calls, 3);
  ASSERT_EQ(world.waits.size(), 2u);
  EXPECT_EQ(world.waits[0], absl::Milliseconds(50));
  EXPECT_EQ(world.waits[1], absl::Milliseconds(100));
}

TEST(RetryLoopTest, RefusalsThatPassAreRepeatedAfterTheirTime) {
  SimulatedWorld world;
  int calls = 0;
  const absl::Status status = RetryLoop(
      RetryPolicy{}, Idempotency::kIdempotent, world.Environment(), [&]() -> absl::Status {
        return ++calls < 2 ? RetryAfterError("too many calls", absl::Seconds(2)) : absl::OkStatus();
      });
  EXPECT_TRUE(status.ok());
  EXPECT_EQ(calls, 2);
  ASSERT_EQ(world.waits.size(), 1u);
  EXPECT_EQ(world.waits[0], absl::Seconds(2));
}

TEST(RetryLoopTest, RefusalsThatStayFailAtOnceInTheirWords) {
  SimulatedWorld world;
  int calls = 0;
  const absl::Status status =
      RetryLoop(RetryPolicy{}, Idempotency::kIdempotent, world.Environment(), [&] {
        ++calls;
        return absl::ResourceExhaustedError("too many jobs");
      });
  EXPECT_EQ(status, absl::ResourceExhaustedError("too many jobs"));
  EXPECT_EQ(calls, 1);
}

TEST(RetryLoopTest, PermanentFailureIsNotRepeated) {
  SimulatedWorld world;
  int calls = 0;
  const absl::Status status =
      RetryLoop(RetryPolicy{}, Idempotency::kIdempotent, world.Environment(), [&] {
        ++calls;
        return absl::InvalidArgumentError("bad scene");
      });
  EXPECT_EQ(status, absl::InvalidArgumentError("bad scene"));
  EXPECT_EQ(calls, 1);
}

TEST(RetryLoopTest, NonIdempotentCallsRunOnce) {
  SimulatedWorld world;
  int calls = 0;
  const absl::Status status =
      RetryLoop(RetryPolicy{}, Idempotency::kNotIdempotent, world.Environment(), [&] {
        ++calls;
        return absl::UnavailableError("away");
      });
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(calls, 1);
}

TEST(RetryLoopTest, StopsAtTheTimeLimitWithAMessage) {
  SimulatedWorld world;
  RetryPolicy policy;
  policy.elapsed_max = absl::Seconds(60);
  const SteadyTime start = world.time;
  const absl::Status status = RetryLoop(policy, Idempotency::kIdempotent, world.Environment(),
                                        [] { return absl::UnavailableError("away"); });
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_NE(std::string(status.message()).find("gave up after"), std::string::npos);
  EXPECT_LE(world.time - start, policy.elapsed_max);
  for (const absl::Duration wait : world.waits) EXPECT_LE(wait, policy.backoff_max);
}

TEST(RetryLoopTest, StopsAtTheAttemptLimit) {
  SimulatedWorld world;
  RetryPolicy policy;
  policy.attempts_max = 4;
  int calls = 0;
  const absl::Status status = RetryLoop(policy, Idempotency::kIdempotent, world.Environment(), [&] {
    ++calls;
    return absl::UnavailableError("away");
  });
  EXPECT_EQ(calls, 4);
  EXPECT_EQ(status.message(), "away (gave up after 4 attempts)");
}

TEST(RetryLoopTest, StopsWhenTheSleepIsInterrupted) {
  SimulatedWorld world;
  world.stopping = true;
  int calls = 0;
  const absl::Status status =
      RetryLoop(RetryPolicy{}, Idempotency::kIdempotent, world.Environment(), [&] {
        ++calls;
        return absl::UnavailableError("away");
      });
  EXPECT_FALSE(status.ok());
  EXPECT_EQ(calls, 1);
}

}  // namespace
}  // namespace sheaf
