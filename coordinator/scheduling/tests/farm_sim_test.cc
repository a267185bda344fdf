// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A whole farm in one thread: the real Scheduler, simulated workers, network, disk and time. One
// seed decides every fault: replies and uploads that are lost, late, doubled or out of order;
// workers that die and come back under another name; a coordinator that dies between a row and its
// acknowledgement and comes back with what its journal holds. After every step the checkers look.
#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "coordinator/scheduling/scheduler.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr char kSimulatedProfile[] = "simulated";
constexpr absl::Duration kStep = absl::Milliseconds(500);

struct SimWorker {
  std::string id;
  bool stopped = false;  // Killed; comes back under another name.
  std::vector<Lease> held;
  std::vector<Lease> unacknowledged;  // Rendered, not acknowledged: uploaded again.
};

struct SimFaults {
  double reply_lost = 0, upload_lost = 0, ack_lost = 0, upload_doubled = 0, upload_late = 0;
  double worker_dies = 0, coordinator_dies = 0, released = 0, infrastructure = 0;
};

class FarmSim {
 public:
  FarmSim(uint64_t seed, const SimFaults& faults, int worker_count, std::vector<JobSpec> jobs)
      : random_(seed), faults_(faults), jobs_(std::move(jobs)) {
    StartCoordinator();
    for (int i = 0; i < worker_count; ++i) workers_.push_back({NewWorkerId(), false, {}, {}});
  }

  // Runs to the end of all jobs. Returns how many steps it took, or -1 where it did not end.
  int Run(int steps_max) {
    for (int step = 0; step < steps_max; ++step) {
      if (AllEnded()) return step;
      now_ += kStep;
      for (SimWorker& worker : workers_) StepWorker(&worker);
      DeliverArrivals();
      DeliverFrames();
      if (Happens(faults_.coordinator_dies)) StartCoordinator();
      CheckLeases();
    }
    return -1;
  }

  const Scheduler& scheduler() const { return *scheduler_; }
  int lives() const { return lives_; }

  // Every sample of every cell of every frame was merged once.
  void CheckComplete() const {
    for (const JobSpec& job : jobs_) {
      EXPECT_EQ(scheduler_->jobs().at(job.job_id).phase, JobPhase::kSucceeded)
          << scheduler_->jobs().at(job.job_id).failure;
      for (const FrameSpec& frame : job.frames) {
        const FrameId id{job.job_id, frame.frame_number};
        const CellGrid grid(frame, job.partition);
        const std::vector<uint64_t> samples = SamplesAfter(frame, grid, kRounds - 1);
        for (uint32_t tile = 0; tile < grid.tiles().size(); ++tile) {
          const auto found = journal_.find({id, tile});
          ASSERT_NE(found, journal_.end());
          for (uint32_t i = 0; i < grid.cell_count(tile); ++i) {
            const uint64_t wanted = samples[grid.first_cell(tile) + i];
            EXPECT_EQ(found->second.merged[i].SampleCount(), wanted);
            EXPECT_TRUE(found->second.merged[i].Contains({0, wanted}));
          }
        }
      }
    }
    EXPECT_EQ(scheduler_->leases().size(), 0u);
  }

 private:
  static constexpr int kRounds = 4;  // For frames with a rule.
  using TileKey = std::pair<FrameId, uint32_t>;
  struct TilePart {
    PixelRect tile;
    SampleBlock block;
    TileCells cells;
  };
  struct TileJournal {
    std::vector<TilePart> parts;
    std::array<SampleRanges, kTileCellsMax> merged;  // By cell.
  };

  // By cell, as decided at the end of a number of rounds: unequal, and often as before.
  static std::vector<uint64_t> SamplesAfter(const FrameSpec& frame, const CellGrid& grid,
                                            int rounds) {
    if (!frame.stop.IsActive())
      return std::vector<uint64_t>(grid.cells().size(), frame.settings.samples);
    std::vector<uint64_t> samples(grid.cells().size(), kReplicateCount);
    for (int round = 0; round < rounds; ++round) {
      for (size_t cell = 0; cell < samples.size(); ++cell) {
        std::mt19937_64 random(cell * 100 + static_cast<size_t>(round));
        samples[cell] += kReplicateCount * (random() % 6);
        samples[cell] = std::min(samples[cell], frame.settings.samples);
      }
    }
    return samples;
  }

  bool Happens(double probability) {
    return probability > 0 && std::uniform_real_distribution<double>(0, 1)(random_) < probability;
  }
  std::string NewWorkerId() { return absl::StrCat("w", next_worker_++); }
  bool AllEnded() const {
    return std::all_of(jobs_.begin(), jobs_.end(), [&](const JobSpec& job) {
      return scheduler_->jobs().at(job.job_id).phase != JobPhase::kLive;
    });
  }

