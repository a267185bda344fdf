// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/simulation.h"

#include <algorithm>
#include <utility>

namespace sheaf::sim {
namespace {

using coordinator::Farm;
using coordinator::JobPhase;

constexpr absl::Duration kWorkerFaultInterval = absl::Seconds(1);
constexpr absl::Duration kFrozenMax = absl::Minutes(2);
constexpr absl::Duration kAwayMax = absl::Minutes(2);
constexpr absl::Duration kBackMax = absl::Seconds(30);
// After the faults have stopped, all jobs end within this time and this number of events.
constexpr absl::Duration kEndMax = absl::Minutes(40);
constexpr uint64_t kEndEventsMax = 400'000;
constexpr uint64_t kEndCheckInterval = 20;  // Events.
constexpr size_t kHonestWorkersAtEnd = 3;
// Two take the same tasks, so that no hedge is left but the further ones.
constexpr size_t kHoardersAtEnd = 2;
constexpr int32_t kHoardedThreads = 64;
// How many of the workers make false pixels at all, where there are any that do.
constexpr double kBrokenWorkerFraction = 0.4;

// Faults after which a job may fail: each spends a budget of failures (limits.h).
constexpr Fault kCostlyFaults[] = {Fault::kTaskFailed,   Fault::kWorkerLies,   Fault::kFalsePixels,
                                   Fault::kWorkerKilled, Fault::kWorkerFrozen, Fault::kStranger,
                                   Fault::kWorkerSlow,   Fault::kRequestLost,  Fault::kLate};

bool HasLiars(Farm& farm) {
  const MutexLock lock(&farm.tables().mutex);
  return !farm.tables().liars.empty();
}

}  // namespace

Simulation::Simulation(const SimulationOptions& options)
    : options_(options),
      world_(options.seed, options.without, options.trace),
      promises_([this](const std::string& what) { world_.Broken(what); }),
      host_(&world_, &promises_),
      network_(&world_, &host_),
      checks_(&world_, &promises_),
      stranger_(&world_, &network_) {
  // Drawn from nothing, so that seeds without deliveries stay what they were.
  world_.offers_deliveries = options.seed % 2 == 0;
  host_.set_after_call([this](Farm& farm) { checks_.Check(farm, host_.options()); });
  host_.set_interleaved([this](Farm& farm) { InterleaveCall(farm); });
}

void Simulation::AddWorker(bool may_lie) {
  SimWorker::Habits habits;
  habits.thread_count = static_cast<int32_t>(1 + world_.random.Below(2));
  if (world_.faults.Happens(Fault::kWorkerSlow)) habits.slowness = 30;
  habits.lies = may_lie && world_.random.Chance(0.4);
  habits.makes_false_pixels =
      may_lie && world_.faults.random(Fault::kFalsePixels).Chance(kBrokenWorkerFraction);
  if (may_lie && world_.faults.Happens(Fault::kWorkerHoards)) {
    habits.hoards = true;
    habits.thread_count = kHoardedThreads;
  }
  if (may_lie && world_.random.Chance(0.2)) {
    habits.identity = absl::StrCat("owner ", world_.random.Below(2));
  }
  StartWorker(habits);
}

void Simulation::StartWorker(const SimWorker::Habits& habits) {
  workers_.push_back(std::make_shared<SimWorker>(&world_, &network_, &promises_,
                                                 absl::StrCat("w", ++worker_count_), habits));
  world_.Trace(workers_.back()->id(), " starts");
  workers_.back()->Start();
}

void Simulation::MeetWorkerFaults() {
  if (world_.faults.stopped()) return;
  world_.After(kWorkerFaultInterval, [this] { MeetWorkerFaults(); });
  if (world_.faults.Happens(Fault::kStranger)) stranger_.Send();
  for (size_t i = 0; i < workers_.size(); ++i) {
    SimWorker& worker = *workers_[i];
    if (!worker.IsAlive()) continue;
    if (world_.faults.Happens(Fault::kWorkerFrozen)) {
      world_.Trace(worker.id(), " freezes");
      worker.Freeze(world_.faults.random(Fault::kWorkerFrozen).Between({}, kFrozenMax));
    }
    if (world_.faults.Happens(Fault::kWorkerAway)) {
      world_.Trace(worker.id(), " is away");
      worker.GoAway(world_.faults.random(Fault::kWorkerAway).Between({}, kAwayMax));
    }
    if (!world_.faults.Happens(Fault::kWorkerKilled)) continue;
    Random& random = world_.faults.random(Fault::kWorkerKilled);
    if (random.Chance(0.3)) {
      world_.Trace(worker.id(), " is told to stop");
      worker.Drain();
    } else {
      world_.Trace(worker.id(), " is killed");
      worker.Kill();
    }
    world_.After(random.Between({}, kBackMax), [this] { AddWorker(/*may_lie=*/true); });
  }
}

// Makes a call that another thread of the coordinator may make while a result is written.
void Simulation::InterleaveCall(Farm& farm) {
  Random& random = world_.faults.random(Fault::kInterleaved);
  std::vector<uint64_t> jobs;
  for (const auto& user : users_) {
    if (user->job_id()) jobs.push_back(*user->job_id());
  }
  const uint64_t kind = random.Below(4);
  world_.Trace("meanwhile: call ", kind);
  if (kind == 0 || jobs.empty()) {
    // That thread would wait for the end of the call under way, to remove results of liars.
    if (!HasLiars(farm)) farm.RunOnce();
    return;
  }
  const uint64_t job = jobs[random.Below(jobs.size())];
  if (kind == 1) farm.PauseJob(job).IgnoreError();
  if (kind == 2) farm.ResumeJob(job).IgnoreError();
  if (kind == 3 && random.Chance(0.2)) {
    for (const auto& user : users_) {
      if (user->job_id() == job) user->NoteCancelled();
    }
    world_.Trace("meanwhile: job ", job, " is cancelled");
    farm.CancelJob(job).IgnoreError();
  }
}

void Simulation::StopFaults() {
  world_.Trace("the faults stop");
  world_.faults.Stop();
  for (const auto& worker : workers_) {
    if (worker->habits().lies || worker->habits().slowness > 1) worker->Kill();
    worker->Freeze({});
    if (worker->IsAlive()) worker->ComeBack();
  }
  const size_t hoarders = world_.faults.Has(Fault::kWorkerHoards) ? kHoardersAtEnd : 0;
  for (size_t i = 0; i < hoarders; ++i) {
    StartWorker({.thread_count = kHoardedThreads, .hoards = true});
  }
  for (size_t i = 0; i < kHonestWorkersAtEnd; ++i) AddWorker(/*may_lie=*/false);
  for (const auto& user : users_) user->LetItEnd();
}

bool Simulation::HasEnded() {
  if (!host_.IsUp()) return false;
  const bool content = std::all_of(users_.begin(), users_.end(),
                                   [](const auto& user) { return user->is_content(); });
  return content && checks_.CheckEnd(*host_.farm());
}

void Simulation::CheckFailures(SimulationResult* result) {
  const MutexLock lock(&host_.farm()->tables().mutex);
  for (const auto& [id, job] : host_.farm()->tables().scheduler.jobs()) {
    result->jobs_succeeded += job.phase == JobPhase::kSucceeded ? 1 : 0;
    result->jobs_failed += job.phase == JobPhase::kFailed ? 1 : 0;
    result->jobs_cancelled += job.phase == JobPhase::kCancelled ? 1 : 0;
    const bool poisoned = std::any_of(job.frames.begin(), job.frames.end(), [&](const auto& frame) {
      return world_.poisoned_scenes.contains(frame.Spec().scene.sha256_hex);
    });
    const bool costly = std::any_of(std::begin(kCostlyFaults), std::end(kCostlyFaults),
                                    [&](Fault fault) { return world_.faults.count(fault) > 0; });
    if (job.phase == JobPhase::kFailed && !poisoned && !costly) {
      world_.Broken(absl::StrCat("job ", id, " failed without reason: ", job.failure));
    }
    const bool wanted = std::any_of(users_.begin(), users_.end(), [&](const auto& user) {
      return user->job_id() == id && user->has_cancelled();
    });
    if (job.phase == JobPhase::kCancelled && !wanted) {
      world_.Broken(absl::StrCat("job ", id, " is cancelled, although no user asked"));
    }
    if (job.phase == JobPhase::kSucceeded && poisoned) {
      world_.Broken(absl::StrCat("job ", id, " succeeded, although no worker can render it"));
    }
  }
}

SimulationResult Simulation::Run() {
  host_.Start();
  for (int64_t i = world_.random.Between(2, 5); i > 0; --i) AddWorker(/*may_lie=*/true);
  for (uint64_t i = 1 + world_.random.Below(4); i > 0; --i) {
    users_.push_back(std::make_shared<SimUser>(&world_, &network_, &promises_, i));
    users_.back()->Start();
  }
  MeetWorkerFaults();
  while (!world_.broken() && world_.step_count() < options_.steps) world_.RunNext();
  StopFaults();
  const absl::Duration end = world_.now() + kEndMax;
  const uint64_t last_event = world_.step_count() + kEndEventsMax;
  bool ended = false;
  while (!world_.broken() && !ended) {
    world_.RunNext();
    if (world_.step_count() % kEndCheckInterval == 0) ended = HasEnded();
    if (world_.now() > end || world_.step_count() > last_event) {
      world_.Broken("jobs have not ended long after the last fault");
    }
  }
  SimulationResult result;
  if (ended) CheckFailures(&result);
  result.broken = world_.WhatIsBroken();
  result.step_count = world_.step_count();
  result.lives = host_.life();
  result.liars_found = promises_.Liars().size();
  result.false_images = checks_.false_image_count();
  for (size_t i = 0; i < kFaultCount; ++i) {
    result.faults[i] = world_.faults.count(static_cast<Fault>(i));
  }
  return result;
}

}  // namespace sheaf::sim
