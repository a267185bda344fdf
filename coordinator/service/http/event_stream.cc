// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Combines events by key and bounds the queue of a slow reader.
#include "coordinator/service/http/event_stream.h"

#include "absl/strings/str_cat.h"

namespace sheaf::coordinator {

std::string EncodeEvent(const ServerEvent& event) {
  return absl::StrCat("event: ", event.type, "\ndata: ", event.json, "\n\n");
}

void EventQueue::Push(const ServerEvent& event) {
  const MutexLock lock(&mutex_);
  // After a reset the reader fetches everything again, so events before it has received the reset
  // are unnecessary.
  if (reset_) return;
  const std::string id = absl::StrCat(event.type, "\n", event.key);
  const auto found = where_.find(id);
  if (found != where_.end()) {
    found->second->json = event.json;
    return;
  }
  if (events_.size() >= kEventQueueCountMax) {
    events_.clear();
    where_.clear();
    reset_ = true;
    return;
  }
  events_.push_back(event);
  where_.emplace(id, std::prev(events_.end()));
}

std::string EventQueue::Take() {
  const MutexLock lock(&mutex_);
  std::string batch;
  if (reset_) {
    reset_ = false;
    batch = EncodeEvent({"reset", "", "{}"});
  }
  while (!events_.empty() && batch.size() < kEventBatchBytesMax) {
    const ServerEvent& event = events_.front();
    absl::StrAppend(&batch, EncodeEvent(event));
    where_.erase(absl::StrCat(event.type, "\n", event.key));
    events_.pop_front();
  }
  return batch;
}

std::shared_ptr<EventQueue> EventHub::Subscribe() {
  const MutexLock lock(&mutex_);
  std::erase_if(queues_, [](const std::weak_ptr<EventQueue>& queue) { return queue.expired(); });
  if (queues_.size() >= kEventReaderCountMax) return nullptr;
  auto queue = std::make_shared<EventQueue>();
  queues_.push_back(queue);
  return queue;
}

void EventHub::Publish(const ServerEvent& event) {
  const MutexLock lock(&mutex_);
  for (const std::weak_ptr<EventQueue>& weak : queues_) {
    if (const std::shared_ptr<EventQueue> queue = weak.lock()) queue->Push(event);
  }
  if (wake_) wake_();
}

size_t EventHub::ReaderCount() const {
  const MutexLock lock(&mutex_);
  size_t count = 0;
  for (const std::weak_ptr<EventQueue>& queue : queues_) count += queue.expired() ? 0 : 1;
  return count;
}

void EventHub::SetWake(std::function<void()> wake) {
  const MutexLock lock(&mutex_);
  wake_ = std::move(wake);
}

}  // namespace sheaf::coordinator
