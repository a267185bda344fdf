// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/agent.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <new>
#include <set>
#include <thread>
#include <utility>

#include "common/base/mutex.h"

namespace sheaf::worker {
namespace {
using std::chrono::milliseconds;

// A coordinator of one worker: offers each task until it has a result, with configurable failures.
class FakeCoordinator : public CoordinatorLink {
 public:
  explicit FakeCoordinator(uint64_t task_count) {
    for (uint64_t task = 0; task < task_count; ++task) open_.insert(task);
  }

  absl::StatusOr<DesiredState> Synchronize(const WorkerState& state) override {
    const MutexLock lock(&mutex_);
    ++synchronize_count_;
    if (away_) return absl::UnavailableError("connection refused");
    Report(state);
    DesiredState desired;
    desired.next_synchronize = milliseconds(20);
    for (const auto& [id, task] : leased_) desired.leases.push_back(MakeLease(id, task));
    if (lose_every_reply_ > 0 && synchronize_count_ % lose_every_reply_ == 0) {
      return absl::DeadlineExceededError("reply lost");
    }
    return desired;
  }

  absl::StatusOr<std::vector<UploadOutcome>> UploadResults(
      const std::string&, const std::vector<const FinishedPart*>& parts) override {
    const MutexLock lock(&mutex_);
    if (away_) return absl::UnavailableError("connection refused");
    std::vector<UploadOutcome> outcomes;
    for (const FinishedPart* part : parts) {
      if (refused_.contains(part->block.first)) return absl::InvalidArgumentError("not a part");
    }
    for (const FinishedPart* part : parts) {
      const uint64_t task = part->block.first;
      std::erase_if(leased_, [&](const auto& entry) { return entry.second == task; });
      open_.erase(task);
      outcomes.push_back(done_.insert(task).second ? UploadOutcome::kAccepted
                                                   : UploadOutcome::kDuplicateEqual);
    }
    ++upload_count_;
    if (lose_every_reply_ > 0 && upload_count_ % lose_every_reply_ == 0) {
      return absl::UnavailableError("reply lost");
    }
    return outcomes;
  }

  void Abort() override {}

  void set_away(bool away) {
    const MutexLock lock(&mutex_);
    away_ = away;
  }
  void LoseEveryReply(int every) {
    const MutexLock lock(&mutex_);
    lose_every_reply_ = every;
  }
  void Refuse(uint64_t task) {
    const MutexLock lock(&mutex_);
    refused_.insert(task);
  }
  // As after a restart without a table of leases: everything without a result is open.
  void ForgetLeases() {
    const MutexLock lock(&mutex_);
    for (const auto& [id, task] : leased_) open_.insert(task);
    leased_.clear();
  }
  void CancelEverything() {
    const MutexLock lock(&mutex_);
    open_.clear();
    leased_.clear();
  }
  size_t done_count() const {
    const MutexLock lock(&mutex_);
    return done_.size();
  }
  std::vector<LeaseFailure> failures() const {
    const MutexLock lock(&mutex_);
    return failures_;
  }
  bool last_was_loading() const {
    const MutexLock lock(&mutex_);
    return !last_.leases.empty() && last_.leases[0].phase == LeasePhase::kLoading;
  }
  bool last_was_draining_and_empty() const {
    const MutexLock lock(&mutex_);
    return last_.draining && last_.leases.empty();
  }
  int synchronize_count() const {
    const MutexLock lock(&mutex_);
    return synchronize_count_;
  }

 private:
  void Report(const WorkerState& state) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    last_ = state;
    for (const LeaseFailure& failure : state.failures) {
      const auto it = leased_.find(failure.lease_id);
      if (it == leased_.end()) continue;
      failures_.push_back(failure);
      if (failure.kind == FailureKind::kReleased) open_.insert(it->second);
      leased_.erase(it);
    }
    while (!open_.empty() && static_cast<int32_t>(leased_.size()) < state.requested_lease_count) {
      leased_[++last_lease_id_] = *open_.begin();
      open_.erase(open_.begin());
    }
  }
  static Lease MakeLease(uint64_t id, uint64_t task) {
    Lease lease;
    lease.lease_id = id;
    lease.frame_digest = "frame";
    lease.tile = {0, 0, 16, 16};
    lease.block = {task, 1};
    return lease;
  }