  void StartCoordinator() {
    scheduler_ = std::make_unique<Scheduler>(limits_, static_cast<uint64_t>(++lives_) << 40);
    for (const JobSpec& job : jobs_) scheduler_->AddJob(job);
    for (const FrameId& id : delivered_) scheduler_->RestoreDelivered(id, {}, 0);
    for (const auto& [id, round] : rounds_) {
      if (!delivered_.contains(id)) scheduler_->RestoreRound(id, RoundOf(id, round));
    }
    for (const auto& [key, tile] : journal_) {
      if (delivered_.contains(key.first)) continue;
      for (const TilePart& part : tile.parts) {
        ASSERT_EQ(scheduler_->RestorePart(key.first, part.tile, part.block, part.cells, {}),
                  FrameTasks::Fit::kWanted);
      }
    }
    for (const JobSpec& job : jobs_) {
      const bool all = std::all_of(job.frames.begin(), job.frames.end(), [&](const FrameSpec& f) {
        return delivered_.contains({job.job_id, f.frame_number});
      });
      if (all) scheduler_->EndJob(job.job_id, JobPhase::kSucceeded, "");
    }
  }

  void StepWorker(SimWorker* worker) {
    if (worker->stopped) {
      if (Happens(0.2)) *worker = {NewWorkerId(), false, {}, {}};
      return;
    }
    if (Happens(faults_.worker_dies)) {
      worker->stopped = true;
      return;
    }
    WorkerReport report;
    report.worker_id = report.host = worker->id;
    report.numeric_profile = kSimulatedProfile;
    report.requested_lease_count = 2;
    if (!worker->held.empty()) RenderOrFail(worker, &report);
    for (const Lease& lease : worker->held) {
      report.leases.push_back({lease.lease_id, LeasePhase::kRendering});
    }
    const auto answer = scheduler_->Synchronize(report, now_);
    ASSERT_TRUE(answer.ok()) << answer.status();
    for (const Lease& lease : answer->leases) CheckNotMerged(lease);
    if (!Happens(faults_.reply_lost)) worker->held = answer->leases;
    // It does not take up again leases that it has rendered already.
    std::erase_if(worker->held, [&](const Lease& lease) {
      return std::any_of(worker->unacknowledged.begin(), worker->unacknowledged.end(),
                         [&](const Lease& done) { return done.lease_id == lease.lease_id; });
    });
    for (const Lease& lease : worker->unacknowledged) Upload(lease);
  }

  void RenderOrFail(SimWorker* worker, WorkerReport* report) {
    const Lease lease = worker->held.front();
    if (Happens(faults_.released)) {
      report->failures.push_back({lease.lease_id, FailureKind::kReleased, ""});
    } else if (Happens(faults_.infrastructure)) {
      report->failures.push_back({lease.lease_id, FailureKind::kInfrastructure, "no route"});
    } else if (Happens(0.7)) {
      worker->unacknowledged.push_back(lease);
    } else {
      return;
    }
    worker->held.erase(worker->held.begin());
  }

  void Upload(const Lease& lease) {
    const int copies = Happens(faults_.upload_doubled) ? 2 : 1;
    for (int i = 0; i < copies; ++i) {
      if (Happens(faults_.upload_lost)) continue;
      const absl::Duration delay =
          Happens(faults_.upload_late) ? absl::Seconds(20 + random_() % 60) : absl::ZeroDuration();
      arrivals_.emplace(now_ + delay, lease);
    }
  }

  void DeliverArrivals() {
    while (!arrivals_.empty() && arrivals_.begin()->first <= now_) {
      const Lease lease = arrivals_.begin()->second;
      arrivals_.erase(arrivals_.begin());
      if (!TakeResult(lease) || Happens(faults_.ack_lost)) continue;
      for (SimWorker& worker : workers_) {
        std::erase_if(worker.unacknowledged,
                      [&](const Lease& l) { return l.lease_id == lease.lease_id; });
      }
    }
  }

