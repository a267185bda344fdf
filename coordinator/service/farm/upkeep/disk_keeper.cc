// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/upkeep/disk_keeper.h"

#include <time.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/log.h"
#include "common/rpc/manifest_codec.h"

namespace sheaf::coordinator {
namespace {

namespace fs = std::filesystem;

// DiskReserve's file, which has no data.
constexpr char kReserveName[] = "reserve";
// How often space and ages are checked.
constexpr absl::Duration kLookInterval = absl::Seconds(1);
constexpr absl::Duration kFirstAgePass = absl::Seconds(10);
constexpr absl::Duration kAgeIntervalMax = absl::Minutes(10);
constexpr int kAgeIntervalsPerAge = 10;
constexpr absl::Duration kClockStepTold = absl::Hours(1);
// While nothing is left to remove, another listing is not worth its cost.
constexpr absl::Duration kOverInterval = absl::Seconds(10);
// Walking through the directory takes at most this fraction of the time.
constexpr int kWalkFraction = 20;  // 1 / 20.

// Bytes of the files below a folder, without those of some of its files and folders. Files that
// vanish meanwhile count as empty.
uint64_t BytesBelow(const std::string& folder, const std::set<std::string>& left_out = {}) {
  uint64_t bytes = 0;
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    std::error_code ignored;
    if (it.depth() == 0 && left_out.contains(it->path().filename().string())) {
      it.disable_recursion_pending();
      continue;
    }
    if (!it->is_regular_file(ignored)) continue;
    const uintmax_t size = it->file_size(ignored);
    if (!ignored) bytes += size;
  }
  return bytes;
}

bool IsOfBlobs(KeptKind kind) { return kind == KeptKind::kBlob || kind == KeptKind::kUpload; }

std::string NameOf(const KeptItem& item) {
  return item.kind == KeptKind::kJob
             ? absl::StrCat("job ", item.job_id)
             : absl::StrCat(KeptKindName(item.kind), " of job ", item.job_id);
}

absl::Duration SinceBoot() {
  timespec now{};
  ::clock_gettime(CLOCK_BOOTTIME, &now);
  return absl::DurationFromTimespec(now);
}

}  // namespace

DiskKeeper::DiskKeeper(const FarmOptions& options, const Parts& parts)
    : state_directory_(options.state_directory),
      limits_(options.retention),
      owner_bytes_max_(options.limits.owner_bytes_max),
      space_advice_(options.space_advice),
      tables_(parts.tables),
      store_(parts.store),
      blobs_(parts.blobs),
      previews_(parts.previews),
      jobs_(parts.jobs),
      reserve_(parts.reserve),
      aging_(absl::Now(), SinceBoot()),
      next_age_pass_(SteadyTime::Now() + std::min(AgeInterval(), kFirstAgePass)) {}

absl::Duration DiskKeeper::AgeInterval() const {
  const absl::Duration age =
      std::min({limits_.parts_age_max, limits_.jobs_age_max, limits_.unnamed_age_max});
  return std::clamp(age / kAgeIntervalsPerAge, kLookInterval, kAgeIntervalMax);
}

void DiskKeeper::Update() {
  const SteadyTime now = SteadyTime::Now();
  if (now < next_look_) return;
  next_look_ = now + kLookInterval;
  bool is_due = now >= next_age_pass_;
  if (is_due) next_age_pass_ = now + AgeInterval();
  {
    const MutexLock lock(&mutex_);
    const BytesOver over = BytesOverOf(Measure(), limits_);
    is_due |= over.limit > 0 || over.free_space > 0;
  }
  if (!is_due) return;
  const absl::Status collected = Collect(/*dry_run=*/false, AgingNow()).status();
  if (!collected.ok()) {
    LogError(absl::StrCat("keeping the disk within its limits: ", collected.message()));
  }
  const MutexLock lock(&mutex_);
  const DiskUse use = Measure();
  NoteOver(use);
  if (is_over_) next_look_ = SteadyTime::Now() + kOverInterval;
}

absl::Time DiskKeeper::AgingNow() {
  const absl::Time wall = absl::Now();
  const absl::Duration since_boot = SinceBoot();
  const absl::Duration ahead = aging_.Ahead(wall, since_boot);
  const bool is_ahead = ahead > kClockStepTold;
  if (!is_ahead_.exchange(is_ahead) && is_ahead) {
    LogWarning(
        absl::StrCat("the clock of this machine has been set ahead by ",
                     absl::FormatDuration(absl::Trunc(ahead + absl::Seconds(30), absl::Minutes(1))),
                     "; stored data ages as if it had not been. If the clock is right now, restart "
                     "the coordinator"));
  }
  return aging_.At(wall, since_boot);
}

