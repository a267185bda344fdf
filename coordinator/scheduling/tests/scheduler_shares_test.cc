// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Simulates a farm of users with cheap and expensive scenes, and compares their parts of its time.
#include <algorithm>
#include <functional>
#include <map>
#include <queue>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "coordinator/scheduling/tests/scheduler_fixture.h"
#include "gmock/gmock.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

constexpr int kUserCount = 3;
constexpr int kJobCount = 1000;
const char* const kUsers[kUserCount] = {"anna", "ben", "eve"};

// Workers of one thread each render one lease after the other.
class SharesTest : public SchedulerTest {
 protected:
  uint64_t AddJobOf(const std::string& user, const std::string& show = kDefaultShow,
                    int32_t edge_px = 160) {
    JobSpec job;
    job.job_id = ++last_job_id_;
    job.owner = user;
    job.show = show;
    job.numeric_profile = kProfile;
    job.partition = {32, 16, 1};
    job.frames.push_back(Frame(1, "scene", 100 + job.job_id));
    FrameSettings& settings = job.frames[0].settings;
    settings.width_px = settings.height_px = edge_px;
    settings.window = {0, 0, edge_px, edge_px};
    EXPECT_TRUE(scheduler_.CheckJob(job).ok());
    scheduler_.AddJob(job);
    owners_[job.job_id] = user;
    return job.job_id;
  }
  // Cost of a lease of the job: 0.1 to 1.5 s. Users differ, and so do the jobs of each.
  absl::Duration CostOf(uint64_t job_id) const {
    const std::string& user = owners_.at(job_id);
    const double factor = user == "anna" ? 0.1 : user == "ben" ? 0.4 : 1.0;
    return absl::Seconds(factor * (1 + 0.05 * static_cast<double>(job_id * 7 % 11)));
  }
  void Start(int worker_count) {
    for (int i = 0; i < worker_count; ++i) {
      ends_.emplace(now_ + absl::Milliseconds(i), absl::StrCat("w", i));
    }
  }
  // Until `end`, calling at each event.
  template <typename At>
  void RunUntil(SteadyTime end, const At& at) {
    while (!ends_.empty() && ends_.top().first <= end) {
      const std::string id = ends_.top().second;
      now_ = ends_.top().first;
      ends_.pop();
      const auto held = leases_.find(id);
      if (held != leases_.end()) {
        const Lease lease = held->second;
        leases_.erase(held);
        scheduler_.Accept(lease.frame, lease.task, lease.lease_id, id,
                          {1, 0, CostOf(lease.frame.job_id)}, now_);
      }
      held_[id].clear();
      const std::vector<Lease> leases = Sync(id, 1);
      if (leases.empty()) {
        ends_.emplace(now_ + absl::Milliseconds(200), id);
        continue;
      }
      leases_[id] = leases[0];
      const uint64_t job_id = leases[0].frame.job_id;
      first_leases_.try_emplace(job_id, now_);
      ends_.emplace(now_ + CostOf(job_id), id);
      spans_[owners_.at(job_id)].push_back({now_, now_ + CostOf(job_id)});
      at();
    }
  }
  // Thread-seconds that a user held in a time.
  double HeldBy(const std::string& user, SteadyTime begin, SteadyTime end) {
    double seconds = 0;
    for (const auto& [from, to] : spans_[user]) {
      const SteadyTime first = std::max(from, begin), last = std::min(to, end);
      if (first < last) seconds += absl::ToDoubleSeconds(last - first);
    }
    return seconds;
  }
  std::map<std::string, int> HoldersNow() const {
    std::map<std::string, int> counts;
    for (const auto& [worker, lease] : leases_) ++counts[owners_.at(lease.frame.job_id)];
    return counts;
  }

  using Event = std::pair<SteadyTime, std::string>;
  std::priority_queue<Event, std::vector<Event>, std::greater<>> ends_;
  std::map<std::string, Lease> leases_;
  std::map<uint64_t, std::string> owners_;
  std::map<uint64_t, SteadyTime> first_leases_;
  std::map<std::string, std::vector<std::pair<SteadyTime, SteadyTime>>> spans_;
};

class WeightedSharesTest : public SharesTest, public ::testing::WithParamInterface<int> {};

