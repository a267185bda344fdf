// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// StartingRoom: the room for memory of a process that gives up /proc, by which FindMemoryRoom finds
// it.
#pragma once

#include <sys/resource.h>

#include <algorithm>
#include <cstdint>

#include "common/base/memory_room.h"

namespace sheaf::worker {

class StartingRoom {
 public:
  // Call before /proc is gone.
  StartingRoom() : room_(FindMemoryRoom()), resident_bytes_(ResidentBytesMax()) {}

  // The room at the start, less what this process has come to take since.
  MemoryRoom Left() const {
    MemoryRoom left = room_;
    if (left.bytes == UINT64_MAX) return left;
    // A process that was forked since begins with less.
    const uint64_t grown_bytes = std::max(ResidentBytesMax(), resident_bytes_) - resident_bytes_;
    left.bytes -= std::min(left.bytes, grown_bytes);
    return left;
  }

 private:
  // The most that was resident at any time so far.
  static uint64_t ResidentBytesMax() {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    return static_cast<uint64_t>(usage.ru_maxrss) << 10;
  }

  const MemoryRoom room_;
  const uint64_t resident_bytes_;
};

}  // namespace sheaf::worker