void DiskKeeper::NoteOver(const DiskUse& use) {
  const BytesOver over = BytesOverOf(use, limits_);
  const bool is_over = over.limit > 0 || over.free_space > 0;
  if (is_over == is_over_) return;
  is_over_ = is_over;
  if (!is_over) {
    LogInfo("the state directory is within its limits again");
    return;
  }
  LogWarning(absl::StrCat(
      state_directory_, ": ", use.bytes, " bytes, with ", use.free_bytes,
      " bytes free on its file system, are beyond the limits (--disk-limit, --disk-free-min), and "
      "nothing is left to remove: the rest belongs to jobs that are unfinished or pinned"));
}

uint64_t DiskKeeper::OutputBytes(uint64_t job_id) const {
  return BytesBelow(absl::StrCat(state_directory_, "/outputs/", job_id));
}

absl::Status DiskKeeper::CheckFreeSpace() const {
  std::error_code error;
  const fs::space_info space = fs::space(state_directory_, error);
  if (error) return absl::OkStatus();  // Unknown; a write will tell.
  DiskUse use;
  use.free_bytes = space.available;
  use.capacity_bytes = space.capacity;
  if (BytesOverOf(use, limits_).free_space == 0) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("the file system of ", state_directory_, " has ", FormatBytes(use.free_bytes),
                   " left, less than --disk-free-min; free space on it"));
}

DiskUse DiskKeeper::Measure() {
  DiskUse use;
  std::error_code error;
  const fs::space_info space = fs::space(state_directory_, error);
  if (!error) {
    use.free_bytes = space.available;
    use.capacity_bytes = space.capacity;
  }
  const bool is_limited = limits_.bytes_max != UINT64_MAX;
  const SteadyTime now = SteadyTime::Now();
  if (is_limited && now >= next_walk_) {
    other_bytes_ = BytesBelow(state_directory_, {"parts", kReserveName});
    const SteadyTime end = SteadyTime::Now();
    next_walk_ = end + (end - now) * kWalkFraction;
  }
  use.bytes = other_bytes_ + store_.PartsBytes();
  const MutexLock lock(&counts_mutex_);
  state_bytes_ = use.bytes;
  return use;
}

absl::StatusOr<std::vector<Removal>> DiskKeeper::Collect(bool dry_run, absl::Time now) {
  const MutexLock lock(&mutex_);
  next_walk_ = SteadyTime::InfinitePast();
  absl::StatusOr<Stored> stored = List(now);
  if (!stored.ok()) return stored.status();
  std::vector<Removal> removals =
      DecideRemovals(std::move(stored->items), stored->use, limits_, now);
  if (dry_run) return removals;
  return RemoveAll(removals, stored->reopen_count, now);
}

absl::StatusOr<std::vector<RemovalView>> DiskKeeper::CollectForPeople(bool dry_run) {
  const absl::StatusOr<std::vector<Removal>> removals = Collect(dry_run, AgingNow());
  if (!removals.ok()) return removals.status();
  std::vector<RemovalView> views;
  for (const Removal& removal : *removals) {
    const KeptItem& item = removal.item;
    const std::string kind = KeptKindName(item.kind), reason = RemovalReasonText(removal.reason);
    const bool adds = IsOfBlobs(item.kind) && !views.empty() && views.back().kind == kind &&
                      views.back().reason == reason;
    if (!adds) {
      views.push_back({kind, IsOfBlobs(item.kind) ? "" : absl::StrCat(item.job_id), reason});
    }
    ++views.back().item_count;
    views.back().size_bytes += item.size_bytes;
  }
  return views;
}

