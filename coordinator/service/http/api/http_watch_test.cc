// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/api/http_watch.h"

#include <chrono>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class HttpWatchTest : public ::testing::Test {
 protected:
  HttpWatchTest() {
    farm_.jobs = {MakeFakeJob("2"), MakeFakeJob("1")};
    farm_.workers.resize(1);
    farm_.workers[0].worker_id = "w";
  }
  FakeFarm farm_;
  EventHub hub_;
};

TEST_F(HttpWatchTest, PublishesOnlyChanges) {
  FarmDifference difference(&hub_);
  const auto reader = *hub_.Subscribe("reader");
  difference.Publish(farm_);
  EXPECT_THAT(reader->Take(), HasSubstr("event: worker"));
  difference.Publish(farm_);
  EXPECT_EQ(reader->Take(), "");

  farm_.jobs[1].progress.sample_count_done = 64;
  farm_.jobs[1].frames[0].progress.sample_count_done = 64;
  difference.Publish(farm_);
  const std::string events = reader->Take();
  EXPECT_THAT(events, HasSubstr("event: frame\ndata: {\"name\":\"jobs/1/frames/1\""));
  EXPECT_THAT(events, HasSubstr("event: job\ndata: {\"name\":\"jobs/1\""));
  EXPECT_THAT(events, Not(HasSubstr("jobs/2")));
  EXPECT_THAT(events, Not(HasSubstr("event: worker")));
}

TEST_F(HttpWatchTest, FramesThatAreTriedAgainAreChanged) {
  FarmDifference difference(&hub_);
  const auto reader = *hub_.Subscribe("reader");
  farm_.jobs[1].state = JobState::kFailed;
  farm_.jobs[1].frames[0].incomplete = "1 task is set aside";
  farm_.jobs[1].frames[0].set_aside_count = 1;
  difference.Publish(farm_);
  EXPECT_THAT(reader->Take(), HasSubstr("\"incomplete\":\"1 task is set aside\""));

  farm_.jobs[1].state = JobState::kQueued;
  farm_.jobs[1].frames[0].incomplete = "";
  farm_.jobs[1].frames[0].set_aside_count = 0;
  difference.Publish(farm_);
  EXPECT_THAT(reader->Take(), HasSubstr("event: frame\ndata: {\"name\":\"jobs/1/frames/1\""));
  difference.Publish(farm_);
  EXPECT_EQ(reader->Take(), "");
}

TEST_F(HttpWatchTest, WhatIsGoneIsPublished) {
  FarmDifference difference(&hub_);
  const auto reader = *hub_.Subscribe("reader");
  difference.Publish(farm_);
  reader->Take();
  farm_.jobs.erase(farm_.jobs.begin());  // jobs/2.
  difference.Publish(farm_);
  EXPECT_EQ(reader->Take(), "event: job_removed\ndata: {\"name\":\"jobs/2\"}\n\n");
  farm_.workers.clear();
  difference.Publish(farm_);
  EXPECT_EQ(reader->Take(), "event: worker_removed\ndata: {\"name\":\"workers/w\"}\n\n");
  difference.Publish(farm_);
  EXPECT_EQ(reader->Take(), "");
}

TEST_F(HttpWatchTest, AJobThatGoesWhileAnotherComesIsPublished) {
  FarmDifference difference(&hub_);
  const auto reader = *hub_.Subscribe("reader");
  difference.Publish(farm_);
  reader->Take();
  farm_.jobs[0] = MakeFakeJob("3");
  difference.Publish(farm_);
  const std::string events = reader->Take();
  EXPECT_THAT(events, HasSubstr("event: job_removed\ndata: {\"name\":\"jobs/2\"}"));
  EXPECT_THAT(events, HasSubstr("event: job\ndata: {\"name\":\"jobs/3\""));
}

TEST_F(HttpWatchTest, LateReadersGetLaterChanges) {
  FarmDifference difference(&hub_);
  difference.Publish(farm_);
  const auto reader = *hub_.Subscribe("reader");
  difference.Publish(farm_);
  EXPECT_EQ(reader->Take(), "");
  farm_.workers[0].state = WorkerState::kLost;
  difference.Publish(farm_);
  EXPECT_THAT(reader->Take(), HasSubstr("\"state\":\"lost\""));
}

TEST_F(HttpWatchTest, WatcherDetectsChanges) {
  const auto reader = *hub_.Subscribe("reader");
  const FarmWatcher watcher(farm_, &hub_);
  std::string events;
  // The first comparison publishes the present state; then a change must be published.
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(200);
  const auto wait_for = [&](const std::string& text) {
    while (events.find(text) == std::string::npos && std::chrono::steady_clock::now() < deadline) {
      events += reader->Take();
      farm_.WaitForChange(farm_.ChangeCount(), absl::Milliseconds(5));
    }
  };
  wait_for("workers/w");
  farm_.Update([](FakeFarm& farm) { farm.jobs[0].state = JobState::kSucceeded; });
  wait_for("\"state\":\"succeeded\"");
  EXPECT_THAT(events, HasSubstr("\"state\":\"succeeded\""));
}

}  // namespace
}  // namespace sheaf::coordinator
