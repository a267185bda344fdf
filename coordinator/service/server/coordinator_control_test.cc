// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Control of jobs over the wire: pause, resume, cancel; and the pilots of quotes.
#include "coordinator/service/server/coordinator_server.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

using Response = v1::UploadResultsResponse;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST_F(CoordinatorServerTest, PausedJobsStayPausedOverARestart) {
  Start();
  const std::string name = Create(Request(64)).name();
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  EXPECT_EQ(Control<v1::PauseJobRequest>(&v1::JobService::Stub::PauseJob, name).state(),
            v1::Job::STATE_PAUSED);
  EXPECT_EQ(*worker.RenderOne(), Response::OUTCOME_ACCEPTED);
  ASSERT_TRUE(worker.Synchronize(2).ok());
  EXPECT_TRUE(worker.leases().empty());
  v1::SetJobPriorityRequest priority;
  priority.set_priority(5);
  EXPECT_EQ(Control(&v1::JobService::Stub::SetJobPriority, name, priority).priority(), 5);
  Start();
  EXPECT_EQ(Get(name).state(), v1::Job::STATE_PAUSED);
  EXPECT_EQ(Get(name).priority(), 5);
  EXPECT_FALSE(Get(name).progress().has_remaining_duration());
  SyntheticWorker other = MakeWorker("x");
  ASSERT_TRUE(other.Synchronize(2).ok());
  EXPECT_TRUE(other.leases().empty());
  EXPECT_EQ(Control<v1::ResumeJobRequest>(&v1::JobService::Stub::ResumeJob, name).state(),
            v1::Job::STATE_RUNNING);
  ASSERT_TRUE(other.RenderAll().ok());
  EXPECT_EQ(Watch(name).frames(0).image_digest(), ExpectedDigest(64));
}

TEST_F(CoordinatorServerTest, EndedJobsRefuseControl) {
  Start();
  const std::string done = Create(Request(4)).name();
  ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
  ASSERT_EQ(Watch(done).state(), v1::Job::STATE_SUCCEEDED);
  const std::string cancelled = Create(Request(4, "other")).name();
  Control<v1::CancelJobRequest>(&v1::JobService::Stub::CancelJob, cancelled);
  const auto refused = [&](auto call, auto request, const std::string& name) {
    grpc::ClientContext context;
    request.set_name(name);
    v1::Job job;
    const grpc::Status status = (jobs_.get()->*call)(&context, request, &job);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
    return status.error_message();
  };
  using Stub = v1::JobService::Stub;
  for (const auto& [name, state] :
       {std::pair{done, " has succeeded"}, {cancelled, " was cancel"}}) {
    EXPECT_THAT(refused(&Stub::PauseJob, v1::PauseJobRequest(), name), HasSubstr(name + state));
    EXPECT_THAT(refused(&Stub::ResumeJob, v1::ResumeJobRequest(), name), HasSubstr(name + state));
    EXPECT_THAT(refused(&Stub::SetJobPriority, v1::SetJobPriorityRequest(), name),
                HasSubstr(name + state));
  }
  EXPECT_THAT(refused(&Stub::CancelJob, v1::CancelJobRequest(), done), HasSubstr("succeeded"));
  // Asked for again, the same is so.
  EXPECT_EQ(Control<v1::CancelJobRequest>(&Stub::CancelJob, cancelled).state(),
            v1::Job::STATE_CANCELLED);
}

TEST_F(CoordinatorServerTest, WhatIsSetAsideSurvivesRestartsAndIsRetried) {
  options_.farm.limits.poison_workers_max = 1;
  Start();
  const std::string name = Create(Request(64)).name();
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  worker.ReportFailure(worker.leases()[0].lease_id(), v1::LeaseFailure::KIND_INTERNAL, "it broke");
  ASSERT_TRUE(worker.Synchronize(0).ok());
  Start();
  ASSERT_TRUE(MakeWorker("x").RenderAll().ok());
  const v1::Job failed = Watch(name);
  EXPECT_EQ(failed.state(), v1::Job::STATE_FAILED);
  EXPECT_EQ(failed.incomplete_frame_count(), 1);
  EXPECT_THAT(failed.failure(), HasSubstr("worker w says: it broke"));
  ASSERT_EQ(failed.troubles_size(), 1);
  EXPECT_EQ(failed.troubles(0).set_aside_tasks(0).task(), 0u);
  Start();
  EXPECT_EQ(Get(name).troubles(0).set_aside_task_count(), 1);
  const v1::SetAsideTask& aside = failed.troubles(0).set_aside_tasks(0);
  ASSERT_EQ(aside.failures_size(), 1);
  EXPECT_EQ(aside.failures(0).kind(), "internal");
  EXPECT_EQ(aside.failures(0).worker(), "w");
  v1::RetryTasksRequest request;
  request.set_frame_number(Get(name).frames(0).spec().frame_number());
  request.set_task(0);
  EXPECT_EQ(Control(&v1::JobService::Stub::RetryTasks, name, request).state(),
            v1::Job::STATE_RUNNING);
  ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
  EXPECT_EQ(Watch(name).frames(0).image_digest(), ExpectedDigest(64));
  EXPECT_LT(Counter("sheaf_results_accepted_total"), 4) << "what was there is not rendered again";
}

