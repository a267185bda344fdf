// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/sharing/held_threads.h"

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

const ShareSubject kAnna{ShareKind::kUser, "anna"}, kBen{ShareKind::kUser, "ben"};
const ShareSubject kComet{ShareKind::kShow, "comet"}, kBig{ShareKind::kPool, "big"};

TEST(HeldThreadsTest, LeasesThatWaitInAWorkerHoldNoMoreThanItsThreads) {
  HeldThreads held;
  for (uint64_t id = 1; id <= 6; ++id) held.Add(id, {"anna", "comet", "big", "w1", 1, 4});
  EXPECT_EQ(held.Of(kAnna), 4);
  held.Add(7, {"anna", "comet", "big", "w2", 1, 4});
  held.Add(8, {"ben", "comet", "big", "w2", 2, 4});
  EXPECT_EQ(held.Of(kAnna), 5);
  EXPECT_EQ(held.Of(kBen), 2);
  EXPECT_EQ(held.Of(kComet), 7);
  EXPECT_EQ(held.Of(kBig), 7);
  EXPECT_EQ(held.OfWith(kAnna, "w1", 1, 4), 5) << "it waits there";
  EXPECT_EQ(held.OfWith(kAnna, "w3", 2, 8), 7);
  EXPECT_EQ(held.OfWith({ShareKind::kUser, "eve"}, "w3", 2, 8), 2);
}

TEST(HeldThreadsTest, NothingIsLeftOfLeasesThatEnded) {
  HeldThreads held;
  for (uint64_t id = 1; id <= 6; ++id) held.Add(id, {"anna", "comet", "big", "w1", 1, 4});
  held.Remove(1);
  held.Remove(2);
  EXPECT_EQ(held.Of(kAnna), 4);
  held.Remove(3);
  held.Remove(3);
  EXPECT_EQ(held.Of(kAnna), 3);
  for (uint64_t id = 4; id <= 6; ++id) held.Remove(id);
  EXPECT_EQ(held.Of(kAnna), 0);
  EXPECT_EQ(held.Of(kBig), 0);
}

}  // namespace
}  // namespace sheaf::coordinator
