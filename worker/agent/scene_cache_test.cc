// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/scene_cache.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <latch>
#include <new>
#include <thread>

namespace sheaf::worker {
namespace {

class FakeScene : public LoadedScene {
 public:
  explicit FakeScene(uint64_t memory_bytes) : memory_bytes_(memory_bytes) {}
  uint64_t memory_bytes() const override { return memory_bytes_; }
  absl::StatusOr<FinishedPart> Render(const Lease&, std::stop_token) const override {
    return FinishedPart();
  }

 private:
  uint64_t memory_bytes_;
};

class FakeLoader : public SceneLoader {
 public:
  LoadResult Load(const Lease& lease, std::stop_token stop) override {
    const int number = ++load_count;
    if (number == 1 && first_load_waits_for_stop) {
      while (!stop.stop_requested()) std::this_thread::yield();
      return {nullptr, absl::CancelledError("stopped"), FailureKind::kReleased};
    }
    if (lease.scene.sha256_hex == "bad") {
      return {nullptr, absl::InvalidArgumentError("a.pbrt:1:1: no"), FailureKind::kScene};
    }
    if (lease.scene.sha256_hex == "huge") throw std::bad_alloc();
    return {std::make_unique<FakeScene>(10), absl::OkStatus(), FailureKind::kInternal};
  }
  std::atomic<int> load_count{0};
  bool first_load_waits_for_stop = false;
};

Lease LeaseOf(const std::string& scene) {
  Lease lease;
  lease.frame_digest = "frame of " + scene;
  lease.scene.sha256_hex = scene;
  return lease;
}

TEST(SceneCacheTest, LoadsOnceForManyThreads) {
  FakeLoader loader;
  SceneCache cache(&loader, 100);
  std::atomic<int> ok_count{0};
  std::vector<std::jthread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] { ok_count += cache.Get(LeaseOf("a"), {}).scene != nullptr; });
  }
  threads.clear();
  EXPECT_EQ(ok_count, 8);
  EXPECT_EQ(loader.load_count, 1);
}

TEST(SceneCacheTest, EvictsTheLeastRecentlyUsedBeyondItsLimit) {
  FakeLoader loader;
  SceneCache cache(&loader, 25);
  const SharedScene a = cache.Get(LeaseOf("a"), {}).scene;
  cache.Get(LeaseOf("b"), {});
  cache.Get(LeaseOf("a"), {});
  cache.Get(LeaseOf("c"), {});
  EXPECT_THAT(cache.WarmScenes(), ::testing::ElementsAre("a", "c"));
  EXPECT_EQ(cache.MemoryBytes(), 20u);
  EXPECT_EQ(cache.Get(LeaseOf("a"), {}).scene, a);
}

TEST(SceneCacheTest, LimitsTheNumberOfScenes) {
  FakeLoader loader;
  SceneCache cache(&loader, 1'000'000);
  for (size_t i = 0; i < kScenesMax + 5; ++i) cache.Get(LeaseOf(std::to_string(i)), {});
  EXPECT_EQ(cache.WarmScenes().size(), kScenesMax);
  cache.Get(LeaseOf(std::to_string(kScenesMax + 4)), {});
  EXPECT_EQ(loader.load_count, static_cast<int>(kScenesMax) + 5);
}

TEST(SceneCacheTest, KeepsTheLastSceneBeyondTheLimit) {
  FakeLoader loader;
  SceneCache cache(&loader, 1);
  cache.Get(LeaseOf("a"), {});
  cache.Get(LeaseOf("a"), {});
  EXPECT_EQ(loader.load_count, 1);
}

TEST(SceneCacheTest, DoesNotRememberFailures) {
  FakeLoader loader;
  SceneCache cache(&loader, 100);
  for (int i = 0; i < 2; ++i) {
    const SharedLoadResult result = cache.Get(LeaseOf("bad"), {});
    EXPECT_EQ(result.failure_kind, FailureKind::kScene);
    EXPECT_EQ(result.scene, nullptr);
  }
  EXPECT_EQ(loader.load_count, 2);
}

TEST(SceneCacheTest, OutOfMemoryLoadsEvictOtherScenes) {
  FakeLoader loader;
  SceneCache cache(&loader, 100);
  cache.Get(LeaseOf("a"), {});
  EXPECT_FALSE(cache.MustLoad(LeaseOf("a")));
  const SharedLoadResult result = cache.Get(LeaseOf("huge"), {});
  EXPECT_EQ(result.failure_kind, FailureKind::kMemory);
  EXPECT_EQ(result.status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_TRUE(cache.WarmScenes().empty());
  EXPECT_TRUE(cache.MustLoad(LeaseOf("a")));
  EXPECT_NE(cache.Get(LeaseOf("a"), {}).scene, nullptr) << "no thread waits for a load that ended";
}

TEST(SceneCacheTest, WaitingLeasesLoadAfterACancellation) {
  FakeLoader loader;
  loader.first_load_waits_for_stop = true;
  SceneCache cache(&loader, 100);
  std::stop_source stop;
  std::jthread first([&] { cache.Get(LeaseOf("a"), stop.get_token()); });
  while (loader.load_count == 0) std::this_thread::yield();
  SharedLoadResult second;
  std::jthread waiter([&] { second = cache.Get(LeaseOf("a"), {}); });
  stop.request_stop();
  waiter.join();
  EXPECT_NE(second.scene, nullptr);
  EXPECT_EQ(loader.load_count, 2);
}

TEST(SceneCacheTest, ClearDropsAllScenes) {
  FakeLoader loader;
  SceneCache cache(&loader, 100);
  const SharedScene in_use = cache.Get(LeaseOf("a"), {}).scene;
  cache.Get(LeaseOf("b"), {});
  cache.Clear();
  EXPECT_EQ(cache.MemoryBytes(), 0u);
  EXPECT_TRUE(cache.MustLoad(LeaseOf("a")));
  EXPECT_EQ(in_use->memory_bytes(), 10u);  // A thread may still render it.
  EXPECT_NE(cache.Get(LeaseOf("a"), {}).scene, in_use);
}

}  // namespace
}  // namespace sheaf::worker
