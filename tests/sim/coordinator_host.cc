// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/coordinator_host.h"

#include <cerrno>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "common/base/check.h"

namespace sheaf::sim {
namespace {

constexpr char kStateDirectory[] = "/sim/state";
constexpr char kDatabase[] = "/sim/state/farm.db";
constexpr char kSecret[] = "/sim/state/lease.key";
// How long the coordinator's background thread sleeps, with what its machine adds to it.
constexpr absl::Duration kWorkIntervalMin = absl::Milliseconds(100);
constexpr absl::Duration kWorkIntervalMax = absl::Milliseconds(400);
constexpr absl::Duration kDownMin = absl::Milliseconds(100), kDownMax = absl::Seconds(40);
constexpr absl::Duration kStartRetry = absl::Seconds(2);
// The most changes of the disk before a process ends.
constexpr uint64_t kChangesToEndMax = 40;

// All regular files below a folder that hold parts, guiding fields or images.
void CollectImages(const SimDisk::NodePtr& folder, std::vector<SimDisk::NodePtr>* files) {
  for (const auto& [name, node] : folder->entries) {
    if (node->is_folder) {
      CollectImages(node, files);
    } else if ((absl::EndsWith(name, ".exr") || absl::EndsWith(name, ".field")) &&
               !node->bytes.empty()) {
      files->push_back(node);
    }
  }
}

// The bytes of a database that a first life has just made, which takes longer than all that follows
// in a small simulation. Made on a machine of its own, so that nothing else is left of it.
std::string MakeDatabase() {
  Machine machine(0);
  SHEAF_CHECK(coordinator::SqlJobStore::Open(kStateDirectory).ok());  // Closed at once.
  SimDisk::NodePtr node;
  SHEAF_CHECK(machine.disk().Find(kDatabase, &node) == 0);
  return node->bytes;
}

// Puts such a database on the disk.
void PrepareDatabase(SimDisk* disk) {
  static const auto& bytes = *new std::string(MakeDatabase());
  SimDisk::NodePtr node;
  const int made = disk->MakeFolder(kStateDirectory);
  SHEAF_CHECK(made == 0 || made == EEXIST);
  SHEAF_CHECK(disk->Open(kDatabase, /*create=*/true, /*truncate=*/true, false, &node) == 0);
  SHEAF_CHECK(disk->Write(node, 0, bytes) == 0 && disk->Sync(node) == 0);
}

}  // namespace

CoordinatorHost::CoordinatorHost(World* world, Promises* promises)
    : world_(*world), promises_(*promises) {
  Random& random = world_.random;
  options_.state_directory = kStateDirectory;
  options_.limits.lease_age_max = absl::Minutes(5);
  // Small limits are met; merging from disk is another path than merging in memory.
  if (random.Chance(0.3)) options_.limits.open_pixels_max = 200;
  if (random.Chance(0.3)) options_.merge_bytes_max = 0;
  if (random.Chance(0.3)) options_.kept_parts_bytes_max = uint64_t{1} << 17;
  if (random.Chance(0.5)) options_.round_previews_bytes_max = 0;
  if (random.Chance(0.3)) options_.limits.check_fraction = 1;
  if (random.Chance(0.9)) PrepareDatabase(&world_.machine.disk());
  world_.machine.disk().set_gate([this](SimDisk::Operation operation, const std::string& path,
                                        bool grows) { return Gate(operation, path, grows); });
}

CoordinatorHost::~CoordinatorHost() {
  farm_.reset();
  world_.machine.disk().set_gate(nullptr);
}

int CoordinatorHost::Gate(SimDisk::Operation operation, const std::string& path, bool grows) {
  if (changes_to_end_ > 0 && --changes_to_end_ == 0) return SimDisk::kStopsMachine;
  Faults& faults = world_.faults;
  int error = 0;
  if (disk_full_ && grows) error = ENOSPC;
  if (operation == SimDisk::Operation::kSync && faults.Happens(Fault::kSyncFailed)) error = EIO;
  if (faults.Happens(Fault::kWriteFailed)) error = EIO;
  if (error != 0) {
    ++refused_count_;
    world_.Trace("the disk refuses a change of ", path, ": errno ", error);
    return error;
  }
  const bool is_part =
      operation == SimDisk::Operation::kRename && absl::StrContains(path, "/parts/");
  if (is_part && interleaved_ && farm_ != nullptr && !is_interleaving_ &&
      faults.Happens(Fault::kInterleaved)) {
    is_interleaving_ = true;
    interleaved_(*farm_);
    is_interleaving_ = false;
  }
  return world_.machine.disk().stopped() ? EIO : 0;
}

absl::StatusOr<std::unique_ptr<coordinator::Farm>> CoordinatorHost::Open() {
  auto store = coordinator::SqlJobStore::Open(kStateDirectory);
  if (!store.ok()) return store.status();
  promises_.CheckLog((*store)->LostCommits());
  return coordinator::Farm::OpenWithoutThread(
      options_, std::make_unique<PromisingStore>(*std::move(store), &world_.machine, &promises_));
}

void CoordinatorHost::Start() {
  ++life_;
  const uint64_t refused_before = refused_count_;
  PlanEnd();
  absl::StatusOr<std::unique_ptr<coordinator::Farm>> farm = Open();
  if (world_.machine.disk().stopped()) {
    farm = absl::UnavailableError("");
    NoteEnd();
    return;
  }
  if (!farm.ok()) {
    world_.Trace("the coordinator does not start: ", farm.status().message());
    if (refused_before == refused_count_) {
      world_.Broken(absl::StrCat("the coordinator does not start: ", farm.status().message()));
    }
    world_.After(kStartRetry, [this] { Start(); });
    return;
  }
  farm_ = *std::move(farm);
  SimDisk::NodePtr secret;
  SHEAF_CHECK(world_.machine.disk().Find(kSecret, &secret) == 0);
  promises_.Started(secret->bytes);
  world_.Trace("the coordinator starts, life ", life_);
  Work();
}

void CoordinatorHost::Work() {
  const absl::Duration sleep = world_.random.Between(kWorkIntervalMin, kWorkIntervalMax);
  world_.After(sleep, [this, life = life_] {
    if (life != life_ || farm_ == nullptr) return;
    MeetFaults();
    const bool goes_on =
        farm_ != nullptr && Serve("work", [](coordinator::Farm& farm) { farm.RunOnce(); });
    if (goes_on) Work();
  });
}

void CoordinatorHost::MeetFaults() {
  Faults& faults = world_.faults;
  if (faults.Happens(Fault::kWallClockJumped)) {
    const absl::Duration by =
        faults.random(Fault::kWallClockJumped).Between(-absl::Hours(24), absl::Hours(24));
    world_.Trace("the wall clock jumps by ", absl::FormatDuration(by));
    world_.machine.JumpWallClock(by);
  }
  if (faults.Happens(Fault::kDiskFull)) FillDisk();
  if (faults.Happens(Fault::kFileDamaged)) DamageFile();
  if (!faults.Happens(Fault::kStopped)) return;
  world_.Trace("the coordinator stops in order");
  farm_.reset();
  if (world_.machine.disk().stopped()) {
    NoteEnd();
    return;
  }
  const absl::Duration down = faults.random(Fault::kStopped).Between(kDownMin, kDownMax);
  world_.After(down, [this] { Start(); });
}

void CoordinatorHost::FillDisk() {
  if (disk_full_) return;
  world_.Trace("the disk is full");
  disk_full_ = true;
  const absl::Duration time =
      world_.faults.random(Fault::kDiskFull).Between(absl::Seconds(1), absl::Minutes(2));
  world_.After(time, [this] {
    world_.Trace("the disk has space again");
    disk_full_ = false;
  });
}

void CoordinatorHost::DamageFile() {
  SimDisk::NodePtr state;
  if (world_.machine.disk().Find(kStateDirectory, &state) != 0) return;
  std::vector<SimDisk::NodePtr> files;
  CollectImages(state, &files);
  if (files.empty()) return;
  Random& random = world_.faults.random(Fault::kFileDamaged);
  SimDisk::Node& file = *files[random.Below(files.size())];
  const size_t at = random.Below(file.bytes.size());
  file.bytes[at] ^= 1;
  if (at < file.durable_bytes.size()) file.durable_bytes[at] = file.bytes[at];
  ++file.version;
  promises_.Damaged();
  world_.Trace("byte ", at, " of ", SimDisk::PathOf(file), " changes");
}

void CoordinatorHost::PlanEnd() {
  if (changes_to_end_ > 0) return;
  for (const Fault fault : {Fault::kProcessKilled, Fault::kPowerLost}) {
    if (!world_.faults.Happens(fault)) continue;
    changes_to_end_ = 1 + world_.faults.random(fault).Below(kChangesToEndMax);
    loses_power_ = fault == Fault::kPowerLost;
    return;
  }
}

bool CoordinatorHost::Serve(const char* what, const Call& call) {
  if (farm_ == nullptr) return false;
  SHEAF_CHECK(!is_interleaving_);
  PlanEnd();
  call(*farm_);
  if (world_.machine.disk().stopped()) {
    world_.Trace("the coordinator ends during ", what);
    NoteEnd();
    return false;
  }
  if (after_call_) after_call_(*farm_);
  return true;
}

void CoordinatorHost::NoteEnd() {
  farm_.reset();
  Random& random = world_.faults.random(loses_power_ ? Fault::kPowerLost : Fault::kProcessKilled);
  const int lost = world_.machine.disk().Restart(loses_power_, &random);
  world_.Trace(loses_power_ ? "its machine lost its power, and " : "its process was killed: ", lost,
               " changes are lost");
  changes_to_end_ = 0;
  world_.After(random.Between(kDownMin, kDownMax), [this] { Start(); });
}

}  // namespace sheaf::sim
