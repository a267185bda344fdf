// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/result_outbox.h"

#include <gtest/gtest.h>

namespace sheaf::worker {
namespace {

FinishedPart MakePart(uint64_t lease_id, size_t size_bytes) {
  FinishedPart part;
  part.lease_id = lease_id;
  part.exr_bytes.assign(size_bytes, 'x');
  return part;
}

TEST(ResultOutboxTest, IsFullAtItsByteLimit) {
  ResultOutbox outbox(100);
  outbox.Push(MakePart(1, 60));
  EXPECT_TRUE(outbox.HasRoom());
  outbox.Push(MakePart(2, 60));
  EXPECT_FALSE(outbox.HasRoom());
  outbox.Pop();
  EXPECT_TRUE(outbox.HasRoom());
  EXPECT_EQ(outbox.size_bytes(), 60u);
}

TEST(ResultOutboxTest, ReturnsOldestUntilPopped) {
  ResultOutbox outbox(100);
  for (uint64_t id = 1; id <= 3; ++id) outbox.Push(MakePart(id, 1));
  const std::vector<const FinishedPart*> front = outbox.Front(2);
  ASSERT_EQ(front.size(), 2u);
  EXPECT_EQ(front[0]->lease_id, 1u);
  outbox.Push(MakePart(4, 1));
  EXPECT_EQ(front[1]->lease_id, 2u);
  outbox.Pop();
  EXPECT_EQ(outbox.Front(9).front()->lease_id, 2u);
}

}  // namespace
}  // namespace sheaf::worker
