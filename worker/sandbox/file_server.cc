// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/file_server.h"

namespace sheaf::worker {

bool FileServer::Ask(uint64_t ask_id, std::string name) {
  const MutexLock lock(&mutex_);
  if (queue_.size() >= kAskedFilesMax) return false;
  queue_.emplace_back(ask_id, std::move(name));
  if (queue_.size() > idle_threads_ && threads_.size() < kFilesOpenedAtOnceMax) {
    threads_.emplace_back([this](const std::stop_token& stop) { Work(stop); });
  }
  asked_.NotifyOne();
  return true;
}

void FileServer::Work(const std::stop_token& stop) {
  MutexLock lock(&mutex_);
  const auto is_asked = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return !queue_.empty(); };
  while (true) {
    ++idle_threads_;
    const bool more = asked_.Wait(&mutex_, stop, is_asked);
    --idle_threads_;
    if (!more || stop.stop_requested()) return;
    const auto [ask_id, name] = std::move(queue_.front());
    queue_.pop_front();
    lock.Unlock();
    absl::StatusOr<volume::FileBytes> file = open_(name, stop);
    if (!stop.stop_requested()) answer_(ask_id, std::move(file));
    lock.Lock();
  }
}

}  // namespace sheaf::worker
