// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Server-sent events without an unbounded queue. Every event states what is, under a key; for a
// slow reader a newer event of the same key replaces the older one, and a reader that falls behind
// by more than the limit is told once to look at everything again. So nothing a reader does costs
// more than a fixed amount of memory, and no reader ends with a stale view. Source: HTML Standard,
// sec. 9.2 "Server-sent events".
#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/base/mutex.h"

namespace sheaf::coordinator {

// Events a reader may be behind before its queue is replaced by one "reset" event.
inline constexpr size_t kEventQueueCountMax = 1024;
// Readers at once; more are refused.
inline constexpr size_t kEventReaderCountMax = 256;
// Bytes handed to a socket at once, beyond which the rest waits in the queue.
inline constexpr size_t kEventBatchBytesMax = size_t{1} << 18;

struct ServerEvent {
  // "job", "frame", "worker".
  std::string type;
  // Its subject: "jobs/7". A newer event replaces an unsent one of the same type and key.
  std::string key;
  // JSON on one line.
  std::string json;
};

// The events that one reader has not been sent yet.
// Thread safety: every method may be called from any thread.
class EventQueue {
 public:
  void Push(const ServerEvent& event);
  // Returns the next events in wire form, at most about kEventBatchBytesMax, or "" where none wait.
  std::string Take();

 private:
  Mutex mutex_;
  // Oldest first; `where_` finds an event by type and key.
  std::list<ServerEvent> events_ ABSL_GUARDED_BY(mutex_);
  std::unordered_map<std::string, std::list<ServerEvent>::iterator> where_ ABSL_GUARDED_BY(mutex_);
  bool reset_ ABSL_GUARDED_BY(mutex_) = false;
};

// Gives every event to every reader.
// Thread safety: every method may be called from any thread.
class EventHub {
 public:
  // Returns a queue that lives while the caller holds it, or null beyond kEventReaderCountMax.
  std::shared_ptr<EventQueue> Subscribe();
  void Publish(const ServerEvent& event);
  size_t ReaderCount() const;
  // Called after events were published, on the publisher's thread; it must be quick. An empty
  // function ends it; no call is under way once SetWake has returned.
  void SetWake(std::function<void()> wake);

 private:
  mutable Mutex mutex_;
  std::vector<std::weak_ptr<EventQueue>> queues_ ABSL_GUARDED_BY(mutex_);
  std::function<void()> wake_ ABSL_GUARDED_BY(mutex_);
};

// "event: TYPE\ndata: JSON\n\n".
std::string EncodeEvent(const ServerEvent& event);

}  // namespace sheaf::coordinator
