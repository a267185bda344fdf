// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Server-sent events with bounded queues. Each event states the present state of the object named
// by its key. For a slow reader, a newer event replaces an unsent older one with the same key; a
// reader that falls behind by more than the limit gets one event that tells it to fetch everything
// again. So a reader costs a fixed amount of memory and never ends with an outdated view. Source:
// HTML Standard, sec. 9.2 "Server-sent events".
#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"

namespace sheaf::coordinator {

// Maximum number of unsent events of a reader; beyond it they are replaced by one "reset" event.
inline constexpr size_t kEventQueueCountMax = 1024;
// Maximum number of simultaneous readers, in total, and per identity or, without identities, per
// address; more are refused.
inline constexpr size_t kEventReaderCountMax = 256;
inline constexpr size_t kEventReadersOfOneMax = 32;
// Maximum number of bytes passed to a socket at once; the rest waits in the queue.
inline constexpr size_t kEventBatchBytesMax = size_t{1} << 18;

struct ServerEvent {
  // "job", "frame", "worker".
  std::string type;
  // Its subject: "jobs/7". A newer event replaces an unsent one of the same type and key.
  std::string key;
  // JSON on one line.
  std::string json;
};

// The events that have not yet been sent to one reader.
// Thread safety: every method may be called from any thread.
class EventQueue {
 public:
  void Push(const ServerEvent& event);
  // Returns the next events in wire format, at most about kEventBatchBytesMax, or "" if there are
  // none.
  std::string Take();

 private:
  Mutex mutex_;
  // Oldest first; `where_` finds an event by type and key.
  std::list<ServerEvent> events_ ABSL_GUARDED_BY(mutex_);
  std::unordered_map<std::string, std::list<ServerEvent>::iterator> where_ ABSL_GUARDED_BY(mutex_);
  bool reset_ ABSL_GUARDED_BY(mutex_) = false;
};

// Distributes every event to every reader.
// Thread safety: every method may be called from any thread.
class EventHub {
 public:
  // Returns a queue that is active while the caller holds it. reader: "user:anna" or an address.
  // Errors: kResourceExhausted (kEventReadersOfOneMax); kUnavailable (kEventReaderCountMax).
  absl::StatusOr<std::shared_ptr<EventQueue>> Subscribe(const std::string& reader);
  void Publish(const ServerEvent& event);
  size_t ReaderCount() const;
  // Sets the function that is called after events are published, on the publisher's thread; it must
  // be quick. An empty function removes it. When SetWake returns, no call of the old function is
  // running.
  void SetWake(std::function<void()> wake);

 private:
  mutable Mutex mutex_;
  struct Subscription {
    std::string reader;
    std::weak_ptr<EventQueue> queue;
  };
  std::vector<Subscription> subscriptions_ ABSL_GUARDED_BY(mutex_);
  std::function<void()> wake_ ABSL_GUARDED_BY(mutex_);
};

// "event: TYPE\ndata: JSON\n\n".
std::string EncodeEvent(const ServerEvent& event);

}  // namespace sheaf::coordinator
