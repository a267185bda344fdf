// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VolumePages: the pages of page files that are in memory, up to a number of bytes. A page is read
// when it is pinned, and stays while it is; pages without pins make room for others, by the
// clock algorithm. A page is a function of its file, so images do not depend on the limit.
//
// Source: Corbato 1968, "A paging experiment with the Multics system" (clock).
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/volume/volume_grid.h"

namespace sheaf::volume {

// The source of pages.
class PageReader {
 public:
  virtual ~PageReader() = default;
  // Fills `out` with the page, verified, and returns the number of bytes read from the file.
  // Thread safety: any number of threads.
  virtual absl::StatusOr<uint64_t> ReadPage(uint32_t place, std::span<std::byte> out) const = 0;
};

struct PageSlot {
  Index3 key{};        // The page's position.
  uint32_t place = 0;  // In its grid's table.
  uint32_t bytes = 0;  // In memory.
  // Resident, used since the clock came by, and the number of pins.
  std::atomic<uint32_t> state{0};
  std::byte* data = nullptr;  // Valid while pinned.
};

// Work of this thread so far, or of all threads.
struct PageCounts {
  uint64_t pages_read = 0, bytes_read = 0;
  uint64_t waits = 0;  // For a page that another thread was reading.
  // Pages that made room for others, and pages that were pinned; all threads' alone.
  uint64_t pages_evicted = 0, pages_pinned = 0;
  friend PageCounts operator-(const PageCounts& a, const PageCounts& b) {
    return {a.pages_read - b.pages_read, a.bytes_read - b.bytes_read, a.waits - b.waits,
            a.pages_evicted - b.pages_evicted, a.pages_pinned - b.pages_pinned};
  }
  PageCounts& operator+=(const PageCounts& b) {
    pages_read += b.pages_read;
    bytes_read += b.bytes_read;
    waits += b.waits;
    pages_evicted += b.pages_evicted;
    pages_pinned += b.pages_pinned;
    return *this;
  }
};

// Thread safety: members may be called concurrently.
class VolumePages {
 public:
  static constexpr uint64_t kBytesMaxDefault = uint64_t{512} << 20;

  explicit VolumePages(uint64_t bytes_max) : bytes_max_(bytes_max) {}
  // Requires: nothing is pinned, and all slots are forgotten.
  ~VolumePages() = default;
  VolumePages(const VolumePages&) = delete;
  VolumePages& operator=(const VolumePages&) = delete;

  // The page's bytes until Unpin, read if they are not there. If they cannot be read they are zero,
  // and status() says why. Pinned pages count, and may exceed the limit.
  const std::byte* Pin(const PageReader& reader, PageSlot* slot) {
    uint32_t state = slot->state.load(std::memory_order_acquire);
    while ((state & kResident) != 0) {
      if (slot->state.compare_exchange_weak(state, (state | kUsed) + 1,
                                            std::memory_order_acquire)) {
        return slot->data;
      }
    }
    return PinAbsent(reader, slot);
  }
  static void Unpin(PageSlot* slot) { slot->state.fetch_sub(1, std::memory_order_release); }

  // Counts pins, which Pin does not.
  void CountPins(uint64_t count);

  // Frees the pages of these slots. Requires: none is pinned.
  void Forget(std::span<PageSlot> slots);
  // Counts memory that volumes take beside pages: it leaves less for these, but a quarter.
  void AddOtherBytes(uint64_t bytes) { other_bytes_ += bytes; }

  uint64_t bytes_max() const { return bytes_max_; }
  uint64_t page_bytes() const { return page_bytes_; }
  // The first error of reading a page.
  absl::Status status() const;
  PageCounts counts() const;
  static PageCounts CountsOfThread();

 private:
  static constexpr uint32_t kResident = 1u << 31, kUsed = 1u << 30;
  static constexpr size_t kShards = 64;
  // Pages that the clock looks at in a shard before it turns to the next.
  static constexpr size_t kLooksMax = 256;

  struct Shard {
    Mutex mutex;
    std::vector<PageSlot*> resident ABSL_GUARDED_BY(mutex);
    size_t hand ABSL_GUARDED_BY(mutex) = 0;
  };
  // The memory of a page, freed by free(3).
  struct Freed {
    void operator()(std::byte* p) const;
  };
  using Buffer = std::unique_ptr<std::byte[], Freed>;

  Shard& ShardOf(const PageSlot* slot);
  uint64_t PageBytesMax() const;
  const std::byte* PinAbsent(const PageReader& reader, PageSlot* slot);
  // Evicts pages until all fit; returns one's memory if it has the size of `slot`.
  Buffer MakeRoom(const PageSlot& slot);
  // Takes a page that is not pinned out of the shard. False if there is none.
  bool Evict(Shard* shard, Buffer* buffer, uint32_t* bytes);

  const uint64_t bytes_max_;
  std::atomic<uint64_t> other_bytes_{0}, page_bytes_{0};
  std::atomic<uint64_t> pages_read_{0}, bytes_read_{0}, waits_{0}, pages_evicted_{0};
  // Pins by a number of the thread, so that threads seldom write to the same line of memory.
  struct alignas(64) PinCount {
    std::atomic<uint64_t> pins{0};
  };
  std::array<PinCount, 16> pin_counts_;
  std::atomic<size_t> next_shard_{0};
  std::array<Shard, kShards> shards_;
  mutable Mutex mutex_;
  absl::Status status_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::volume
