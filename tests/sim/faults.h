// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Faults: which faults a simulation meets, and when. Each seed draws which kinds it has and how
// often, so that seeds differ in character ("swarm testing", Groce et al. 2012). Each kind has its
// own stream of random numbers: without one kind, the others come as before.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "tests/sim/random.h"

namespace sheaf::sim {

enum class Fault {
  kRequestLost,      // The coordinator never hears of it.
  kReplyLost,        // After the effect.
  kDoubled,          // A request arrives twice.
  kLate,             // By up to a minute, so that others overtake it.
  kUploadCut,        // An upload ends after some of its results.
  kProcessKilled,    // The coordinator's, at any change of the disk.
  kPowerLost,        // The same; what is not durable is lost.
  kStopped,          // The coordinator ends in order and starts again.
  kWriteFailed,      // EIO.
  kSyncFailed,       // EIO of fsync.
  kDiskFull,         // For seconds to minutes.
  kFileDamaged,      // A byte of a part or an image changes.
  kWallClockJumped,  // By up to a day, either way.
  kInterleaved,      // Another call while a result is between file and row.
  kWorkerKilled,
  kWorkerFrozen,  // As by SIGSTOP, for up to two minutes.
  kWorkerSlow,
  kTaskFailed,      // A worker reports that a lease failed.
  kWorkerLies,      // A part that is not what its description says.
  kFalsePixels,     // A part of wrong values that looks right, by a worker that has the habit.
  kStranger,        // Messages of a stranger, who is no worker of ours.
  kWorkerHoards,    // A worker that takes many leases, heartbeats, and delivers nothing.
  kWorkerAway,      // Its machine is its owner's, for up to two minutes.
  kVersionRefused,  // A worker's call is refused, as of a program of another version.
  kCount
};
inline constexpr size_t kFaultCount = static_cast<size_t>(Fault::kCount);
// "request-lost" and so on.
const char* FaultName(Fault fault);

class Faults {
 public:
  // without: a bit for each kind that is left out.
  Faults(uint64_t seed, uint32_t without);

  // Whether the fault happens now. Counts those that do.
  bool Happens(Fault fault);
  // Whether this seed has the fault at all.
  bool Has(Fault fault) const { return chances_[static_cast<size_t>(fault)] > 0; }
  // The fault's own random numbers, for what it does.
  Random& random(Fault fault) { return streams_[static_cast<size_t>(fault)]; }
  // None happens from now on.
  void Stop() { stopped_ = true; }
  bool stopped() const { return stopped_; }
  uint64_t count(Fault fault) const { return counts_[static_cast<size_t>(fault)]; }

 private:
  std::array<double, kFaultCount> chances_{};
  std::array<Random, kFaultCount> streams_;
  std::array<uint64_t, kFaultCount> counts_{};
  bool stopped_ = false;
};

}  // namespace sheaf::sim