  mutable Mutex mutex_;
  std::set<uint64_t> open_ ABSL_GUARDED_BY(mutex_);
  std::set<uint64_t> done_ ABSL_GUARDED_BY(mutex_);
  std::set<uint64_t> refused_ ABSL_GUARDED_BY(mutex_);
  std::map<uint64_t, uint64_t> leased_ ABSL_GUARDED_BY(mutex_);  // Lease id to task.
  std::vector<LeaseFailure> failures_ ABSL_GUARDED_BY(mutex_);
  WorkerState last_ ABSL_GUARDED_BY(mutex_);
  uint64_t last_lease_id_ ABSL_GUARDED_BY(mutex_) = 0;
  int synchronize_count_ ABSL_GUARDED_BY(mutex_) = 0;
  int upload_count_ ABSL_GUARDED_BY(mutex_) = 0;
  int lose_every_reply_ ABSL_GUARDED_BY(mutex_) = 0;
  bool away_ ABSL_GUARDED_BY(mutex_) = false;
};

// Renders at once, or waits until the gate opens.
class FakeRenderer : public SceneLoader {
 public:
  LoadResult Load(const Lease&, std::stop_token) override {
    if (on_load) on_load();
    if (!load_status.ok()) return {nullptr, load_status, load_failure_kind};
    return {std::make_unique<Scene>(this), absl::OkStatus(), FailureKind::kInternal};
  }

  std::function<void()> on_load, on_render;
  std::atomic<bool> gate_open{true};
  std::atomic<int> rendering_count{0};
  absl::Status load_status;
  absl::Status render_status;  // For the first task.
  FailureKind load_failure_kind = FailureKind::kInternal;
  size_t part_bytes = 10;

 private:
  class Scene : public LoadedScene {
   public:
    explicit Scene(FakeRenderer* renderer) : renderer_(renderer) {}
    uint64_t memory_bytes() const override { return 1; }
    absl::StatusOr<FinishedPart> Render(const Lease& lease, std::stop_token stop) const override {
      if (renderer_->on_render) renderer_->on_render();
      if (!renderer_->render_status.ok()) return std::exchange(renderer_->render_status, {});
      ++renderer_->rendering_count;
      while (!renderer_->gate_open && !stop.stop_requested()) std::this_thread::yield();
      --renderer_->rendering_count;
      if (stop.stop_requested()) return absl::CancelledError("stopped");
      FinishedPart part;
      part.lease_id = lease.lease_id;
      part.frame_digest = lease.frame_digest;
      part.tile = lease.tile;
      part.block = lease.block;
      part.exr_bytes.assign(renderer_->part_bytes, 'x');
      return part;
    }

   private:
    FakeRenderer* renderer_;
  };
};

AgentOptions FastOptions() {
  AgentOptions options;
  options.worker_id = "host-1-test";
  options.thread_count = 2;
  options.grace = milliseconds(200);
  options.farewell = milliseconds(200);
  options.backoff_initial = milliseconds(1);
  options.backoff_max = milliseconds(5);
  options.synchronize_spacing = milliseconds(1);
  return options;
}

// Runs an agent in a thread beside the test.
class Running {
 public:
  Running(const AgentOptions& options, CoordinatorLink* link, SceneLoader* loader)
      : agent_(options, link, loader),
        thread_([this](std::stop_token stop) { status_ = agent_.Run(stop); }) {}
  absl::Status Stop() {
    thread_.request_stop();
    return Join();
  }
  absl::Status Join() {
    if (thread_.joinable()) thread_.join();
    return status_;
  }
  Agent& agent() { return agent_; }

 private:
  Agent agent_;
  absl::Status status_;
  std::jthread thread_;
};

// Waits until the condition holds, long enough for a slow machine.
bool Eventually(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(milliseconds(1));
  }
  return true;
}

