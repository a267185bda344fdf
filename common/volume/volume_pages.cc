// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/volume_pages.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <utility>

#include "common/base/check.h"

namespace sheaf::volume {
namespace {

// Sizes in steps, so that the memory of one page fits most others.
constexpr size_t kBytesStep = size_t{1} << 10;
constexpr size_t kAlignment = 64;
// The part of the limit that is left to the gaps between pages of different sizes.
constexpr uint64_t kGapsShare = 16;

size_t Rounded(size_t bytes) { return (bytes + kBytesStep - 1) / kBytesStep * kBytesStep; }

thread_local PageCounts counts_of_thread;

}  // namespace

void VolumePages::Freed::operator()(std::byte* p) const { std::free(p); }

VolumePages::Shard& VolumePages::ShardOf(const PageSlot* slot) {
  // Neighbors in the table are read together: they go to different shards.
  return shards_[slot->place % kShards];
}

uint64_t VolumePages::PageBytesMax() const {
  const uint64_t other = std::min(other_bytes_.load(std::memory_order_relaxed), bytes_max_);
  return std::max(bytes_max_ / 4, bytes_max_ - other) / kGapsShare * (kGapsShare - 1);
}

bool VolumePages::Evict(Shard* shard, Buffer* buffer, uint32_t* bytes) {
  const MutexLock lock(&shard->mutex);
  std::vector<PageSlot*>& resident = shard->resident;
  const size_t looks = std::min(2 * resident.size(), kLooksMax);
  for (size_t i = 0; i < looks; ++i) {
    if (shard->hand >= resident.size()) shard->hand = 0;
    PageSlot* slot = resident[shard->hand];
    uint32_t state = slot->state.load(std::memory_order_relaxed);
    if (state == (kResident | kUsed)) {
      slot->state.fetch_and(~kUsed, std::memory_order_relaxed);
    } else if (state == kResident &&
               slot->state.compare_exchange_strong(state, 0, std::memory_order_acq_rel)) {
      buffer->reset(std::exchange(slot->data, nullptr));
      *bytes = slot->bytes;
      resident[shard->hand] = resident.back();
      resident.pop_back();
      return true;
    }
    ++shard->hand;
  }
  return false;
}

VolumePages::Buffer VolumePages::MakeRoom(const PageSlot& slot) {
  Buffer fitting;
  size_t failures = 0;
  // If all pages of all shards are pinned, the limit is exceeded.
  while (page_bytes_.load(std::memory_order_relaxed) > PageBytesMax() && failures < 2 * kShards) {
    const size_t at = next_shard_.fetch_add(1, std::memory_order_relaxed) % kShards;
    Buffer evicted;
    uint32_t bytes = 0;
    if (!Evict(&shards_[at], &evicted, &bytes)) {
      ++failures;
      continue;
    }
    page_bytes_ -= Rounded(bytes);
    ++pages_evicted_;
    if (Rounded(bytes) == Rounded(slot.bytes)) fitting = std::move(evicted);
  }
  return fitting;
}

const std::byte* VolumePages::PinAbsent(const PageReader& reader, PageSlot* slot) {
  page_bytes_ += Rounded(slot->bytes);
  Buffer buffer = MakeRoom(*slot);
  Shard& shard = ShardOf(slot);
  const MutexLock lock(&shard.mutex);
  if ((slot->state.load(std::memory_order_acquire) & kResident) != 0) {
    // Another thread read it meanwhile. It stays while the shard is locked.
    slot->state.fetch_add(1, std::memory_order_acquire);
    page_bytes_ -= Rounded(slot->bytes);
    ++waits_;
    ++counts_of_thread.waits;
    return slot->data;
  }
  if (buffer == nullptr) {
    buffer.reset(static_cast<std::byte*>(std::aligned_alloc(kAlignment, Rounded(slot->bytes))));
    SHEAF_CHECK(buffer != nullptr);
  }
  const absl::StatusOr<uint64_t> read =
      reader.ReadPage(slot->place, std::span(buffer.get(), slot->bytes));
  if (!read.ok()) {
    std::memset(buffer.get(), 0, slot->bytes);
    const MutexLock status_lock(&mutex_);
    if (status_.ok()) status_ = read.status();
  } else {
    ++pages_read_;
    bytes_read_ += *read;
    ++counts_of_thread.pages_read;
    counts_of_thread.bytes_read += *read;
  }
  slot->data = buffer.release();
  slot->state.store(kResident | kUsed | 1, std::memory_order_release);
  shard.resident.push_back(slot);
  return slot->data;
}

void VolumePages::Forget(std::span<PageSlot> slots) {
  if (slots.empty()) return;
  const std::less<const PageSlot*> before;
  const PageSlot *first = slots.data(), *last = first + slots.size() - 1;
  for (Shard& shard : shards_) {
    const MutexLock lock(&shard.mutex);
    std::erase_if(shard.resident, [&](PageSlot* slot) {
      if (before(slot, first) || before(last, slot)) return false;
      page_bytes_ -= Rounded(slot->bytes);
      const Buffer freed(std::exchange(slot->data, nullptr));
      slot->state = 0;
      return true;
    });
  }
}

absl::Status VolumePages::status() const {
  const MutexLock lock(&mutex_);
  return status_;
}

void VolumePages::CountPins(uint64_t count) {
  static std::atomic<size_t> threads{0};
  thread_local const size_t thread = threads++;
  pin_counts_[thread % pin_counts_.size()].pins.fetch_add(count, std::memory_order_relaxed);
}

PageCounts VolumePages::counts() const {
  PageCounts counts{pages_read_, bytes_read_, waits_, pages_evicted_, 0};
  for (const PinCount& count : pin_counts_) counts.pages_pinned += count.pins;
  return counts;
}

PageCounts VolumePages::CountsOfThread() { return counts_of_thread; }

}  // namespace sheaf::volume
