// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/job_changes.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

namespace sheaf::cli {
namespace {

v1::Job MakeJob(const std::string& title, const std::vector<std::pair<int, int>>& frames) {
  v1::Job job;
  job.set_title(title);
  for (const auto& [number, retries] : frames) {
    v1::Frame* frame = job.add_frames();
    frame->mutable_spec()->set_frame_number(number);
    frame->set_correction_count(retries);
  }
  return job;
}

void AddTrouble(int frame, const std::string& text, v1::Job* job) {
  v1::FrameTrouble* trouble = job->add_troubles();
  trouble->set_frame_number(frame);
  trouble->set_incomplete(text);
}

TEST(JobChangesTest, AWholeJobReplacesWhatWasKnown) {
  v1::Job job = MakeJob("old", {{1, 0}, {2, 0}});
  const v1::Job whole = MakeJob("new", {{7, 1}});
  MergeChanges(whole, &job);
  EXPECT_EQ(job.SerializeAsString(), whole.SerializeAsString());
}

TEST(JobChangesTest, ChangesReplaceFramesAndTheirTroubles) {
  v1::Job job = MakeJob("job", {{1, 0}, {2, 0}, {30, 0}});
  AddTrouble(1, "killed", &job);
  AddTrouble(30, "killed", &job);
  v1::Job changes = MakeJob("job", {{2, 5}, {30, 6}});
  changes.set_waiting_reason("no worker is connected");
  changes.set_frames_are_changes(true);
  AddTrouble(2, "failed", &changes);
  MergeChanges(changes, &job);
  v1::Job expected = MakeJob("job", {{1, 0}, {2, 5}, {30, 6}});
  expected.set_waiting_reason("no worker is connected");
  AddTrouble(1, "killed", &expected);
  AddTrouble(2, "failed", &expected);
  EXPECT_EQ(job.DebugString(), expected.DebugString());
}

TEST(JobChangesTest, AMessageWithoutFramesLeavesThemAsTheyWere) {
  v1::Job job = MakeJob("job", {{1, 3}});
  v1::Job changes = MakeJob("job", {});
  changes.set_frames_are_changes(true);
  changes.set_priority(4);
  MergeChanges(changes, &job);
  ASSERT_EQ(job.frames_size(), 1);
  EXPECT_EQ(job.frames(0).correction_count(), 3);
  EXPECT_EQ(job.priority(), 4);
}

}  // namespace
}  // namespace sheaf::cli