TEST_F(CoordinatorServerTest, PilotsAreHiddenAndUseNoJobIds) {
  options_.farm.limits.pilot_unasked_max = absl::InfiniteDuration();
  Start();
  const auto list = [&](bool with_pilots, int page_size = 0) {
    std::vector<std::string> names;
    v1::ListJobsRequest request;
    request.set_with_pilots(with_pilots);
    request.set_page_size(page_size);
    do {
      grpc::ClientContext context;
      v1::ListJobsResponse response;
      EXPECT_TRUE(jobs_->ListJobs(&context, request, &response).ok());
      for (const v1::Job& job : response.jobs()) {
        names.push_back(job.name() + (job.pilot() ? " pilot" : ""));
      }
      request.set_page_token(response.next_page_token());
    } while (!request.page_token().empty());
    return names;
  };
  const auto create = [&](const std::string& request_id, bool pilot) {
    v1::CreateJobRequest request = Request(4, request_id);
    request.set_pilot(pilot);
    return Create(request).name();
  };
  EXPECT_EQ(create("a", true), "jobs/1000000001");
  EXPECT_EQ(create("b", false), "jobs/1");
  Start();
  EXPECT_EQ(create("c", true), "jobs/1000000002");
  EXPECT_EQ(create("d", false), "jobs/2");
  EXPECT_EQ(create("a", true), "jobs/1000000001");
  EXPECT_THAT(list(false), ElementsAre("jobs/2", "jobs/1"));
  for (const int page_size : {0, 1, 3}) {
    EXPECT_THAT(list(true, page_size),
                ElementsAre("jobs/2", "jobs/1000000002 pilot", "jobs/1", "jobs/1000000001 pilot"));
  }
  EXPECT_EQ(Counter("sheaf_jobs_live"), 4);
}

// Asking for a pilot keeps it alive; other jobs need not be asked for.
TEST_F(CoordinatorServerTest, AbandonedPilotsAreCancelled) {
  options_.farm.limits.pilot_unasked_max = absl::Seconds(1);
  Start();
  const std::string job = Create(Request(4, "job")).name();
  std::string pilot;
  // One that was not asked for because this process did not run says nothing: another one.
  for (bool asked_in_time = false; !asked_in_time;) {
    absl::Time last = absl::Now();
    v1::CreateJobRequest request = Request(4, absl::StrCat("pilot ", absl::ToUnixMicros(last)));
    request.set_pilot(true);
    pilot = Create(request).name();
    asked_in_time = true;
    const absl::Time later = last + 2 * options_.farm.limits.pilot_unasked_max;
    while (asked_in_time && last < later) {
      const v1::Job::State state = Get(pilot).state();
      const absl::Time now = absl::Now();
      asked_in_time = now - last < options_.farm.limits.pilot_unasked_max;
      if (asked_in_time) {
        ASSERT_EQ(state, v1::Job::STATE_QUEUED);
      }
      last = now;
      absl::SleepFor(absl::Milliseconds(20));
    }
  }
  const auto state = [&] { return server_->farm().view().FindJob(pilot.substr(5))->state; };
  const absl::Time deadline = absl::Now() + kPatience;
  while (state() != JobState::kCancelled && absl::Now() < deadline) {
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_EQ(state(), JobState::kCancelled);
  EXPECT_EQ(Get(job).state(), v1::Job::STATE_QUEUED);
}

TEST_F(CoordinatorServerTest, JobsHaveALogUntilTheyAreDeleted) {
  Start();
  v1::CreateJobRequest request = Request(64);
  request.set_command("sheaf submit a.pbrt");
  const std::string name = Create(request).name();
  EXPECT_EQ(Get(name).command(), "sheaf submit a.pbrt");
  const auto remove = [&](v1::Job* job) {
    grpc::ClientContext context;
    v1::DeleteJobRequest deletion;
    deletion.set_name(name);
    return jobs_->DeleteJob(&context, deletion, job);
  };
  v1::Job job;
  const grpc::Status refused = remove(&job);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_NE(refused.error_message().find("cancel it first"), std::string::npos);
  Control<v1::PauseJobRequest>(&v1::JobService::Stub::PauseJob, name);
  Control<v1::CancelJobRequest>(&v1::JobService::Stub::CancelJob, name);
  grpc::ClientContext context;
  v1::ListJobEventsRequest asked;
  asked.set_name(name);
  v1::ListJobEventsResponse log;
  ASSERT_TRUE(jobs_->ListJobEvents(&context, asked, &log).ok());
  std::vector<std::string> words;
  for (const v1::JobEvent& event : log.events()) words.push_back(event.what());
  // The end is noted before the call that caused it returns.
  EXPECT_EQ(words, (std::vector<std::string>{"submit", "pause", "cancelled", "cancel"}));
  EXPECT_EQ(log.events(1).who(), kLocalOwner);
  ASSERT_TRUE(remove(&job).ok());
  EXPECT_EQ(job.state(), v1::Job::STATE_CANCELLED);
  EXPECT_EQ(remove(&job).error_code(), grpc::StatusCode::NOT_FOUND);
  grpc::ClientContext again;
  EXPECT_EQ(jobs_->ListJobEvents(&again, asked, &log).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(CoordinatorServerTest, PausedJobsCanBeCancelledButNotRefined) {
  Start();
  const std::string name = Create(Request(64)).name();
  Control<v1::PauseJobRequest>(&v1::JobService::Stub::PauseJob, name);
  grpc::ClientContext context;
  v1::RefineJobRequest refine;
  refine.set_name(name);
  refine.set_sample_count(128);
  v1::Job job;
  const grpc::Status refused = jobs_->RefineJob(&context, refine, &job);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_NE(refused.error_message().find("is paused"), std::string::npos);
  EXPECT_EQ(Control<v1::CancelJobRequest>(&v1::JobService::Stub::CancelJob, name).state(),
            v1::Job::STATE_CANCELLED);
}

}  // namespace
}  // namespace sheaf::coordinator
