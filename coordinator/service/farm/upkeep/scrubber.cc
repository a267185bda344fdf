// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/upkeep/scrubber.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/log.h"

namespace sheaf::coordinator {
namespace {

// The pause between two passes, so that a small store is not read continuously.
constexpr absl::Duration kPassPause = absl::Hours(1);
// At a start other work comes first.
constexpr absl::Duration kFirstPause = absl::Seconds(2);
constexpr absl::Duration kLookAgainInterval = absl::Seconds(1);
// Damaged items that are remembered until they are whole again; others are only counted.
constexpr size_t kDamagedMax = 10'000;

std::string NameOf(const PartKey& key) {
  return absl::StrCat("a part of jobs/", key.frame.job_id, "/frames/", key.frame.frame_number,
                      ", tile ", key.tile.x0, ",", key.tile.y0, ", samples from ", key.block.first,
                      " on, cells ", key.cells.mask, ", kind ", static_cast<int>(key.kind));
}

}  // namespace

const char* Scrubber::KindName(Kind kind) {
  switch (kind) {
    case Kind::kBlob:
      return "blob";
    case Kind::kPart:
      return "part";
    case Kind::kImage:
      return "image";
  }
  return "unknown";
}

void Scrubber::Run(const std::stop_token& stop) {
  SteadyTime next_pass = SteadyTime::Now() + kFirstPause;
  while (SleepUnlessStopped(kLookAgainInterval, stop)) {
    LookAgain();
    if (SteadyTime::Now() < next_pass) continue;
    if (!Pass(stop)) return;
    next_pass = SteadyTime::Now() + kPassPause;
  }
}

bool Scrubber::Pass(const std::stop_token& stop) {
  for (const StoredBlob& blob : parts_.blobs.List()) {
    const BlobDigest& digest = blob.digest;
    const absl::Status verified = parts_.blobs.Verify(digest);
    if (verified.ok()) ScrubObject(digest);
    if (absl::IsDataLoss(verified)) {
      NoteDamage(Kind::kBlob, digest.sha256_hex, [this, digest] {
        return parts_.blobs.PathOf(digest).ok() ? State::kWhole : State::kDamaged;
      });
    }
    if (!Pace(digest.size_bytes, stop)) return false;
  }
  std::vector<uint64_t> jobs;
  {
    const MutexLock lock(&parts_.tables.mutex);
    for (const auto& [id, job] : parts_.tables.scheduler.jobs()) jobs.push_back(id);
  }
  for (const uint64_t id : jobs) {
    if (!PassJob(id, stop)) return false;
  }
  const MutexLock lock(&mutex_);
  last_pass_ = absl::Now();
  return true;
}

void Scrubber::ScrubObject(const BlobDigest& digest) {
  const absl::StatusOr<bool> repaired = parts_.blobs.RepairObject(digest);
  if (!repaired.ok()) {
    LogWarning(absl::StrCat("comparing a file in the object store: ", repaired.status().message()));
  }
  if (!repaired.value_or(false)) return;
  LogWarning(absl::StrCat("scrubbing: lost or damaged in the object store, and stored again: blob ",
                          digest.sha256_hex));
  const MutexLock lock(&mutex_);
  ++damaged_count_.at(static_cast<size_t>(Kind::kBlob));
  ++repaired_count_.at(static_cast<size_t>(Kind::kBlob));
}

Scrubber::Frames Scrubber::FramesOf(uint64_t job_id) const {
  Frames frames;
  const MutexLock lock(&parts_.tables.mutex);
  const auto job = parts_.tables.scheduler.jobs().find(job_id);
  if (job == parts_.tables.scheduler.jobs().end()) return frames;
  frames.is_remade = job->second.phase == JobPhase::kSucceeded && !IsPilot(job_id);
  for (const auto& [number, delivered] : parts_.tables.accounts.at(job_id).delivered) {
    frames.delivered.insert(number);
  }
  return frames;
}

bool Scrubber::PassJob(uint64_t job_id, const std::stop_token& stop) {
  const Frames frames = FramesOf(job_id);
  if (frames.delivered.empty()) return true;
  const absl::StatusOr<std::vector<PartRow>> rows = parts_.store.ListParts(job_id);
  if (!rows.ok()) {
    LogWarning(absl::StrCat("comparing the parts of job ", job_id, ": ", rows.status().message()));
    return true;
  }
  for (const PartRow& row : *rows) {
    if (!frames.delivered.contains(row.key.frame.frame_number)) continue;
    ScrubPart(row, frames.is_remade);
    if (!Pace(row.digest.size_bytes, stop)) return false;
  }
  for (const int32_t number : frames.delivered) {
    const FrameId id{job_id, number};
    const absl::StatusOr<uint64_t> size_bytes = parts_.images.Verify(id);
    if (absl::IsFailedPrecondition(size_bytes.status())) {
      NoteDamage(Kind::kImage, absl::StrCat("jobs/", job_id, "/frames/", number),
                 [this, id] { return StateOfImage(id); });
    }
    if (!Pace(size_bytes.value_or(0), stop)) return false;
  }
  return true;
}

void Scrubber::ScrubPart(const PartRow& row, bool is_remade) {
  const absl::StatusOr<std::string> bytes = parts_.store.ReadPart(row);
  const bool is_damaged = absl::IsDataLoss(bytes.status()) || absl::IsNotFound(bytes.status());
  if (!is_damaged) return;
  // It may have been removed, or its frame restarted, since it was listed.
  const absl::StatusOr<std::optional<PartRow>> row_now = parts_.store.FindPart(row.key);
  const bool is_there = row_now.ok() && row_now->has_value() && (*row_now)->digest == row.digest;
  const FrameId& id = row.key.frame;
  if (!is_there || !FramesOf(id.job_id).delivered.contains(id.frame_number)) return;
  parts_.removals.Remove({row});
  absl::Status remade;
  if (is_remade) remade = parts_.jobs.RemakeFrames(id.job_id, {id.frame_number});
  // Parts of other jobs are rendered again by what needs them, if anything does.
  const bool comes_back = is_remade && remade.ok();
  NoteDamage(Kind::kPart, NameOf(row.key),
             [this, row, comes_back] { return comes_back ? StateOfPart(row) : State::kGone; });
  if (!remade.ok()) {
    LogError(
        absl::StrCat("rendering a damaged part of job ", id.job_id, " again: ", remade.message()));
  }
}

Scrubber::State Scrubber::StateOfPart(const PartRow& row) const {
  {
    const MutexLock lock(&parts_.tables.mutex);
    if (parts_.tables.scheduler.FindFrame(row.key.frame) == nullptr) return State::kGone;
  }
  const absl::StatusOr<std::optional<PartRow>> found = parts_.store.FindPart(row.key);
  if (!found.ok() || !found->has_value()) {
    // A different division of the same samples also repairs it.
    return FramesOf(row.key.frame.job_id).delivered.contains(row.key.frame.frame_number)
               ? State::kWhole
               : State::kDamaged;
  }
  return parts_.store.ReadPart(**found).ok() ? State::kWhole : State::kDamaged;
}

Scrubber::State Scrubber::StateOfImage(const FrameId& id) const {
  {
    const MutexLock lock(&parts_.tables.mutex);
    if (parts_.tables.scheduler.FindFrame(id) == nullptr) return State::kGone;
  }
  if (!FramesOf(id.job_id).delivered.contains(id.frame_number)) return State::kDamaged;
  return parts_.images.FindDelivered(id).ok() ? State::kWhole : State::kDamaged;
}

bool Scrubber::Pace(uint64_t bytes, const std::stop_token& stop) {
  {
    const MutexLock lock(&mutex_);
    bytes_ += bytes;
  }
  absl::Duration left = absl::Seconds(static_cast<double>(bytes)) / bytes_per_second_;
  while (left > absl::ZeroDuration()) {
    const absl::Duration slice = std::min(left, kLookAgainInterval);
    if (!SleepUnlessStopped(slice, stop)) return false;
    left -= slice;
    LookAgain();
  }
  return !stop.stop_requested();
}

void Scrubber::NoteDamage(Kind kind, const std::string& name, std::function<State()> now) {
  if (damaged_.contains({kind, name})) return;
  LogWarning(absl::StrCat("scrubbing: damaged on disk: ", KindName(kind), " ", name));
  if (damaged_.size() < kDamagedMax) damaged_[{kind, name}] = std::move(now);
  const MutexLock lock(&mutex_);
  ++damaged_count_.at(static_cast<size_t>(kind));
}

void Scrubber::LookAgain() {
  if (damaged_.empty() || SteadyTime::Now() < next_look_) return;
  next_look_ = SteadyTime::Now() + kLookAgainInterval;
  for (auto it = damaged_.begin(); it != damaged_.end();) {
    const State state = it->second();
    if (state == State::kDamaged) {
      ++it;
      continue;
    }
    if (state == State::kWhole) {
      LogInfo(absl::StrCat("scrubbing: whole again: ", KindName(it->first.first), " ",
                           it->first.second));
      const MutexLock lock(&mutex_);
      ++repaired_count_.at(static_cast<size_t>(it->first.first));
    }
    it = damaged_.erase(it);
  }
}

void Scrubber::AddMetrics(std::vector<MetricView>* metrics) const {
  using MetricKind = MetricView::Kind;
  const MutexLock lock(&mutex_);
  metrics->push_back({"sheaf_scrub_bytes_total", "Stored bytes compared with their digests.",
                      MetricKind::kCounter, "", "", static_cast<double>(bytes_)});
  for (size_t kind = 0; kind < kKindCount; ++kind) {
    metrics->push_back({"sheaf_scrub_damaged_total", "Damaged items found by scrubbing.",
                        MetricKind::kCounter, "kind", KindName(static_cast<Kind>(kind)),
                        static_cast<double>(damaged_count_[kind])});
  }
  for (size_t kind = 0; kind < kKindCount; ++kind) {
    metrics->push_back({"sheaf_scrub_repaired_total", "Damaged items that are whole again.",
                        MetricKind::kCounter, "kind", KindName(static_cast<Kind>(kind)),
                        static_cast<double>(repaired_count_[kind])});
  }
  metrics->push_back(
      {"sheaf_scrub_last_pass_seconds", "Time of the last complete scrub (Unix time); 0: not yet.",
       MetricKind::kGauge, "", "", absl::ToDoubleSeconds(last_pass_ - absl::UnixEpoch())});
}

}  // namespace sheaf::coordinator