  // Returns whether the result was acknowledged.
  bool TakeResult(const Lease& lease) {
    using Kind = Scheduler::FoundTask::Kind;
    const FrameSpec spec = SpecOf(lease.frame);
    const Scheduler::FoundTask found = scheduler_->FindTask(
        spec.frame_digest, lease.tile_rect, lease.task.block, lease.cells, lease.lease_id);
    EXPECT_NE(found.kind, Kind::kMalformed);
    if (found.kind != Kind::kWanted) return true;
    TileJournal& tile = journal_[{found.frame, found.task.tile}];
    for (size_t i = 0; i < tile.merged.size(); ++i) {
      if ((found.task.cells >> i & 1) == 0) continue;
      EXPECT_FALSE(tile.merged[i].Overlaps(RangeOf(lease.task.block))) << "merged twice";
      tile.merged[i].Add(RangeOf(lease.task.block));
    }
    tile.parts.push_back({lease.tile_rect, lease.task.block, lease.cells});
    if (Happens(faults_.coordinator_dies)) {
      StartCoordinator();  // Between the row and the acknowledgement.
      return false;
    }
    scheduler_->Accept(found.frame, found.task, lease.lease_id, lease.worker_id,
                       {0, 0, absl::Milliseconds(100)}, now_);
    return true;
  }

  void DeliverFrames() {
    for (const JobSpec& job : jobs_) {
      for (const FrameSpec& frame : job.frames) {
        const FrameId id{job.job_id, frame.frame_number};
        if (scheduler_->FindFrame(id)->phase != FrameRecord::Phase::kRendered) continue;
        if (frame.stop.IsActive() && rounds_[id] + 1 < kRounds) {
          ++rounds_[id];
          if (Happens(faults_.coordinator_dies)) return StartCoordinator();
          scheduler_->Grow(id, RoundOf(id, rounds_[id]));
          continue;
        }
        delivered_.insert(id);
        if (Happens(faults_.coordinator_dies)) return StartCoordinator();
        scheduler_->Deliver(id);
      }
    }
  }

  FrameSpec SpecOf(const FrameId& id) const { return scheduler_->FindFrame(id)->Spec(); }
  std::vector<uint64_t> RoundOf(const FrameId& id, int round) const {
    const FrameSpec frame = SpecOf(id);
    const Partition& partition = scheduler_->jobs().at(id.job_id).spec.partition;
    return SamplesAfter(frame, CellGrid(frame, partition), round);
  }

  // No acknowledged sample is ever leased.
  void CheckNotMerged(const Lease& lease) const {
    const auto found = journal_.find({lease.frame, lease.task.tile});
    if (found == journal_.end()) return;
    for (size_t i = 0; i < kTileCellsMax; ++i) {
      if ((lease.task.cells >> i & 1) == 0) continue;
      EXPECT_FALSE(found->second.merged[i].Overlaps(RangeOf(lease.task.block)));
    }
  }

  // Every lease has a worker that is known to hold it, and no task more than two.
  void CheckLeases() const {
    size_t held = 0;
    std::map<TaskId, int> holders;
    for (const auto& [id, worker] : scheduler_->workers().workers()) {
      held += worker.leases.size();
      EXPECT_TRUE(!worker.lost || worker.leases.empty());
      for (const uint64_t lease_id : worker.leases) {
        const Lease* lease = scheduler_->leases().Find(lease_id);
        ASSERT_NE(lease, nullptr);
        EXPECT_LE(++holders[MakeTaskId(lease->frame, lease->task)], 2);
      }
    }
    EXPECT_EQ(held, scheduler_->leases().size());
  }

  std::mt19937_64 random_;
  const SimFaults faults_;
  const std::vector<JobSpec> jobs_;
  Limits limits_;
  std::unique_ptr<Scheduler> scheduler_;
  SteadyTime now_;
  int lives_ = 0;
  int next_worker_ = 0;
  std::vector<SimWorker> workers_;
  std::multimap<SteadyTime, Lease> arrivals_;
  std::map<TileKey, TileJournal> journal_;  // The rows on disk.
  std::map<FrameId, int> rounds_;           // Likewise: the last that was decided.
  std::set<FrameId> delivered_;
};

JobSpec MakeJob(uint64_t id, int frame_count, int32_t edge_px, uint64_t samples,
                uint64_t lease_pass_count) {
  JobSpec job;
  job.job_id = id;
  job.numeric_profile = kSimulatedProfile;
  job.partition = {16, 4, lease_pass_count};
  for (int i = 1; i <= frame_count; ++i) {
    FrameSpec frame;
    frame.frame_number = i;
    frame.scene = {Sha256Hex(absl::StrCat("scene", i)), 1};
    frame.settings.width_px = frame.settings.height_px = edge_px;
    frame.settings.window = {0, 0, edge_px, edge_px};
    frame.settings.samples = samples;
    frame.frame_digest = Sha256Hex(absl::StrCat("frame", id, "-", i));
    job.frames.push_back(frame);
  }
  return job;
}

// Rendered in rounds, which give each cell of 4 px samples of its own.
JobSpec InRounds(JobSpec job) {
  job.partition.cell_size_px = 4;
  for (FrameSpec& frame : job.frames) frame.stop.target_error = 0.1;
  return job;
}

