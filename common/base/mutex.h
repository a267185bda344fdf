// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Mutex, MutexLock and CondVar: std::mutex and its companions with the annotations of clang's
// thread safety analysis, which libstdc++ does not have. Members name the mutex that guards them
// (ABSL_GUARDED_BY) and functions name those that their callers hold
// (ABSL_EXCLUSIVE_LOCKS_REQUIRED); tests/tidy/thread_safety_test.py has clang check both.
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/time/time.h"

namespace sheaf {

class ABSL_LOCKABLE Mutex {
 public:
  Mutex() = default;
  Mutex(const Mutex&) = delete;
  Mutex& operator=(const Mutex&) = delete;

  void Lock() ABSL_EXCLUSIVE_LOCK_FUNCTION() { mutex_.lock(); }
  void Unlock() ABSL_UNLOCK_FUNCTION() { mutex_.unlock(); }

 private:
  friend class CondVar;
  std::mutex mutex_;
};

// Holds a mutex until it is destroyed, except between Unlock and Lock.
class ABSL_SCOPED_LOCKABLE MutexLock {
 public:
  explicit MutexLock(Mutex* mutex) ABSL_EXCLUSIVE_LOCK_FUNCTION(mutex) : mutex_(mutex) {
    mutex_->Lock();
  }
  ~MutexLock() ABSL_UNLOCK_FUNCTION() {
    if (held_) mutex_->Unlock();
  }
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

  void Lock() ABSL_EXCLUSIVE_LOCK_FUNCTION() {
    mutex_->Lock();
    held_ = true;
  }
  void Unlock() ABSL_UNLOCK_FUNCTION() {
    held_ = false;
    mutex_->Unlock();
  }

 private:
  Mutex* const mutex_;
  bool held_ = true;
};

// A condition that one mutex guards. Every wait takes a predicate, which is called with the mutex
// held; a lambda that reads guarded members is annotated with ABSL_EXCLUSIVE_LOCKS_REQUIRED. Waits
// release the mutex meanwhile and hold it again when they return.
class CondVar {
 public:
  void NotifyOne() { changed_.notify_one(); }
  void NotifyAll() { changed_.notify_all(); }

  // Waits until done() is true.
  template <typename Predicate>
  void Wait(Mutex* mutex, Predicate done)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex) ABSL_NO_THREAD_SAFETY_ANALYSIS {
    Held lock(mutex);
    changed_.wait(lock.get(), std::move(done));
  }
  // The same, at most for `timeout`. Returns done().
  template <typename Predicate>
  bool WaitFor(Mutex* mutex, absl::Duration timeout, Predicate done)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex) ABSL_NO_THREAD_SAFETY_ANALYSIS {
    Held lock(mutex);
    return changed_.wait_for(lock.get(), Bounded(timeout), std::move(done));
  }
  // The same, at most until a stop is requested. Returns done().
  template <typename Predicate>
  bool Wait(Mutex* mutex, std::stop_token stop, Predicate done)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex) ABSL_NO_THREAD_SAFETY_ANALYSIS {
    Held lock(mutex);
    return changed_.wait(lock.get(), std::move(stop), std::move(done));
  }
  template <typename Predicate>
  bool WaitFor(Mutex* mutex, std::stop_token stop, absl::Duration timeout, Predicate done)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex) ABSL_NO_THREAD_SAFETY_ANALYSIS {
    Held lock(mutex);
    return changed_.wait_for(lock.get(), std::move(stop), Bounded(timeout), std::move(done));
  }

 private:
  // The caller's lock in the form that the standard library waits with; it stays the caller's.
  class Held {
   public:
    explicit Held(Mutex* mutex) : lock_(mutex->mutex_, std::adopt_lock) {}
    ~Held() { lock_.release(); }
    std::unique_lock<std::mutex>& get() { return lock_; }

   private:
    std::unique_lock<std::mutex> lock_;
  };
  // The standard library adds timeouts to the time without a check for overflow.
  static std::chrono::nanoseconds Bounded(absl::Duration timeout) {
    return absl::ToChronoNanoseconds(std::min(timeout, absl::Hours(24 * 365)));
  }

  std::condition_variable_any changed_;
};

// Waits for `duration`, or until a stop is requested. Returns whether none was.
inline bool SleepUnlessStopped(absl::Duration duration, const std::stop_token& stop) {
  Mutex mutex;
  CondVar never;
  const MutexLock lock(&mutex);
  never.WaitFor(&mutex, stop, duration, [] { return false; });
  return !stop.stop_requested();
}

}  // namespace sheaf
