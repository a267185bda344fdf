// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/server/event_stream.h"

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

TEST(EventStreamTest, EventsAreOrderedAndUnique) {
  EventQueue queue;
  queue.Push({"job", "jobs/1", "{\"a\":1}"});
  queue.Push({"worker", "workers/1", "{}"});
  EXPECT_EQ(queue.Take(), "event: job\ndata: {\"a\":1}\n\nevent: worker\ndata: {}\n\n");
  EXPECT_EQ(queue.Take(), "");
}

TEST(EventStreamTest, NewerStateReplacesOlderOfTheSameKey) {
  EventQueue queue;
  queue.Push({"job", "jobs/1", "1"});
  queue.Push({"job", "jobs/2", "2"});
  queue.Push({"job", "jobs/1", "3"});
  EXPECT_EQ(queue.Take(), "event: job\ndata: 3\n\nevent: job\ndata: 2\n\n");
}

TEST(EventStreamTest, SlowReadersAreResetOnce) {
  EventQueue queue;
  for (size_t i = 0; i < kEventQueueCountMax + 500; ++i) queue.Push({"job", absl::StrCat(i), "{}"});
  EXPECT_EQ(queue.Take(), "event: reset\ndata: {}\n\n");
  EXPECT_EQ(queue.Take(), "");
  queue.Push({"job", "jobs/1", "1"});
  EXPECT_EQ(queue.Take(), "event: job\ndata: 1\n\n");
}

TEST(EventStreamTest, BatchesAreBounded) {
  EventQueue queue;
  const std::string large(kEventBatchBytesMax / 4, 'x');
  for (int i = 0; i < 20; ++i) queue.Push({"job", absl::StrCat(i), large});
  size_t batches = 0;
  for (std::string batch = queue.Take(); !batch.empty(); batch = queue.Take()) {
    EXPECT_LT(batch.size(), 2 * kEventBatchBytesMax);
    ++batches;
  }
  EXPECT_GE(batches, 5u);
}

TEST(EventStreamTest, EveryReaderGetsEveryEvent) {
  EventHub hub;
  int wakes = 0;
  hub.SetWake([&] { ++wakes; });
  auto first = *hub.Subscribe("user:anna");
  auto second = *hub.Subscribe("user:anna");
  hub.Publish({"job", "jobs/1", "1"});
  EXPECT_EQ(first->Take(), second->Take());
  EXPECT_EQ(hub.ReaderCount(), 2u);
  second.reset();
  EXPECT_EQ(hub.ReaderCount(), 1u);
  EXPECT_EQ(wakes, 1);
}

TEST(EventStreamTest, ReadersBeyondTheLimitAreRefused) {
  EventHub hub;
  std::vector<std::shared_ptr<EventQueue>> readers;
  for (size_t i = 0; i < kEventReaderCountMax; ++i) {
    readers.push_back(*hub.Subscribe(absl::StrCat("user:", i)));
  }
  EXPECT_TRUE(absl::IsUnavailable(hub.Subscribe("user:anna").status()));
  readers.pop_back();
  EXPECT_TRUE(hub.Subscribe("user:anna").ok());
}

TEST(EventStreamTest, OneReaderDoesNotTakeThoseOfOthers) {
  EventHub hub;
  std::vector<std::shared_ptr<EventQueue>> readers;
  for (size_t i = 0; i < kEventReadersOfOneMax; ++i) {
    readers.push_back(*hub.Subscribe("user:vera"));
  }
  const absl::Status refused = hub.Subscribe("user:vera").status();
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_TRUE(absl::StrContains(refused.message(), "user:vera has 32 event streams")) << refused;
  EXPECT_TRUE(hub.Subscribe("user:anna").ok());
  readers.pop_back();
  EXPECT_TRUE(hub.Subscribe("user:vera").ok());
}

}  // namespace
}  // namespace sheaf::coordinator
