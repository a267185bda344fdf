// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ParallelRanges: a loop divided into ranges that threads process. For results that do not depend
// on the assignment of ranges to threads: every range writes only its own elements.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace sheaf {

// Calls function(begin, end) for disjoint ranges of at most grain that cover [0, count), from up to
// thread_count threads including the caller; returns when all are done. Uses fewer threads if some
// cannot be created. Rethrows exceptions of function (lack of memory).
// Requires: grain >= 1, thread_count >= 1.
template <typename Function>
void ParallelRanges(uint64_t count, uint64_t grain, int thread_count, const Function& function) {
  std::atomic<uint64_t> next{0};
  std::atomic<bool> failed{false};
  std::once_flag first;
  std::exception_ptr failure;
  const auto work = [&] {
    try {
      while (!failed) {
        const uint64_t begin = next.fetch_add(grain);
        if (begin >= count) return;
        function(begin, std::min(count, begin + grain));
      }
    } catch (...) {
      std::call_once(first, [&] { failure = std::current_exception(); });
      failed = true;
    }
  };
  const uint64_t ranges = count / grain + (count % grain != 0);
  {
    std::vector<std::jthread> threads;
    try {
      for (uint64_t i = 1; i < std::min<uint64_t>(static_cast<uint64_t>(thread_count), ranges);
           ++i) {
        threads.emplace_back(work);
      }
    } catch (const std::system_error&) {
    }
    work();
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace sheaf
