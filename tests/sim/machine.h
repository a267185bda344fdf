// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Machine: the simulated machine on which the coordinator runs: a steady clock, a wall clock and a
// disk. While a machine exists, it stands in for the functions of the C library that read clocks,
// and for those that work on files below /sim: this program defines them, so that SQLite, the
// standard library and our own code call them unchanged. All else goes to the system.
#pragma once

#include <cstdint>
#include <map>
#include <set>

#include "absl/time/time.h"
#include "tests/sim/random.h"
#include "tests/sim/sim_disk.h"

namespace sheaf::sim {

// The folder that is the machine's disk.
inline constexpr char kSimRoot[] = "/sim";
// Stands in for the system's random device; its bytes are always the same.
inline constexpr char kSimRandomDevice[] = "/sim/random";

class Machine {
 public:
  // The last one that was made is the current one, as long as it lives. seed: of the random bytes
  // that programs are given.
  explicit Machine(uint64_t seed);
  ~Machine();
  Machine(const Machine&) = delete;
  Machine& operator=(const Machine&) = delete;
  // Null where there is none.
  static Machine* Current();

  SimDisk& disk() { return disk_; }
  absl::Duration steady() const { return steady_; }
  // Advances both clocks.
  void Advance(absl::Duration duration) { steady_ += duration; }
  void JumpWallClock(absl::Duration by) { wall_offset_ += by; }
  absl::Duration wall() const { return steady_ + wall_offset_; }
  // For secrets: equal seeds give equal bytes.
  Random& random_bytes() { return random_bytes_; }

  // Open files and folders, as the functions of the C library see them: descriptors from
  // kFirstDescriptor on, so that they differ from the system's.
  static constexpr int kFirstDescriptor = 1 << 20;
  struct OpenFile {
    SimDisk::NodePtr node;
    uint64_t offset = 0;
    bool appends = false;
  };
  int AddDescriptor(OpenFile file);
  // Null where there is none.
  OpenFile* FindDescriptor(int descriptor);
  void RemoveDescriptor(int descriptor);
  // Memory that all mappings of this part of a file share. The file's bytes stay as they are.
  void* Map(const SimDisk::NodePtr& node, uint64_t offset, uint64_t size);
  // Whether Map returned the address and Unmap was not called yet.
  bool Unmap(const void* address);

 private:
  SimDisk disk_;
  Random random_bytes_;
  absl::Duration steady_ = absl::Hours(1);
  absl::Duration wall_offset_ = absl::Hours(24 * 365 * 50);
  std::map<int, OpenFile> files_;
  int next_descriptor_ = kFirstDescriptor;
  std::set<const void*> mapped_;
};

}  // namespace sheaf::sim
