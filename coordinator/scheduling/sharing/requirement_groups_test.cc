// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/sharing/requirement_groups.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr uint64_t kGib = uint64_t{1} << 30;

TEST(RequirementGroupsTest, WorkersFitByPoolTagsAndMemory) {
  const WorkerTraits worker{"big", {"avx", "ssd"}, 8 * kGib};
  EXPECT_TRUE(Fits({"big", {}, 0, 0}, worker));
  EXPECT_TRUE(Fits({"big", {"avx", "ssd"}, 8 * kGib, 100 * kGib}, worker));
  EXPECT_FALSE(Fits({}, worker)) << "another pool";
  EXPECT_FALSE(Fits({"big", {"gpu"}, 0, 0}, worker));
  EXPECT_FALSE(Fits({"big", {}, 8 * kGib + 1, 0}, worker));
}

TEST(RequirementGroupsTest, EqualRequirementsAreOneGroup) {
  RequirementGroups groups;
  const WorkerKinds nobody;
  const Requirements tagged{kDefaultPool, {"ssd"}, 0, 0};
  const int plain = groups.Add({});
  EXPECT_EQ(groups.Add({}), plain);
  const int ssd = groups.Add(tagged);
  EXPECT_THAT(groups.For("p", {}, nobody, 9), ElementsAre(plain));
  EXPECT_THAT(groups.For("p", {kDefaultPool, {"ssd"}, 0}, nobody, 9), ElementsAre(plain, ssd));
  EXPECT_TRUE(groups.HasRoom(tagged, 2));
  EXPECT_FALSE(groups.HasRoom({"other", {}, 0, 0}, 2));
  groups.Release(plain);
  EXPECT_THAT(groups.For("p", {}, nobody, 9), ElementsAre(plain));
  groups.Release(plain);
  EXPECT_THAT(groups.For("p", {}, nobody, 9), IsEmpty());
  EXPECT_TRUE(groups.HasRoom({"other", {}, 0, 0}, 2));
}

TEST(RequirementGroupsTest, SmallWorkersComeLastWhereMemoryIsExpectedToBeNeeded) {
  RequirementGroups groups;
  WorkerKinds kinds;
  const WorkerTraits small{kDefaultPool, {}, 4 * kGib}, large{kDefaultPool, {}, 16 * kGib};
  const int group = groups.Add({kDefaultPool, {}, 0, 9 * kGib});
  kinds.Count("p", small, 1);
  EXPECT_THAT(groups.For("p", small, kinds, 9), ElementsAre(group)) << "there is no other";
  kinds.Count("q", large, 1);
  EXPECT_THAT(groups.For("p", small, kinds, 9), ElementsAre(group)) << "of another profile";
  kinds.Count("p", large, 1);
  EXPECT_THAT(groups.For("p", small, kinds, 9), IsEmpty());
  EXPECT_THAT(groups.For("p", large, kinds, 9), ElementsAre(group));
  EXPECT_THAT(groups.For("p", small, kinds, 0), ElementsAre(group)) << "no kinds are compared";
  kinds.Count("p", large, -1);
  EXPECT_THAT(groups.For("p", small, kinds, 9), ElementsAre(group));
}

TEST(RequirementGroupsTest, ReasonsNameWhatIsMissing) {
  WorkerKinds kinds;
  const auto why = [&](const Requirements& r) { return kinds.WhyNone("p", r); };
  EXPECT_EQ(why({"big", {}, 0, 0}), "") << "no worker of the profile at all is another reason";
  kinds.Count("p", {"big", {"avx"}, 8 * kGib}, 2);
  kinds.Count("p", {"small", {}, 4 * kGib}, 1);
  EXPECT_EQ(why({"big", {"avx"}, 8 * kGib, 0}), "");
  EXPECT_EQ(kinds.LiveCount("p", {"big", {"avx"}, 8 * kGib, 0}), 2);
  EXPECT_THAT(why({}),
              HasSubstr("pool \"default\" is connected; the connected workers are of big"));
  EXPECT_THAT(why({"big", {"avx", "gpu"}, 0, 0}), HasSubstr("has the tag \"gpu\""));
  EXPECT_THAT(why({"big", {"avx"}, 9 * kGib, 0}), HasSubstr("gives 9.0 GiB of memory"));
  EXPECT_THAT(why({"big", {"avx"}, 9 * kGib, 0}), HasSubstr("one gives is 8.0 GiB"));
}

}  // namespace
}  // namespace sheaf::coordinator
