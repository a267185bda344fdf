// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/promises.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"

namespace sheaf::sim {
namespace {

using coordinator::FrameId;
using coordinator::JobPhase;
using coordinator::PartKey;
using coordinator::PartRow;
using coordinator::StoredJob;

template <typename Value>
void Note(bool certain, Value value, Possibly<Value>* possibly) {
  if (certain) {
    possibly->Set(std::move(value));
  } else {
    possibly->MaySet(std::move(value));
  }
}

// Compares a value that a life found with what it may be. Returns whether it is right.
template <typename Value>
bool Adopt(const Value& found, Possibly<Value>* possibly) {
  const bool right = possibly->MayBe(found);
  possibly->Set(found);
  return right;
}

}  // namespace

std::string Promises::NameOf(const PartKey& key) {
  return absl::StrCat(key.tile.x0, "_", key.tile.y0, "-", key.block.first, "-", key.block.count,
                      "-", key.cells.mask, "-", TaskKindName(key.kind));
}

void Promises::Created(uint64_t job_id, const coordinator::JobSpec& spec, bool certain) {
  if (!certain) return;  // Its id is not known.
  PromisedJob& job = jobs_[job_id];
  job.phase.Set(static_cast<int>(JobPhase::kLive));
  job.paused.Set(false);
  job.priority.Set(spec.priority);
  for (const coordinator::FrameSpec& frame : spec.frames) job.delivered[frame.frame_number];
}

void Promises::Ended(uint64_t job_id, JobPhase phase, bool certain) {
  Note(certain, static_cast<int>(phase), &jobs_[job_id].phase);
  Note(certain, false, &jobs_[job_id].paused);
}

void Promises::Paused(uint64_t job_id, bool paused, bool certain) {
  Note(certain, paused, &jobs_[job_id].paused);
}

void Promises::Prioritized(uint64_t job_id, int32_t priority, bool certain) {
  Note(certain, priority, &jobs_[job_id].priority);
}

void Promises::Reopened(uint64_t job_id, const std::vector<int32_t>& frames, bool certain) {
  PromisedJob& job = jobs_[job_id];
  Note(certain, static_cast<int>(JobPhase::kLive), &job.phase);
  for (const int32_t frame : frames) Note(certain, std::string(), &job.delivered[frame]);
}

void Promises::Delivered(const FrameId& frame, const std::string& digest, bool certain) {
  PromisedJob& job = jobs_[frame.job_id];
  Note(certain, digest, &job.delivered[frame.frame_number]);
  if (certain) job.shown[frame.frame_number] = digest;
  std::vector<PartRow>& image_parts = image_parts_[frame];
  if (certain) image_parts.clear();
  for (const auto& [name, part] : parts_[frame]) image_parts.push_back(part.row);
}

void Promises::Written(const PartRow& row, bool certain) {
  if (certain) stored_.insert(row.digest.sha256_hex);
  PromisedPart& part = parts_[row.key.frame][NameOf(row.key)];
  if (part.certain && !certain) return;  // It was there.
  part = {row, certain};
}

void Promises::Removed(const PartRow& row, bool certain) {
  auto& parts = parts_[row.key.frame];
  const auto part = parts.find(NameOf(row.key));
  if (part == parts.end()) return;
  Forget(part->second.row);
  part->second.certain = false;
  if (certain) parts.erase(part);
}

void Promises::FrameRemoved(const FrameId& frame, bool certain) {
  for (auto& [name, part] : parts_[frame]) {
    Forget(part.row);
    part.certain = false;
  }
  if (certain) parts_.erase(frame);
}

void Promises::Forget(const PartRow& row) {
  if (!IsLiar(row.identity)) forgotten_[row.key.frame].insert(row.digest.sha256_hex);
}

void Promises::Quarantined(const coordinator::QuarantineRecord& record, bool certain) {
  Note(certain, TrustOf(record), &identities_[record.identity]);
}

void Promises::Lifted(const std::string& identity, bool certain) {
  Note(certain, Trust::kTrusted, &identities_[identity]);
}

void Promises::Started(const std::string& secret) {
  if (!secret_.empty() && secret != secret_) {
    broken_("the secret that proves leases is another one after a restart");
  }
  secret_ = secret;
}

void Promises::CheckQuarantines(const std::vector<coordinator::QuarantineRecord>& records) {
  std::map<std::string, Trust> found;
  for (const auto& [identity, trust] : identities_) found[identity] = Trust::kTrusted;
  for (const auto& record : records) found[record.identity] = TrustOf(record);
  for (const auto& [identity, trust] : found) {
    if (Adopt(trust, &identities_[identity])) continue;
    broken_(absl::StrCat(identity, " is trusted otherwise after a restart than was promised"));
  }
}

bool Promises::IsLiar(const std::string& identity) const {
  const auto found = identities_.find(identity);
  return found != identities_.end() && found->second.IsCertainly(Trust::kLiar);
}

bool Promises::MayBeFalse(const FrameId& frame, bool in_rounds,
                          const std::set<std::string>& false_digests) const {
  const auto forgotten = forgotten_.find(frame);
  const auto was_forgotten = [&](const std::string& digest) {
    return forgotten != forgotten_.end() && forgotten->second.contains(digest);
  };
  const auto is_excuse = [&](const PartRow& part) {
    const std::string& digest = part.digest.sha256_hex;
    // Made with a false field that was lost before anybody knew.
    if (false_digests.contains(part.field) && was_forgotten(part.field)) return true;
    return false_digests.contains(digest) && (!IsLiar(part.identity) || was_forgotten(digest));
  };
  const auto image_parts = image_parts_.find(frame);
  if (image_parts != image_parts_.end() && std::ranges::any_of(image_parts->second, is_excuse)) {
    return true;
  }
  return in_rounds && std::ranges::any_of(false_digests, was_forgotten);
}

std::string Promises::PartOfOtherField(const FrameId& frame, const std::string& field) const {
  const auto parts = parts_.find(frame);
  if (parts == parts_.end()) return "";
  const auto is_field = [](const PartRow& row) { return row.key.kind == TaskKind::kTraining; };
  std::set<std::string> false_fields;
  for (const auto& [name, part] : parts->second) {
    const PartRow& row = part.row;
    if (is_field(row) && IsLiar(row.identity)) false_fields.insert(row.digest.sha256_hex);
  }
  for (const auto& [name, part] : parts->second) {
    const PartRow& row = part.row;
    const std::string& of_part = is_field(row) ? row.digest.sha256_hex : row.field;
    const bool is_removed = IsLiar(row.identity) || false_fields.contains(of_part);
    if (part.certain && !is_removed && of_part != field) return name;
  }
  return "";
}

std::vector<std::string> Promises::Liars() const {
  std::vector<std::string> liars;
  for (const auto& [identity, trust] : identities_) {
    if (IsLiar(identity)) liars.push_back(identity);
  }
  return liars;
}

std::string Promises::LiarWithParts() const {
  for (const auto& [frame, parts] : parts_) {
    for (const auto& [name, part] : parts) {
      if (part.certain && IsLiar(part.row.identity)) return part.row.identity;
    }
  }
  return "";
}

void Promises::CheckJobs(const std::vector<StoredJob>& jobs) {
  std::set<uint64_t> found;
  for (const StoredJob& job : jobs) {
    found.insert(job.spec.job_id);
    CheckJob(job);
  }
  for (const auto& [id, job] : jobs_) {
    if (!found.contains(id)) broken_(absl::StrCat("job ", id, " is gone after a restart"));
  }
}

void Promises::CheckJob(const StoredJob& stored) {
  const uint64_t id = stored.spec.job_id;
  const bool known = jobs_.contains(id);
  if (!known) Created(id, stored.spec, /*certain=*/true);  // Its caller heard of no id.
  PromisedJob& job = jobs_[id];
  if (!Adopt(static_cast<int>(stored.phase), &job.phase)) {
    broken_(absl::StrCat("job ", id, " has phase ", static_cast<int>(stored.phase),
                         " after a restart, which was never promised"));
  }
  if (!Adopt(stored.paused, &job.paused)) {
    broken_(absl::StrCat("job ", id, " is ", stored.paused ? "" : "not ",
                         "paused after a restart, which was never promised"));
  }
  if (!Adopt(stored.spec.priority, &job.priority)) {
    broken_(absl::StrCat("job ", id, " has priority ", stored.spec.priority,
                         " after a restart, which was never promised"));
  }
  std::map<int32_t, std::string> delivered;
  for (const auto& [number, digest] : job.delivered) delivered[number];
  for (const auto& frame : stored.delivered) {
    delivered[frame.frame_number] = frame.delivered.image_digest;
  }
  job.shown = delivered;
  for (const auto& [number, digest] : delivered) {
    if (Adopt(digest, &job.delivered[number])) continue;
    broken_(absl::StrCat("job ", id, ": frame ", number, " has image \"", digest.substr(0, 12),
                         "\" after a restart, which was never promised"));
  }
}

void Promises::CheckParts(uint64_t job_id, const coordinator::JobStore::LoadedParts& parts) {
  std::map<FrameId, std::map<std::string, PromisedPart>> found;
  for (const PartRow& row : parts.rows) {
    found[row.key.frame][NameOf(row.key)] = {row, /*certain=*/true};
    const auto frame = parts_.find(row.key.frame);
    const bool known = frame != parts_.end() && frame->second.contains(NameOf(row.key));
    if (!known) {
      broken_(absl::StrCat("job ", job_id, ": part ", NameOf(row.key), " came from nowhere"));
    }
  }
  const auto begin = parts_.lower_bound({job_id, INT32_MIN});
  const auto end = parts_.upper_bound({job_id, INT32_MAX});
  // A write that failed leaves no bytes, but its row may come back with a new life.
  int64_t uncertain = 0;
  for (auto frame = begin; frame != end; ++frame) {
    uncertain +=
        std::ranges::count_if(frame->second, [](const auto& part) { return !part.second.certain; });
  }
  if (std::ssize(parts.lost) > damaged_count_ + uncertain) {
    broken_(absl::StrCat("job ", job_id, ": ", parts.lost.size(), " rows have no bytes"));
  }
  int64_t missing = 0;
  std::string first_missing;
  for (auto frame = begin; frame != end; ++frame) {
    for (const auto& [name, part] : frame->second) {
      const auto of_frame = found.find(frame->first);
      const bool is_there = of_frame != found.end() && of_frame->second.contains(name);
      if (!is_there) Forget(part.row);
      if (!part.certain || is_there) continue;
      if (missing++ == 0) first_missing = name;
    }
  }
  if (missing > damaged_count_) {
    broken_(absl::StrCat("job ", job_id, ": ", missing, " acknowledged parts are gone after a ",
                         "restart, such as ", first_missing));
  }
  parts_.erase(begin, end);
  parts_.merge(found);
}

// Nothing damages the database's log here: its end may only be one that was interrupted.
void Promises::CheckLog(int64_t lost_commits) const {
  if (lost_commits == 0) return;
  broken_(absl::StrCat("the log of the database lost ", lost_commits, " commits"));
}

uint64_t Promises::PartsBytes() const {
  uint64_t bytes = 0;
  for (const auto& [frame, parts] : parts_) {
    for (const auto& [name, part] : parts) bytes += part.row.digest.size_bytes;
  }
  return bytes;
}

}  // namespace sheaf::sim
