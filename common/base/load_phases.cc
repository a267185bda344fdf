// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/load_phases.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <ctime>

#include "common/base/mutex.h"

namespace sheaf {
namespace {

constexpr const char* kLoadPhaseNames[kLoadPhaseCount] = {
    "program", "read",       "meshes",   "techniques", "digests",   "check",   "farm",
    "store",   "fetch",      "tables",   "geometry",   "materials", "images",  "lights",
    "media",   "ray tracer", "training", "samples",    "results",   "delivery"};

double ClockSeconds(clockid_t clock) {
  timespec now{};
  if (clock_gettime(clock, &now) != 0) return 0;
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double CpuSeconds(PhaseCpu of) {
  return ClockSeconds(of == PhaseCpu::kThread ? CLOCK_THREAD_CPUTIME_ID : CLOCK_PROCESS_CPUTIME_ID);
}

// Since the boot; 0 where /proc does not say: man 5 proc_pid_stat, field 22.
double ProcessStartSeconds() {
  char text[1024] = {};
  std::FILE* const file = std::fopen("/proc/self/stat", "re");
  if (file == nullptr) return 0;
  const size_t size = std::fread(text, 1, sizeof text - 1, file);
  std::fclose(file);
  text[size] = '\0';
  const char* const name_end = std::strrchr(text, ')');  // A name may have spaces.
  unsigned long long ticks = 0;
  constexpr char kUpToStart[] =
      ") %*c %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %llu";
  if (name_end == nullptr || std::sscanf(name_end, kUpToStart, &ticks) != 1) return 0;
  return static_cast<double>(ticks) / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

ProcessTime ProcessTimeNow() {
  static const double start_seconds = ProcessStartSeconds();
  const double cpu_seconds = CpuSeconds(PhaseCpu::kProcess);
  return {std::max(0.0, ClockSeconds(CLOCK_BOOTTIME) - start_seconds), cpu_seconds};
}

// While at least one thread is inside.
struct SharedClock {
  int inside = 0;
  double since_seconds = 0, sum_seconds = 0;

  void Enter(double now_seconds) {
    if (inside++ == 0) since_seconds = now_seconds;
  }
  void Leave(double now_seconds) {
    if (--inside == 0) sum_seconds += now_seconds - since_seconds;
  }
};

class PhaseTable {
 public:
  void Enter(LoadPhase phase) {
    const MutexLock lock(&mutex_);
    const double now_seconds = ClockSeconds(CLOCK_MONOTONIC);
    walls_[static_cast<size_t>(phase)].Enter(now_seconds);
    any_.Enter(now_seconds);
    if (phase == LoadPhase::kSamples && times_.first_sample.wall_seconds == 0) {
      times_.first_sample = ProcessTimeNow();
    }
  }
  void Leave(LoadPhase phase, double cpu_seconds) {
    const MutexLock lock(&mutex_);
    const double now_seconds = ClockSeconds(CLOCK_MONOTONIC);
    walls_[static_cast<size_t>(phase)].Leave(now_seconds);
    any_.Leave(now_seconds);
    times_.phases[static_cast<size_t>(phase)].cpu_seconds += cpu_seconds;
  }
  void Count(LoadPhase phase) {
    const MutexLock lock(&mutex_);
    ++times_.phases[static_cast<size_t>(phase)].count;
  }
  void SetProgram(const ProcessTime& time) {
    const MutexLock lock(&mutex_);
    times_.phases[static_cast<size_t>(LoadPhase::kProgram)] = {time.wall_seconds, time.cpu_seconds,
                                                               1};
  }
  LoadTimes Now() {
    const MutexLock lock(&mutex_);
    LoadTimes now = times_;
    const double program_seconds = now.Of(LoadPhase::kProgram).wall_seconds;
    for (size_t i = 0; i < kLoadPhaseCount; ++i) {
      now.phases[i].wall_seconds += walls_[i].sum_seconds;
    }
    now.covered_wall_seconds = any_.sum_seconds + program_seconds;
    now.process = ProcessTimeNow();
    return now;
  }

 private:
  Mutex mutex_;
  std::array<SharedClock, kLoadPhaseCount> walls_ ABSL_GUARDED_BY(mutex_);
  SharedClock any_ ABSL_GUARDED_BY(mutex_);
  LoadTimes times_ ABSL_GUARDED_BY(mutex_);  // Without wall times, but for kProgram.
};

PhaseTable& Table() {
  static PhaseTable* const table = new PhaseTable();  // Threads may outlive static objects.
  return *table;
}

thread_local PhaseTimer* innermost_timer = nullptr;

}  // namespace

const char* LoadPhaseName(LoadPhase phase) { return kLoadPhaseNames[static_cast<size_t>(phase)]; }

PhaseTimer::PhaseTimer(LoadPhase phase, PhaseCpu cpu, PhaseExtent extent)
    : phase_(phase),
      cpu_(cpu),
      extent_(extent),
      outer_(innermost_timer),
      is_part_(outer_ != nullptr && (outer_->is_part_ || outer_->extent_ == PhaseExtent::kWhole)) {
  innermost_timer = this;
  if (is_part_) return;
  Table().Count(phase_);
  if (outer_ != nullptr) outer_->End();
  Begin();
}

PhaseTimer::~PhaseTimer() {
  innermost_timer = outer_;
  if (is_part_) return;
  End();
  if (outer_ != nullptr) outer_->Begin();
}

void PhaseTimer::Begin() {
  cpu_begin_seconds_ = CpuSeconds(cpu_);
  Table().Enter(phase_);
}

void PhaseTimer::End() { Table().Leave(phase_, CpuSeconds(cpu_) - cpu_begin_seconds_); }

double LoadTimes::OverlapWallSeconds() const {
  double sum_seconds = 0;
  for (const PhaseTime& phase : phases) sum_seconds += phase.wall_seconds;
  return std::max(0.0, sum_seconds - covered_wall_seconds);
}

double LoadTimes::OtherWallSeconds() const {
  return std::max(0.0, process.wall_seconds - covered_wall_seconds);
}

double LoadTimes::OtherCpuSeconds() const {
  double sum_seconds = 0;
  for (const PhaseTime& phase : phases) sum_seconds += phase.cpu_seconds;
  return process.cpu_seconds - sum_seconds;
}

LoadTimes LoadTimesNow() { return Table().Now(); }

void NoteProgramStart() { Table().SetProgram(ProcessTimeNow()); }

}  // namespace sheaf