TEST(FarmSimTest, WithoutFaultsNoWorkIsRepeated) {
  FarmSim sim(
      1, {}, 5,
      {MakeJob(1, 2, 64, 50, 0), MakeJob(2, 1, 40, 64, 2), InRounds(MakeJob(3, 2, 40, 200, 0))});
  ASSERT_GE(sim.Run(100'000), 0);
  sim.CheckComplete();
  const Counters& counters = sim.scheduler().counters();
  EXPECT_EQ(counters.leases_expired, 0u);
  EXPECT_EQ(counters.leases_granted, counters.results_accepted + counters.leases_cancelled);
}

TEST(FarmSimTest, EveryFrameFinishesUnderAnyFaults) {
  int lives = 0;
  uint64_t expired = 0, late = 0, hedged = 0;
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(absl::StrCat("seed ", seed));
    std::mt19937_64 random(seed);
    const auto chance = [&](double max) {
      return random() % 3 == 0 ? 0 : std::uniform_real_distribution<double>(0, max)(random);
    };
    SimFaults faults;
    faults.reply_lost = chance(0.3);
    faults.upload_lost = chance(0.3);
    faults.ack_lost = chance(0.3);
    faults.upload_doubled = chance(0.3);
    faults.upload_late = chance(0.3);
    faults.worker_dies = chance(0.01);
    faults.coordinator_dies = chance(0.01);
    faults.released = chance(0.1);
    faults.infrastructure = chance(0.05);
    FarmSim sim(seed, faults, 1 + static_cast<int>(seed % 7),
                {MakeJob(1, 3, 48, 100, seed % 3 == 0 ? 0 : seed % 3 * 2), MakeJob(2, 1, 64, 33, 0),
                 InRounds(MakeJob(3, 1, 40, 200, 0))});
    ASSERT_GE(sim.Run(50'000), 0);
    sim.CheckComplete();
    if (::testing::Test::HasFailure()) return;
    lives += sim.lives();
    const Counters& counters = sim.scheduler().counters();  // Since the last start.
    expired += counters.leases_expired;
    late += counters.results_late;
    hedged += counters.leases_hedged;
  }
  // The faults were there.
  EXPECT_GT(lives, 100);
  EXPECT_GT(expired, 20u);
  EXPECT_GT(late, 20u);
  EXPECT_GT(hedged, 20u);
}

TEST(FarmSimTest, IsDeterministicBySeed) {
  SimFaults faults;
  faults.reply_lost = faults.upload_late = faults.worker_dies = 0.02;
  std::vector<uint64_t> histories;
  for (int run = 0; run < 2; ++run) {
    FarmSim sim(99, faults, 4, {MakeJob(1, 2, 48, 64, 0)});
    const int steps = sim.Run(50'000);
    ASSERT_GE(steps, 0);
    const Counters& counters = sim.scheduler().counters();
    histories.push_back(static_cast<uint64_t>(steps) * 1'000'000 + counters.leases_granted * 1000 +
                        counters.leases_expired);
  }
  EXPECT_EQ(histories[0], histories[1]);
}

TEST(FarmSimTest, TenThousandWorkersRenderAHundredThousandTasks) {
  Limits limits;
  Scheduler scheduler(limits, 1);
  JobSpec job = MakeJob(1, 1, 16 * 160, 16, 1);  // 160 x 160 tiles of four passes.
  scheduler.AddJob(job);
  SteadyTime now;
  uint64_t accepted = 0;
  const FrameId frame{1, 1};
  while (scheduler.FindFrame(frame)->phase != FrameRecord::Phase::kRendered) {
    now += absl::Seconds(1);
    for (int w = 0; w < 10'000; ++w) {
      WorkerReport report;
      report.worker_id = absl::StrCat("w", w);
      report.numeric_profile = kSimulatedProfile;
      report.requested_lease_count = 2;
      const auto answer = scheduler.Synchronize(report, now);
      ASSERT_TRUE(answer.ok());
      for (const Lease& lease : answer->leases) {
        const auto found = scheduler.FindTask(job.frames[0].frame_digest, lease.tile_rect,
                                              lease.task.block, lease.cells, lease.lease_id);
        if (found.kind != Scheduler::FoundTask::Kind::kWanted) continue;
        scheduler.Accept(frame, found.task, lease.lease_id, report.worker_id, {}, now);
        ++accepted;
      }
    }
  }
  EXPECT_EQ(accepted, 160u * 160u * 4u);
  EXPECT_EQ(scheduler.leases().size(), 0u);
}

}  // namespace
}  // namespace sheaf::coordinator