std::vector<Removal> DiskKeeper::RemoveAll(const std::vector<Removal>& removals,
                                           uint64_t reopen_count, absl::Time now) {
  std::vector<Removal> removed;
  std::vector<Removal> of_blobs;
  for (const Removal& removal : removals) {
    if (IsOfBlobs(removal.item.kind)) {
      of_blobs.push_back(removal);
      continue;
    }
    if (!Remove(removal.item, now)) continue;
    LogInfo(absl::StrCat("removed: ", NameOf(removal.item), ", ", removal.item.size_bytes,
                         " bytes, because ", RemovalReasonText(removal.reason)));
    removed.push_back(removal);
  }
  // A job that was reopened since they were listed may need some. Clients that asked for blobs keep
  // them alive.
  size_t count = 0;
  const bool done = of_blobs.empty() || jobs_.IfNoneReopened(reopen_count, [&] {
    for (const Removal& removal : of_blobs) {
      const KeptItem& item = removal.item;
      const bool gone =
          item.kind == KeptKind::kBlob ? blobs_.Remove(item.blob) : blobs_.RemoveUpload(item.blob);
      if (!gone) continue;
      ++count;
      removed.push_back(removal);
    }
  });
  if (!done) LogInfo("a job was reopened: blobs are checked later");
  if (count > 0) LogInfo(absl::StrCat("removed: ", count, " blobs and uploads"));
  if (!removed.empty()) next_walk_ = SteadyTime::InfinitePast();
  const MutexLock counting(&counts_mutex_);
  for (const Removal& removal : removed) {
    Counts& counts = counts_.at(static_cast<size_t>(removal.item.kind));
    ++counts.removed;
    counts.bytes += removal.item.size_bytes;
  }
  return removed;
}

bool DiskKeeper::Remove(const KeptItem& item, absl::Time now) {
  absl::Status removed;
  switch (item.kind) {
    case KeptKind::kParts:
      removed = jobs_.RemoveParts(item.job_id, now);
      break;
    case KeptKind::kPreviews:
      removed = jobs_.RemovePreviews(item.job_id);
      break;
    case KeptKind::kJob:
      removed = jobs_.RemoveJob(item.job_id);
      break;
    case KeptKind::kUpload:
    case KeptKind::kBlob:
      return false;
  }
  if (!removed.ok()) {
    LogWarning(absl::StrCat(NameOf(item), ": not removed: ", removed.message()));
  }
  return removed.ok();
}

std::map<uint64_t, DiskKeeper::JobUse> DiskKeeper::ListJobs() const {
  std::map<uint64_t, JobUse> jobs;
  const MutexLock lock(&tables_.mutex);
  const std::set<uint64_t> unsettled(tables_.unsettled_jobs.begin(), tables_.unsettled_jobs.end());
  for (const auto& [id, job] : tables_.scheduler.jobs()) {
    const JobAccount& account = tables_.accounts.at(id);
    JobUse& use = jobs[id];
    use.in_use = job.phase == JobPhase::kLive || unsettled.contains(id) || account.pinned ||
                 tables_.scheduler.IsAwaited(id);
    use.is_recent = account.EndedWithin(limits_.job_age_min, SteadyTime::Now());
    use.end_time = account.end_time;
    use.owner = job.spec.owner;
    const FrameRecord* last = nullptr;  // Mostly all frames share a scene.
    for (const FrameRecord& frame : job.frames) {
      if (last == nullptr || frame.packed.scene() != last->packed.scene()) {
        use.scenes.push_back(frame.Spec().scene);
      }
      const BlobDigest& resumed = frame.packed.shape().resumed;
      if (!resumed.sha256_hex.empty()) use.images.push_back(resumed);
      last = &frame;
    }
  }
  return jobs;
}

absl::StatusOr<DiskKeeper::Stored> DiskKeeper::List(absl::Time now) {
  Stored stored;
  stored.reopen_count = jobs_.ReopenCount();
  const std::map<uint64_t, JobUse> jobs = ListJobs();
  const auto add = [&](KeptKind kind, uint64_t job_id, uint64_t size_bytes) {
    KeptItem item{.kind = kind, .job_id = job_id};
    item.size_bytes = size_bytes;
    const auto job = jobs.find(job_id);
    item.in_use = job != jobs.end() && job->second.in_use;
    item.unused_since = job != jobs.end() ? job->second.end_time : absl::InfinitePast();
    stored.items.push_back(std::move(item));
  };
  const absl::StatusOr<std::map<uint64_t, uint64_t>> parts = store_.PartsBytesByJob();
  if (!parts.ok()) return parts.status();
  for (const auto& [id, size_bytes] : *parts) {
    if (jobs.contains(id)) add(KeptKind::kParts, id, size_bytes);
  }
  for (const auto& [id, size_bytes] : previews_.BytesByJob()) {
    // A job created since is not known here.
    const bool is_new = !jobs.empty() && id > jobs.rbegin()->first;
    if (!is_new) add(KeptKind::kPreviews, id, size_bytes);
  }
  for (const auto& [id, job] : jobs) {
    if (job.in_use || job.is_recent) continue;
    add(KeptKind::kJob, id, OutputBytes(id));
  }
  ListBlobs(jobs, now, &stored.items);
  stored.use = Measure();
  return stored;
}

