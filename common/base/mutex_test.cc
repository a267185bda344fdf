// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/mutex.h"

#include <stop_token>
#include <thread>

#include "common/base/first_error.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

struct Gate {
  Mutex mutex;
  CondVar changed;
  bool open ABSL_GUARDED_BY(mutex) = false;

  void Open() {
    const MutexLock lock(&mutex);
    open = true;
    changed.NotifyAll();
  }
};

TEST(MutexTest, LockCanBeReleasedMeanwhile) {
  Gate gate;
  MutexLock lock(&gate.mutex);
  lock.Unlock();
  gate.Open();  // Would never return otherwise.
  lock.Lock();
  EXPECT_TRUE(gate.open);
}

TEST(CondVarTest, WaitsUntilTheConditionHolds) {
  Gate gate;
  const std::jthread opener([&gate] { gate.Open(); });
  const MutexLock lock(&gate.mutex);
  gate.changed.Wait(&gate.mutex,
                    [&gate]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(gate.mutex) { return gate.open; });
  EXPECT_TRUE(gate.open);
}

TEST(CondVarTest, TimeoutEndsTheWait) {
  Mutex mutex;
  CondVar changed;
  const MutexLock lock(&mutex);
  EXPECT_FALSE(changed.WaitFor(&mutex, absl::Milliseconds(1), [] { return false; }));
  EXPECT_TRUE(changed.WaitFor(&mutex, absl::InfiniteDuration(), [] { return true; }));
}

TEST(CondVarTest, RequestedStopEndsTheWait) {
  Mutex mutex;
  CondVar changed;
  std::stop_source stop;
  const std::jthread stopper([&stop] { stop.request_stop(); });
  const MutexLock lock(&mutex);
  EXPECT_FALSE(changed.Wait(&mutex, stop.get_token(), [] { return false; }));
  EXPECT_FALSE(changed.WaitFor(&mutex, stop.get_token(), absl::Hours(1), [] { return false; }));
}

TEST(SleepUnlessStoppedTest, TellsWhetherAStopWasRequested) {
  std::stop_source stop;
  EXPECT_TRUE(SleepUnlessStopped(absl::Milliseconds(1), stop.get_token()));
  stop.request_stop();
  EXPECT_FALSE(SleepUnlessStopped(absl::Hours(1), stop.get_token()));
}

TEST(FirstErrorTest, KeepsTheFirstErrorOnly) {
  FirstError first;
  first.Update(absl::OkStatus());
  EXPECT_TRUE(first.Get().ok());
  first.Update(absl::NotFoundError("one"));
  first.Update(absl::InternalError("two"));
  EXPECT_EQ(first.Get(), absl::NotFoundError("one"));
}

}  // namespace
}  // namespace sheaf