TEST(AgentTest, RendersAllTasks) {
  FakeCoordinator coordinator(100);
  FakeRenderer renderer;
  Running running(FastOptions(), &coordinator, &renderer);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 100; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_EQ(running.agent().counts().accepted, 100u);
  EXPECT_TRUE(coordinator.last_was_draining_and_empty());
}

TEST(AgentTest, LostRepliesLoseNoWork) {
  FakeCoordinator coordinator(100);
  coordinator.LoseEveryReply(3);
  FakeRenderer renderer;
  Running running(FastOptions(), &coordinator, &renderer);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 100; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_EQ(running.agent().counts().accepted + running.agent().counts().duplicate_equal, 100u);
  EXPECT_TRUE(coordinator.failures().empty());
}

TEST(AgentTest, CoordinatorRestartLosesNoPart) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  renderer.gate_open = false;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  coordinator.set_away(true);
  coordinator.ForgetLeases();
  renderer.gate_open = true;  // Leased tasks are rendered although the coordinator does not answer.
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 0; }));
  coordinator.set_away(false);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 20; }));
  EXPECT_TRUE(running.Stop().ok());
}

TEST(AgentTest, CancelWhileRenderingStopsTheThreads) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  renderer.gate_open = false;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  coordinator.CancelEverything();
  EXPECT_TRUE(Eventually([&] { return renderer.rendering_count == 0; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_TRUE(coordinator.failures().empty());
}

TEST(AgentTest, TermFinishesTasksWithinTheGracePeriod) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  renderer.gate_open = false;
  AgentOptions options = FastOptions();
  options.grace = std::chrono::seconds(20);
  Running running(options, &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  std::jthread opener([&] {
    Eventually([&] { return coordinator.failures().size() == 2; });  // Queued leases are returned.
    renderer.gate_open = true;
  });
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_EQ(coordinator.done_count(), 2u);
  for (const LeaseFailure& failure : coordinator.failures()) {
    EXPECT_EQ(failure.kind, FailureKind::kReleased);
  }
}

TEST(AgentTest, TermReleasesTasksBeyondTheGracePeriod) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  renderer.gate_open = false;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_EQ(coordinator.done_count(), 0u);
  EXPECT_EQ(coordinator.failures().size(), 4u);  // Two in threads, two ahead.
  EXPECT_TRUE(coordinator.last_was_draining_and_empty());
}

TEST(AgentTest, TermWithoutACoordinatorEndsAfterTheGracePeriod) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  renderer.gate_open = false;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  coordinator.set_away(true);
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(running.Stop().code(), absl::StatusCode::kUnavailable);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
}

TEST(AgentTest, ClassifiesLoadFailures) {
  FakeCoordinator coordinator(1);
  FakeRenderer renderer;
  renderer.load_status = absl::InvalidArgumentError("room.pbrt:3:1: no such material");
  renderer.load_failure_kind = FailureKind::kScene;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return coordinator.failures().size() == 1; }));
  EXPECT_EQ(coordinator.failures()[0].kind, FailureKind::kScene);
  EXPECT_EQ(coordinator.failures()[0].message, "room.pbrt:3:1: no such material");
  EXPECT_TRUE(running.Stop().ok());
}

TEST(AgentTest, OutOfMemoryFailsOnlyTheTask) {
  for (const bool while_loading : {true, false}) {
    FakeCoordinator coordinator(2);
    FakeRenderer renderer;
    std::atomic<int> calls{0};
    const auto lack_once = [&] {
      if (calls++ == 0) throw std::bad_alloc();
    };
    (while_loading ? renderer.on_load : renderer.on_render) = lack_once;
    AgentOptions options = FastOptions();
    options.thread_count = 1;
    Running running(options, &coordinator, &renderer);
    EXPECT_TRUE(Eventually(
        [&] { return coordinator.failures().size() == 1 && coordinator.done_count() == 1; }));
    EXPECT_EQ(coordinator.failures()[0].kind, FailureKind::kMemory);
    EXPECT_THAT(coordinator.failures()[0].message,
                testing::HasSubstr(while_loading ? "loading the scene" : "rendering"));
    EXPECT_TRUE(running.Stop().ok());
  }
}

