// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Combines events by key and bounds the queue of a slow reader.
#include "coordinator/service/http/server/event_stream.h"

#include <algorithm>

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

absl::StatusOr<std::shared_ptr<EventQueue>> EventHub::Subscribe(const std::string& reader) {
  const MutexLock lock(&mutex_);
  std::erase_if(subscriptions_, [](const Subscription& s) { return s.queue.expired(); });
  const auto of_reader = [&](const Subscription& s) { return s.reader == reader; };
  const auto own = std::count_if(subscriptions_.begin(), subscriptions_.end(), of_reader);
  if (static_cast<size_t>(own) >= kEventReadersOfOneMax) {
    return absl::ResourceExhaustedError(absl::StrCat(
        reader, " has ", own, " event streams open, the limit of one; close some pages"));
  }
  if (subscriptions_.size() >= kEventReaderCountMax) {
    return absl::UnavailableError(
        absl::StrCat(kEventReaderCountMax, " event streams are open, the limit; close some pages"));
  }
  auto queue = std::make_shared<EventQueue>();
  subscriptions_.push_back({reader, queue});
  return queue;
}

void EventHub::Publish(const ServerEvent& event) {
  const MutexLock lock(&mutex_);
  for (const Subscription& subscription : subscriptions_) {
    if (const std::shared_ptr<EventQueue> queue = subscription.queue.lock()) queue->Push(event);
  }
  if (wake_) wake_();
}

size_t EventHub::ReaderCount() const {
  const MutexLock lock(&mutex_);
  size_t count = 0;
  for (const Subscription& s : subscriptions_) count += s.queue.expired() ? 0 : 1;
  return count;
}

void EventHub::SetWake(std::function<void()> wake) {
  const MutexLock lock(&mutex_);
  wake_ = std::move(wake);
}

}  // namespace sheaf::coordinator
