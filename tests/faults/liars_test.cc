// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A farm of four workers, one of which returns plausible false results for some of its tasks:
// colors that are 2 % too bright, or one pixel changed. Jobs come one after the other; in the end
// the delivered images must be those of an honest farm, and the checks must not cost much. Prints
// how many images are true, at once and after corrections, and the work beyond that of the images.
// With SHEAF_LONG_TESTS=1 each case has 100 jobs.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

constexpr int kWorkerCount = 4;
constexpr int kEdgePx = 128;
constexpr uint64_t kSamples = 64;
constexpr absl::Duration kCaseMax = absl::Minutes(10);

bool IsLong() {
  const char* value = std::getenv("SHEAF_LONG_TESTS");
  return value != nullptr && std::string(value) == "1";
}

// Makes some of the parts false, in one of two ways in turn.
class Falsifier {
 public:
  Falsifier(double fraction, uint64_t seed) : fraction_(fraction), random_(seed) {}
  void operator()(FilmTile* part) {
    if (std::uniform_real_distribution<double>(0, 1)(random_) >= fraction_) return;
    if (++count_ % 2 == 0) {
      ScaleColors(1.02F, part);
    } else {
      ScalePixelColors(random_() % part->plane_size(), 1.5F, part);
    }
  }

 private:
  const double fraction_;
  std::mt19937_64 random_;
  int count_ = 0;
};

class LiarsTest : public CoordinatorServerTest {
 protected:
  LiarsTest() {
    options_.farm.durability = Durability::kProcess;
    options_.farm.limits.check_fraction = Limits().check_fraction;
  }

  v1::CreateJobRequest JobRequest(int number) {
    v1::CreateJobRequest request = Request(kSamples, absl::StrCat("job ", number));
    v1::FrameSettings* settings = request.mutable_frames(0)->mutable_settings();
    settings->set_width_px(kEdgePx);
    settings->set_height_px(kEdgePx);
    settings->clear_window();
    settings->mutable_window()->set_x1_px(kEdgePx);
    settings->mutable_window()->set_y1_px(kEdgePx);
    settings->set_seed(static_cast<uint64_t>(number) + 1);
    request.mutable_partition()->set_pass_sample_count(16);
    request.mutable_partition()->set_lease_pass_count(1);
    return request;
  }

  // Works until the test ends or the farm refuses it.
  void Work(SyntheticWorker* worker) {
    while (!stop_) {
      const absl::Status status = worker->Synchronize(3);
      if (absl::IsPermissionDenied(status)) return;
      if (worker->leases().empty()) absl::SleepFor(absl::Milliseconds(5));
      while (!worker->leases().empty() && !stop_) worker->RenderOne().status().IgnoreError();
    }
  }

  struct Outcome {
    int true_at_once = 0, true_in_the_end = 0;
    double extra_work = 0, check_work = 0;  // Over the samples of the images.
    int quarantined = 0;
  };
  Outcome Run(double false_fraction, int job_count) {
    Start();
    std::vector<std::unique_ptr<SyntheticWorker>> workers;
    for (int i = 0; i < kWorkerCount; ++i) {
      workers.push_back(
          std::make_unique<SyntheticWorker>(server_->InProcessChannel(), absl::StrCat("w", i)));
    }
    if (false_fraction > 0) workers[0]->set_falsify(Falsifier(false_fraction, /*seed=*/1));
    // All are there before the first job comes.
    for (const auto& worker : workers) EXPECT_TRUE(worker->Synchronize(0).ok());
    std::vector<std::thread> threads;
    for (const auto& worker : workers) {
      threads.emplace_back([this, one = worker.get()] { Work(one); });
    }
    Outcome outcome;
    std::vector<std::string> names, expected;
    for (int i = 0; i < job_count; ++i) {
      const v1::CreateJobRequest request = JobRequest(i);
      names.push_back(Create(request).name());
      expected.push_back(DigestOf(request.frames(0).settings()));
      const v1::Job job = WaitForEnd(names.back());
      outcome.true_at_once += job.frames(0).image_digest() == expected.back() ? 1 : 0;
    }
    // Corrections may still be under way.
    const absl::Time deadline = absl::Now() + absl::Minutes(1);
    do {
      outcome.true_in_the_end = 0;
      for (size_t i = 0; i < names.size(); ++i) {
        const v1::Job job = Get(names[i]);
        outcome.true_in_the_end +=
            job.state() == v1::Job::STATE_SUCCEEDED && job.frames(0).image_digest() == expected[i]
                ? 1
                : 0;
      }
      absl::SleepFor(absl::Milliseconds(50));
    } while (outcome.true_in_the_end < job_count && Counter("sheaf_jobs_live") > 0 &&
             absl::Now() < deadline);
    stop_ = true;
    for (std::thread& thread : threads) thread.join();
    const double needed =
        static_cast<double>(kEdgePx) * kEdgePx * static_cast<double>(kSamples) * job_count;
    outcome.check_work = Counter("sheaf_samples_checked_total") / needed;
    outcome.extra_work = Counter("sheaf_samples_accepted_total") / needed - 1 + outcome.check_work;
    outcome.quarantined = static_cast<int>(Counter("sheaf_workers_quarantined_total"));
    std::printf(
        "%4.0f %% false: %3d of %d images true at once, %3d in the end; "
        "extra work %.1f %%, of it checks %.1f %%; %d quarantined\n",
        100 * false_fraction, outcome.true_at_once, job_count, outcome.true_in_the_end,
        100 * outcome.extra_work, 100 * outcome.check_work, outcome.quarantined);
    return outcome;
  }

  v1::Job WaitForEnd(const std::string& name) {
    const absl::Time deadline = absl::Now() + kCaseMax;
    v1::Job job = Get(name);
    while (job.state() != v1::Job::STATE_SUCCEEDED && absl::Now() < deadline) {
      absl::SleepFor(absl::Milliseconds(5));
      job = Get(name);
    }
    return job;
  }

  std::atomic<bool> stop_ = false;
};

TEST_F(LiarsTest, HonestFarmsPayLittleForChecks) {
  const int job_count = IsLong() ? 100 : 20;
  const Outcome outcome = Run(0, job_count);
  EXPECT_EQ(outcome.true_in_the_end, job_count);
  EXPECT_EQ(outcome.quarantined, 0);
  // The first results of each worker are checked more often.
  EXPECT_LE(outcome.check_work, IsLong() ? 0.03 : 0.06);
}

TEST_F(LiarsTest, ATenthFalse) {
  const int job_count = IsLong() ? 100 : 20;
  const Outcome outcome = Run(0.1, job_count);
  // In a few jobs it may not be found yet.
  if (IsLong()) {
    EXPECT_GE(outcome.true_in_the_end, 99);
  }
  if (outcome.quarantined == 1) {
    EXPECT_EQ(outcome.true_in_the_end, job_count);
  }
  EXPECT_LE(outcome.quarantined, 1);
}

TEST_F(LiarsTest, HalfFalse) {
  const int job_count = IsLong() ? 100 : 10;
  const Outcome outcome = Run(0.5, job_count);
  EXPECT_EQ(outcome.true_in_the_end, job_count);
  EXPECT_EQ(outcome.quarantined, 1);
}

TEST_F(LiarsTest, AllFalse) {
  const int job_count = IsLong() ? 100 : 5;
  const Outcome outcome = Run(1, job_count);
  EXPECT_EQ(outcome.true_in_the_end, job_count);
  EXPECT_EQ(outcome.quarantined, 1);
}

}  // namespace
}  // namespace sheaf::coordinator
