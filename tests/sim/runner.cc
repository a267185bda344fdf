// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/runner.h"

#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <new>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"

namespace sheaf::sim {
namespace {

constexpr time_t kSeedSecondsMax = 30;  // CPU time. A simulation that takes longer hangs.
constexpr size_t kBrokenBytesMax = 500;
constexpr char kBrokenMark[] = "BROKEN-SEED: ";
constexpr uint64_t kNoSeed = UINT64_MAX;

// The memory that the processes of a run share.
struct Shared {
  std::atomic<uint64_t> next_seed, seed_count, step_count;
  std::atomic<uint64_t> jobs_succeeded, jobs_failed, jobs_cancelled, lives;
  std::atomic<uint64_t> liars_found, false_images;
  std::array<std::atomic<uint64_t>, kFaultCount> faults;
  std::atomic<size_t> failed_count;
  struct Failed {
    uint64_t seed;
    char broken[kBrokenBytesMax];
  };
  std::array<Failed, kFailedSeedsMax> failed;
  std::array<std::atomic<uint64_t>, 64> seed_of_process;
};

// Ends this process where it takes more CPU time than a simulation may.
void LimitSeedTime() {
  itimerval limit{};
  limit.it_value.tv_sec = kSeedSecondsMax;
  ::setitimer(ITIMER_PROF, &limit, nullptr);
}

void NoteFailed(Shared* shared, uint64_t seed, const std::string& broken) {
  const size_t index = shared->failed_count.fetch_add(1);
  if (index >= kFailedSeedsMax) return;
  shared->failed[index].seed = seed;
  broken.copy(shared->failed[index].broken, kBrokenBytesMax - 1);
}

void NoteResult(Shared* shared, uint64_t seed, const SimulationResult& result) {
  ++shared->seed_count;
  shared->step_count += result.step_count;
  shared->jobs_succeeded += result.jobs_succeeded;
  shared->jobs_failed += result.jobs_failed;
  shared->jobs_cancelled += result.jobs_cancelled;
  shared->lives += result.lives;
  shared->liars_found += result.liars_found;
  shared->false_images += result.false_images;
  for (size_t i = 0; i < kFaultCount; ++i) shared->faults[i] += result.faults[i];
  if (!result.broken.empty()) NoteFailed(shared, seed, result.broken);
}

[[noreturn]] void WorkThroughSeeds(Shared* shared, size_t process, uint64_t last, size_t failed_max,
                                   SimulationOptions options) {
  while (shared->failed_count < failed_max) {
    options.seed = shared->next_seed++;
    if (options.seed > last) break;
    shared->seed_of_process[process] = options.seed;
    LimitSeedTime();
    NoteResult(shared, options.seed, Simulation(options).Run());
    shared->seed_of_process[process] = kNoSeed;
  }
  ::_exit(0);
}

std::string WhyEnded(int status) {
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGPROF) {
    return absl::StrCat("the simulation takes longer than ", kSeedSecondsMax, " s of CPU time");
  }
  if (WIFSIGNALED(status)) return absl::StrCat("the process ended by signal ", WTERMSIG(status));
  return absl::StrCat("the process ended with exit code ", WEXITSTATUS(status));
}

Totals ToTotals(const Shared& shared) {
  Totals totals;
  totals.seed_count = shared.seed_count;
  totals.step_count = shared.step_count;
  totals.jobs_succeeded = shared.jobs_succeeded;
  totals.jobs_failed = shared.jobs_failed;
  totals.jobs_cancelled = shared.jobs_cancelled;
  totals.lives = shared.lives;
  totals.liars_found = shared.liars_found;
  totals.false_images = shared.false_images;
  for (size_t i = 0; i < kFaultCount; ++i) totals.faults[i] = shared.faults[i];
  for (size_t i = 0; i < std::min<size_t>(shared.failed_count, kFailedSeedsMax); ++i) {
    totals.failed.push_back({shared.failed[i].seed, shared.failed[i].broken});
  }
  std::sort(totals.failed.begin(), totals.failed.end(),
            [](const FailedSeed& a, const FailedSeed& b) { return a.seed < b.seed; });
  return totals;
}

std::string ReadAll(int descriptor) {
  std::string text;
  char buffer[1 << 16];
  for (ssize_t n = 0; (n = ::read(descriptor, buffer, sizeof buffer)) > 0;) {
    text.append(buffer, static_cast<size_t>(n));
  }
  return text;
}

}  // namespace

