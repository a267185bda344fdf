// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/farm_size.h"

#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

v1::Worker MakeWorker(v1::Worker::State state, int threads) {
  v1::Worker worker;
  worker.set_state(state);
  worker.set_thread_count(threads);
  return worker;
}

v1::Job MakeJob(v1::Job::State state) {
  v1::Job job;
  job.set_state(state);
  return job;
}

TEST(FarmSizeTest, CountsWorkersThatTakeWorkAndJobsThatNeedThem) {
  const FarmSize size =
      SizeOf({MakeWorker(v1::Worker::STATE_IDLE, 4), MakeWorker(v1::Worker::STATE_BUSY, 8),
              MakeWorker(v1::Worker::STATE_LOST, 16), MakeWorker(v1::Worker::STATE_DRAINING, 16)},
             {MakeJob(v1::Job::STATE_RUNNING), MakeJob(v1::Job::STATE_PAUSED),
              MakeJob(v1::Job::STATE_SUCCEEDED)});
  EXPECT_EQ(size.worker_count, 2);
  EXPECT_EQ(size.thread_count, 12);
  EXPECT_EQ(size.other_job_count, 1);
}

}  // namespace
}  // namespace sheaf::cli
