// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/chunk_cutter.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>

#include "common/base/digest.h"
#include "common/base/status.h"
#include "common/content/file_descriptor.h"

namespace sheaf {
namespace {

// A chunk ends where the upper bits of the hash are zero: more bits before the average length than
// behind it, so that lengths gather around the average.
constexpr int kBitsBefore = 22, kBitsBehind = 18;
constexpr uint64_t UpperBits(int count) { return ~uint64_t{0} << (64 - count); }

// One random number for each byte, by SplitMix64 (Steele et al. 2014, "Fast splittable pseudorandom
// number generators"). Other numbers would cut everywhere else: they stay.
constexpr std::array<uint64_t, 256> MakeGear() {
  std::array<uint64_t, 256> gear{};
  uint64_t state = 0x5368656166;
  for (uint64_t& number : gear) {
    state += 0x9e3779b97f4a7c15;
    uint64_t z = state;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    number = z ^ (z >> 31);
  }
  return gear;
}
constexpr std::array<uint64_t, 256> kGear = MakeGear();

// Continues at position *at with the hash; whether a chunk ends before `end`, then at *at.
bool FindEnd(std::string_view bytes, size_t end, uint64_t mask, size_t* at, uint64_t* hash) {
  uint64_t h = *hash;
  for (size_t i = *at; i < end; ++i) {
    h = (h << 1) + kGear[static_cast<unsigned char>(bytes[i])];
    if ((h & mask) != 0) continue;
    *at = i + 1;
    return true;
  }
  *at = end;
  *hash = h;
  return false;
}

}  // namespace

size_t ChunkLength(std::string_view bytes) {
  if (bytes.size() <= kChunkBytesMin) return bytes.size();
  const size_t end = std::min<size_t>(bytes.size(), kChunkBytesMax);
  const size_t middle = std::min<size_t>(end, kChunkBytesAverage);
  size_t at = kChunkBytesMin;
  uint64_t hash = 0;
  if (FindEnd(bytes, middle, UpperBits(kBitsBefore), &at, &hash)) return at;
  FindEnd(bytes, end, UpperBits(kBitsBehind), &at, &hash);
  return at;
}

absl::StatusOr<ChunkList> CutFile(const std::string& path) {
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.ok()) return StatusFromErrno(errno, path);
  ChunkList list;
  Sha256 whole;
  std::string buffer(4 * size_t{kChunkBytesMax}, '\0');
  size_t begin = 0, end = 0;
  bool at_end = false;
  while (true) {
    if (end - begin < kChunkBytesMax && !at_end) {
      std::copy(buffer.begin() + static_cast<std::ptrdiff_t>(begin),
                buffer.begin() + static_cast<std::ptrdiff_t>(end), buffer.begin());
      end -= begin;
      begin = 0;
      while (end < buffer.size() && !at_end) {
        const ssize_t n = ::read(file.get(), buffer.data() + end, buffer.size() - end);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return StatusFromErrno(errno, path);
        at_end = n == 0;
        end += static_cast<size_t>(n);
      }
    }
    const std::string_view rest = std::string_view(buffer).substr(begin, end - begin);
    if (rest.empty()) break;
    const std::string_view chunk = rest.substr(0, ChunkLength(rest));
    whole.Update(chunk);
    list.chunks.push_back({Sha256Hex(chunk), chunk.size()});
    list.blob.size_bytes += chunk.size();
    begin += chunk.size();
  }
  list.blob.sha256_hex = whole.FinishHex();
  return list;
}

}  // namespace sheaf