TEST(AgentTest, ScenesThatFailAreReloaded) {
  const std::pair<absl::Status, FailureKind> failures[] = {
      {absl::AbortedError("the coordinator has another guiding field"), FailureKind::kReleased},
      {absl::UnavailableError("no guiding field arrives"), FailureKind::kInfrastructure},
      {absl::DataLossError("file a.png was altered"), FailureKind::kInfrastructure},
      {absl::ResourceExhaustedError("its process was killed"), FailureKind::kMemory},
      {absl::InternalError("its process crashed"), FailureKind::kInternal}};
  for (const auto& [status, kind] : failures) {
    FakeCoordinator coordinator(2);
    FakeRenderer renderer;
    std::atomic<int> loads{0};
    renderer.on_load = [&] { ++loads; };
    renderer.render_status = status;
    AgentOptions options = FastOptions();
    options.thread_count = 1;
    Running running(options, &coordinator, &renderer);
    const size_t done = kind == FailureKind::kReleased ? 2 : 1;  // Both, for it is leased again.
    EXPECT_TRUE(Eventually(
        [&] { return coordinator.failures().size() == 1 && coordinator.done_count() == done; }));
    EXPECT_EQ(coordinator.failures()[0].kind, kind) << status;
    EXPECT_EQ(coordinator.failures()[0].message, status.message());
    EXPECT_EQ(loads, absl::IsUnavailable(status) ? 1 : 2) << "a scene without field stays good";
    EXPECT_TRUE(running.Stop().ok());
  }
}

TEST(AgentTest, LoadsAreReportedBeforeTheyBegin) {
  FakeCoordinator coordinator(1);
  FakeRenderer renderer;
  bool known = false;
  renderer.on_load = [&] { known = coordinator.last_was_loading(); };
  Running running(FastOptions(), &coordinator, &renderer);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 1; }));
  EXPECT_TRUE(known);
  EXPECT_TRUE(running.Stop().ok());
}

TEST(AgentTest, RefusedPartsDoNotBlockOthers) {
  FakeCoordinator coordinator(30);
  coordinator.Refuse(7);
  FakeRenderer renderer;
  Running running(FastOptions(), &coordinator, &renderer);
  EXPECT_TRUE(Eventually(
      [&] { return coordinator.done_count() == 29 && coordinator.failures().size() == 1; }));
  EXPECT_EQ(coordinator.failures()[0].kind, FailureKind::kInternal);
  EXPECT_TRUE(running.Stop().ok());
}

TEST(AgentTest, FullOutboxDelaysNewTasks) {
  FakeCoordinator coordinator(50);
  FakeRenderer renderer;
  renderer.gate_open = false;
  renderer.part_bytes = 1000;
  AgentOptions options = FastOptions();
  options.unsent_bytes_max = 1500;
  Running running(options, &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  coordinator.set_away(true);
  renderer.gate_open = true;
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 0; }));
  EXPECT_EQ(coordinator.done_count(), 0u);
  coordinator.set_away(false);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 50; }));
  EXPECT_TRUE(running.Stop().ok());
}

TEST(AgentTest, EndsAfterTheIdleTimeout) {
  FakeCoordinator coordinator(5);
  FakeRenderer renderer;
  AgentOptions options = FastOptions();
  options.exit_when_idle = milliseconds(50);
  Running running(options, &coordinator, &renderer);
  EXPECT_TRUE(running.Join().ok());
  EXPECT_EQ(coordinator.done_count(), 5u);
}

TEST(AgentTest, BacksOffWithoutACoordinator) {
  FakeCoordinator coordinator(1);
  coordinator.set_away(true);
  FakeRenderer renderer;
  AgentOptions options = FastOptions();
  options.backoff_initial = options.backoff_max = milliseconds(50);
  Running running(options, &coordinator, &renderer);
  std::this_thread::sleep_for(milliseconds(120));
  EXPECT_LE(coordinator.synchronize_count(), 4);
  EXPECT_TRUE(running.Stop().ok());
}

}  // namespace
}  // namespace sheaf::worker