void DiskKeeper::ListBlobs(const std::map<uint64_t, JobUse>& jobs, absl::Time now,
                           std::vector<KeptItem>* items) {
  std::map<std::string, BlobUse> uses;
  std::map<std::string, std::vector<std::string>> files;  // The scenes' that jobs name.
  bool all_known = true;
  const auto note = [&uses](const std::string& hex, const JobUse& job) {
    BlobUse& use = uses[hex];
    use.in_use |= job.in_use;
    use.end_time = std::max(use.end_time, job.end_time);
  };
  for (const auto& [id, job] : jobs) {
    for (const BlobDigest& image : job.images) note(image.sha256_hex, job);
    for (const BlobDigest& scene : job.scenes) {
      note(scene.sha256_hex, job);
      absl::StatusOr<std::vector<std::string>> names = FilesOf(scene);
      if (!names.ok()) {
        all_known &= !job.in_use;
        continue;
      }
      for (const std::string& hex : *names) note(hex, job);
      files[scene.sha256_hex] = *std::move(names);
    }
  }
  files_ = std::move(files);
  for (const StoredBlob& blob : blobs_.List()) {
    KeptItem item{.kind = KeptKind::kBlob, .blob = blob.digest};
    item.size_bytes = blob.digest.size_bytes;
    item.unused_since = now - absl::FromChrono(blob.age);
    const auto use = uses.find(blob.digest.sha256_hex);
    item.is_named = use != uses.end();
    if (item.is_named) item.unused_since = std::max(item.unused_since, use->second.end_time);
    // If a job's list of files is lost, any blob may be among them.
    item.in_use = !all_known || (item.is_named && use->second.in_use);
    items->push_back(std::move(item));
  }
  const std::set<std::string> under_way = claims_.Blobs();
  for (const StoredBlob& upload : blobs_.ListUploads()) {
    KeptItem item{.kind = KeptKind::kUpload, .blob = upload.digest};
    item.in_use = under_way.contains(upload.digest.sha256_hex);
    item.size_bytes = upload.digest.size_bytes;
    item.unused_since = now - absl::FromChrono(upload.age);
    items->push_back(std::move(item));
  }
}

absl::StatusOr<std::vector<std::string>> DiskKeeper::FilesOf(const BlobDigest& scene) {
  const auto known = files_.find(scene.sha256_hex);
  if (known != files_.end()) return known->second;
  const absl::StatusOr<std::string> bytes = blobs_.ReadChunk(scene, 0, kManifestBytesMax);
  if (!bytes.ok()) return bytes.status();
  const absl::StatusOr<Manifest> manifest = DecodeManifest(*bytes);
  // A worker says so; it names nothing.
  if (!manifest.ok()) return std::vector<std::string>();
  std::vector<std::string> names;
  for (const ManifestFile& file : manifest->files) names.push_back(file.digest.sha256_hex);
  return names;
}

void DiskKeeper::AddMetrics(std::vector<MetricView>* metrics) const {
  using Kind = MetricView::Kind;
  const MutexLock lock(&counts_mutex_);
  for (size_t kind = 0; kind < counts_.size(); ++kind) {
    metrics->push_back({"sheaf_retention_removed_total", "Items removed to keep the disk free.",
                        Kind::kCounter, "kind", KeptKindName(static_cast<KeptKind>(kind)),
                        static_cast<double>(counts_[kind].removed)});
  }
  for (size_t kind = 0; kind < counts_.size(); ++kind) {
    metrics->push_back({"sheaf_retention_removed_bytes_total", "Its bytes.", Kind::kCounter, "kind",
                        KeptKindName(static_cast<KeptKind>(kind)),
                        static_cast<double>(counts_[kind].bytes)});
  }
  if (limits_.bytes_max == UINT64_MAX) return;  // It is not measured.
  metrics->push_back({"sheaf_state_bytes", "Bytes below the state directory.", Kind::kGauge, "", "",
                      static_cast<double>(state_bytes_)});
}

}  // namespace sheaf::coordinator
