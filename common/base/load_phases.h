// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PhaseTimer: where the time of loading a scene goes. The code that loads holds one while it is in
// a phase; LoadTimesNow sums them up for the whole process. A timer costs two readings of clocks.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace sheaf {

// In the order in which an image comes about.
enum class LoadPhase : uint8_t {
  kProgram,     // From the start of the process to its first line: dynamic linking.
  kRead,        // Scene files, without those of meshes.
  kMeshes,      // Files of meshes.
  kTechniques,  // Small images by which techniques are chosen.
  kDigests,     // SHA-256 of the files.
  kCheck,       // CheckScene: what can be compiled without the ray tracer.
  kFarm,        // Start of coordinator and worker.
  kStore,       // Files into the coordinator's store.
  kFetch,       // Files out of it, verified.
  kTables,      // Camera, filter, interiors and other small tables.
  kGeometry,    // Displacement, and vertices in render space.
  kMaterials,   // With the tables of their scattering.
  kImages,      // Images of textures and lights.
  kLights,      // Light tree, environments, emission.
  kMedia,       // Volumes and their bounds.
  kTracer,      // Embree's trees.
  kTraining,    // Guiding and learned lights.
  kSamples,     // Tasks, with the encoding of their parts.
  kResults,     // Parts checked, stored and merged.
  kDelivery,    // Merged tiles into the image, and its file.
};
inline constexpr size_t kLoadPhaseCount = static_cast<size_t>(LoadPhase::kDelivery) + 1;
// "meshes".
const char* LoadPhaseName(LoadPhase phase);

// The CPU time that a phase counts: that of the calling thread, or of all threads of the process,
// where the phase hands its work to others. Two phases of the latter kind at once count each other.
enum class PhaseCpu : uint8_t { kThread, kProcess };
// Phases within a phase are phases of their own, whose time it lacks, or parts of it.
enum class PhaseExtent : uint8_t { kOwn, kWhole };

// Measures from its construction to its destruction, which are on one thread in the order of a
// stack. Thread safety: any number of threads at once.
class PhaseTimer {
 public:
  explicit PhaseTimer(LoadPhase phase, PhaseCpu cpu = PhaseCpu::kThread,
                      PhaseExtent extent = PhaseExtent::kOwn);
  ~PhaseTimer();
  PhaseTimer(const PhaseTimer&) = delete;
  PhaseTimer& operator=(const PhaseTimer&) = delete;

 private:
  void Begin();
  void End();

  const LoadPhase phase_;
  const PhaseCpu cpu_;
  const PhaseExtent extent_;
  PhaseTimer* const outer_;  // The thread's timer that rests meanwhile; may be null.
  const bool is_part_;       // A timer within PhaseExtent::kWhole, which measures nothing.
  double cpu_begin_seconds_ = 0;
};

struct PhaseTime {
  double wall_seconds = 0;  // While any thread was in the phase.
  double cpu_seconds = 0;
  uint64_t count = 0;  // Timers.
};
struct ProcessTime {
  double wall_seconds = 0;  // Since the process started; to 0.01 s.
  double cpu_seconds = 0;   // All its threads.
};
struct LoadTimes {
  std::array<PhaseTime, kLoadPhaseCount> phases;
  double covered_wall_seconds = 0;  // While any thread was in any phase.
  ProcessTime process;
  ProcessTime first_sample;  // When the first task began; 0: none has.

  const PhaseTime& Of(LoadPhase phase) const { return phases[static_cast<size_t>(phase)]; }
  double OverlapWallSeconds() const;  // Counted by more than one phase.
  double OtherWallSeconds() const;    // While no thread was in a phase.
  // The CPU time of no phase; below 0 where phases of PhaseCpu::kProcess counted each other's.
  double OtherCpuSeconds() const;
};
// Those of the process until now. Phases that have not ended count up to their last pause.
LoadTimes LoadTimesNow();

// Counts the time until now as LoadPhase::kProgram. Called in the first line of main.
void NoteProgramStart();

}  // namespace sheaf