Totals RunSeeds(uint64_t first, uint64_t last, int process_count, size_t failed_max,
                const SimulationOptions& options) {
  void* memory =
      ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  SHEAF_CHECK(memory != MAP_FAILED);
  auto* shared = new (memory) Shared();
  shared->next_seed = first;
  std::map<pid_t, size_t> processes;
  const auto start = [&](size_t process) {
    shared->seed_of_process[process] = kNoSeed;
    std::fflush(nullptr);
    const pid_t child = ::fork();
    SHEAF_CHECK(child >= 0);
    if (child == 0) WorkThroughSeeds(shared, process, last, failed_max, options);
    processes[child] = process;
  };
  const auto count = std::min<size_t>(static_cast<size_t>(process_count), 64);
  for (size_t process = 0; process < count; ++process) start(process);
  while (!processes.empty()) {
    int status = 0;
    const pid_t child = ::wait(&status);
    if (child < 0) break;
    const size_t process = processes.at(child);
    processes.erase(child);
    const uint64_t seed = shared->seed_of_process[process];
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) continue;
    NoteFailed(shared, seed, WhyEnded(status));
    ++shared->seed_count;
    start(process);
  }
  Totals totals = ToTotals(*shared);
  rusage used{};
  ::getrusage(RUSAGE_CHILDREN, &used);
  totals.cpu_seconds = static_cast<double>(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                       1e-6 * static_cast<double>(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
  ::munmap(memory, sizeof(Shared));
  return totals;
}

IsolatedRun RunIsolated(const SimulationOptions& options) {
  int ends[2];
  SHEAF_CHECK(::pipe(ends) == 0);
  std::fflush(nullptr);
  const pid_t child = ::fork();
  SHEAF_CHECK(child >= 0);
  if (child == 0) {
    ::dup2(ends[1], STDERR_FILENO);
    ::close(ends[0]);
    LimitSeedTime();
    const SimulationResult result = Simulation(options).Run();
    if (!result.broken.empty()) {
      std::fprintf(stderr, "%s%s\n", kBrokenMark, result.broken.c_str());
    }
    ::_exit(0);
  }
  ::close(ends[1]);
  IsolatedRun run;
  run.output = ReadAll(ends[0]);
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) run.broken = WhyEnded(status);
  const size_t mark = run.output.rfind(kBrokenMark);
  if (mark != std::string::npos) {
    run.broken = run.output.substr(mark + sizeof kBrokenMark - 1);
    run.broken.resize(run.broken.find('\n'));
    run.output.resize(mark);
  }
  return run;
}

SimulationOptions Shorten(SimulationOptions options) {
  const auto fails = [](const SimulationOptions& tried) {
    return !RunIsolated(tried).broken.empty();
  };
  for (size_t kind = 0; kind < kFaultCount; ++kind) {
    SimulationOptions tried = options;
    tried.without |= uint32_t{1} << kind;
    if (tried.without != options.without && fails(tried)) options = tried;
  }
  // Not every shorter run fails, but one that does is good enough.
  uint64_t passes = 0;
  while (passes + 1 < options.steps) {
    SimulationOptions tried = options;
    tried.steps = passes + (options.steps - passes) / 2;
    if (fails(tried)) {
      options = tried;
    } else {
      passes = tried.steps;
    }
  }
  return options;
}

}  // namespace sheaf::sim
