// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/placement/placement.h"

#include <map>
#include <string>
#include <vector>

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

TEST(WarmWorkersTest, CountsWorkersByProfileAndScene) {
  WarmWorkers warm;
  warm.Set("a", "p", {"x", "y"});
  warm.Set("b", "p", {"x"});
  warm.Set("c", "q", {"x"});
  EXPECT_EQ(warm.CountOf("p", "x"), 2);
  EXPECT_EQ(warm.CountOf("p", "y"), 1);
  warm.Set("a", "p", {"y", "z"});
  EXPECT_EQ(warm.CountOf("p", "x"), 1);
  EXPECT_EQ(warm.CountOf("p", "z"), 1);
  warm.Set("a", "p", {});
  warm.Set("b", "q", {"x"});
  EXPECT_EQ(warm.CountOf("p", "x"), 0);
  EXPECT_EQ(warm.CountOf("p", "z"), 0);
  EXPECT_EQ(warm.CountOf("q", "x"), 2);
}

TEST(SceneJobsTest, ForgetsJobsWithoutWork) {
  SceneJobs jobs;
  const std::string scene = "scene", other = "other";
  jobs.Set(scene, 7, true);
  jobs.Set(scene, 5, true);
  jobs.Set(other, 5, false);
  EXPECT_EQ(jobs.Of(scene), (absl::btree_set<uint64_t>{5, 7}));
  EXPECT_TRUE(jobs.Of(other).empty());
  jobs.Set(scene, 5, false);
  jobs.Set(scene, 7, false);
  EXPECT_EQ(jobs.scene_count(), 0u);
}

TEST(ColdOrderTest, SceneWithMostWorkPerWarmWorkerGoesFirst) {
  const std::map<std::string, int> warm = {{"a", 4}, {"b", 1}};
  const auto count = [&](const std::string& scene) {
    return warm.contains(scene) ? warm.at(scene) : 0;
  };
  // The work of scene a is that of both jobs: 40 for each warm worker.
  const std::vector<ColdWork> choices = {{"b", 30}, {"a", 100}, {"new", 1}, {"a", 60}, {"new2", 9}};
  EXPECT_EQ(ColdOrder(choices, count), (std::vector<size_t>{2, 4, 1, 3, 0}));
}

TEST(MayPassOverTest, WaitsAreBounded) {
  const Limits limits;
  const SteadyTime now = SteadyTime() + absl::Hours(1);
  const SteadyTime never = SteadyTime::InfinitePast(), not_yet = SteadyTime::InfiniteFuture();
  const SteadyTime lately = now - limits.warm_stay_min / 2;
  EXPECT_FALSE(MayPassOver({never, not_yet}, now, limits));
  EXPECT_FALSE(MayPassOver({now - limits.warm_stay_min, not_yet}, now, limits));
  EXPECT_TRUE(MayPassOver({lately, not_yet}, now, limits));
  EXPECT_TRUE(MayPassOver({lately, now - limits.warm_wait_max / 2}, now, limits));
  EXPECT_FALSE(MayPassOver({lately, now - limits.warm_wait_max}, now, limits));
}

}  // namespace
}  // namespace sheaf::coordinator