// A user with weight 1 or 2 and two with weight 1: a minute of 100 workers and 1,000 jobs.
TEST_P(WeightedSharesTest, HoldWithinTwoPercentOverAMinute) {
  const double weight = GetParam();
  scheduler_.SetShare({ShareKind::kUser, "anna"}, {weight, 0});
  for (int i = 0; i < kJobCount; ++i) AddJobOf(kUsers[i % kUserCount]);
  const SteadyTime begin = now_, end = begin + absl::Minutes(1);
  Start(100);
  RunUntil(begin + absl::Seconds(30), [] {});
  const SteadyTime late = now_;
  const uint64_t small = AddJobOf("eve", kDefaultShow, 32), newcomer = AddJobOf("zoe", "z", 32);
  RunUntil(end, [] {});
  // Both are soon done and cost others nothing to speak of.
  const absl::Duration lease_max = absl::Seconds(1.5);
  ASSERT_TRUE(first_leases_.contains(small) && first_leases_.contains(newcomer));
  EXPECT_LE(first_leases_[small], late + lease_max);
  EXPECT_LE(first_leases_[newcomer], late + lease_max);
  double total = 0;
  for (const char* user : kUsers) total += HeldBy(user, begin, end);
  EXPECT_GT(total, 0.99 * 60 * 100);
  for (const char* user : kUsers) {
    const double wanted = (user == std::string("anna") ? weight : 1) / (weight + 2);
    EXPECT_NEAR(HeldBy(user, begin, end) / total, wanted, 0.02 * wanted) << user;
  }
  EXPECT_EQ(first_leases_.size(), kJobCount + 2u) << "each job had its turn";
}

INSTANTIATE_TEST_SUITE_P(Weights, WeightedSharesTest, ::testing::Values(1, 2));

TEST_F(SharesTest, LimitsAreKeptAndOthersTakeTheRest) {
  for (int i = 0; i < 90; ++i) AddJobOf(kUsers[i % kUserCount], i % 2 == 0 ? "even" : "odd");
  scheduler_.SetShare({ShareKind::kUser, "anna"}, {1, 3});
  const auto check = [&](int anna_max) {
    const std::map<std::string, int> held = HoldersNow();
    const auto anna = held.find("anna");
    const int count = anna == held.end() ? 0 : anna->second;
    EXPECT_LE(count, anna_max);
    EXPECT_EQ(scheduler_.held_threads().Of({ShareKind::kUser, "anna"}), count);
  };
  const SteadyTime begin = now_;
  Start(20);
  RunUntil(begin + absl::Seconds(10), [&] { check(3); });
  EXPECT_NEAR(HeldBy("anna", begin, now_), 30, 3) << "it gets what it may have";
  EXPECT_NEAR(HeldBy("ben", begin, now_) + HeldBy("eve", begin, now_), 170, 5);
  scheduler_.ResetShare({ShareKind::kUser, "anna"});
  scheduler_.SetShare({ShareKind::kShow, "even"}, {1, 4});
  scheduler_.SetShare({ShareKind::kPool, kDefaultPool}, {1, 10});
  RunUntil(begin + absl::Seconds(12), [] {});
  RunUntil(begin + absl::Seconds(20), [&] {
    EXPECT_LE(scheduler_.held_threads().Of({ShareKind::kShow, "even"}), 4);
    EXPECT_LE(leases_.size(), 10u);
  });
}

TEST_F(SharesTest, AJobThatALimitHoldsSaysSo) {
  const uint64_t first = AddJobOf("anna"), second = AddJobOf("anna");
  scheduler_.SetShare({ShareKind::kUser, "anna"}, {1, 1});
  ASSERT_EQ(Sync("w1", 1).size(), 1u);
  EXPECT_TRUE(Sync("w2", 1).empty()) << "a hedge would be one too many";
  EXPECT_EQ(scheduler_.WaitingReason(Job(first)), "");
  EXPECT_THAT(scheduler_.WaitingReason(Job(second)), HasSubstr("user:anna holds 1 threads, of 1"));
  scheduler_.SetShare({ShareKind::kUser, "anna"}, {1, 0});
  EXPECT_EQ(Sync("w2", 1).size(), 1u);
}

}  // namespace
}  // namespace sheaf::coordinator
