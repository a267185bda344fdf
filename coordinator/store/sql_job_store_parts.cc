// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The calls of SqlJobStore about parts and their bytes: first the object, then the row, then the
// call returns OK.
#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "coordinator/store/part_rows.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/usage_rows.h"

namespace sheaf::coordinator {
namespace {

// The maximum parts of a group: their rows occupy the database for some milliseconds.
constexpr size_t kGroupPartsMax = 1024;
Usage UsageOfPart(const PartRow& row) {
  return {.result_count = 1,
          .sample_count = row.sample_count,
          .ray_count = row.cost.ray_count,
          .cpu_duration = row.cost.cpu_duration,
          .part_bytes = row.digest.size_bytes};
}

}  // namespace

// Takes all names at once, so that no call waits for another one while it holds some.
class SqlJobStore::NameReservation {
 public:
  NameReservation(SqlJobStore* store, std::set<std::string> names)
      : store_(*store), names_(std::move(names)) {
    const MutexLock lock(&store_.pending_mutex_);
    const auto is_free = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(store_.pending_mutex_) {
      return std::ranges::none_of(names_, [this](const std::string& name)
                                              ABSL_EXCLUSIVE_LOCKS_REQUIRED(store_.pending_mutex_) {
                                                return store_.names_.contains(name);
                                              });
    };
    store_.name_released_.Wait(&store_.pending_mutex_, is_free);
    store_.names_.insert(names_.begin(), names_.end());
  }
  ~NameReservation() {
    const MutexLock lock(&store_.pending_mutex_);
    for (const std::string& name : names_) store_.names_.erase(name);
    store_.name_released_.NotifyAll();
  }
  NameReservation(const NameReservation&) = delete;
  NameReservation& operator=(const NameReservation&) = delete;

 private:
  SqlJobStore& store_;
  const std::set<std::string> names_;
};

std::string SqlJobStore::FolderOf(const FrameId& frame) {
  return absl::StrCat(frame.job_id, "/", frame.frame_number, "/");
}

std::string SqlJobStore::NameOf(const PartRow& row) {
  const PixelRect& t = row.key.tile;
  return absl::StrCat(FolderOf(row.key.frame), t.x0, "_", t.y0, "_", t.x1, "_", t.y1, "-",
                      row.key.block.first, "-", row.key.block.count, "-",
                      row.digest.sha256_hex.substr(0, 16),
                      row.key.kind == TaskKind::kTraining ? ".field" : ".exr");
}

std::string SqlJobStore::PartPath(const PartRow& row) const {
  return absl::StrCat(directory_, "/parts/", NameOf(row));
}

absl::Status SqlJobStore::WritePart(const PartRow& row, const std::string& bytes) {
  const NewPart part{&row, &bytes};
  return WriteParts({&part, 1}).front();
}

std::vector<absl::Status> SqlJobStore::WriteParts(std::span<const NewPart> parts) {
  std::set<std::string> names;
  for (const NewPart& part : parts) names.insert(NameOf(*part.row));
  const NameReservation reservation(this, std::move(names));
  std::vector<absl::Status> statuses(parts.size());
  PendingCall written;
  std::vector<size_t> places;  // In parts, of the call's rows.
  for (size_t i = 0; i < parts.size(); ++i) {
    statuses[i] = WriteObject(*parts[i].row, *parts[i].bytes);
    if (!statuses[i].ok()) continue;
    written.rows.push_back(parts[i].row);
    places.push_back(i);
  }
  CommitParts(&written);
  for (size_t i = 0; i < places.size(); ++i) {
    const NewPart& part = parts[places[i]];
    absl::Status& status = statuses[places[i]] = written.statuses[i];
    if (status.ok()) {
      parts_bytes_ += part.bytes->size();
    } else {
      RemoveUnlessAcknowledged(*part.row, status);
    }
  }
  return statuses;
}

void SqlJobStore::RemoveUnlessAcknowledged(const PartRow& row, const absl::Status& failed) {
  // If coordinators share the store, the object may belong to the one that took over. LoadParts
  // removes it if no row names it.
  if (shared_ && !absl::IsAlreadyExists(failed)) return;
  // A store without conditional writes has replaced the object of an equal part.
  const absl::StatusOr<std::optional<PartRow>> existing = FindPart(row.key);
  if (!existing.ok()) return;
  if (existing->has_value() && (*existing)->digest == row.digest) return;
  parts_->Remove(NameOf(row)).IgnoreError();  // A remaining object has no row.
}

absl::Status SqlJobStore::AddStoredPart(const PartRow& row, const std::string& bytes) {
  const NameReservation reservation(this, {NameOf(row)});
  const absl::StatusOr<std::optional<PartRow>> existing = FindPart(row.key);
  if (!existing.ok()) return existing.status();
  if (existing->has_value()) return absl::AlreadyExistsError("the part already exists");
  // An earlier part of the same name may have been removed since this one was stored.
  const absl::StatusOr<uint64_t> size_bytes = parts_->Head(NameOf(row));
  const bool is_there = size_bytes.ok() && *size_bytes == row.digest.size_bytes;
  absl::Status status = is_there ? absl::OkStatus() : WriteObject(row, bytes);
  PendingCall stored;
  stored.rows.push_back(&row);
  if (status.ok()) {
    CommitParts(&stored);
    status = stored.statuses.front();
  }
  if (status.ok()) parts_bytes_ += bytes.size();
  return status;
}

absl::Status SqlJobStore::WriteObject(const PartRow& row, const std::string& bytes) {
  const std::string name = NameOf(row);
  absl::Status status = parts_->Put(name, bytes, PutMode::kIfAbsent);
  if (absl::IsAlreadyExists(status)) {
    // Only an equal part has the same name. The object of one that has a row is not touched;
    // without a row it was never acknowledged.
    const absl::StatusOr<std::optional<PartRow>> existing = FindPart(row.key);
    if (!existing.ok()) return existing.status();
    if (existing->has_value()) return absl::AlreadyExistsError("the part already exists");
    status = parts_->Put(name, bytes, PutMode::kReplace);
  }
  if (!absl::IsPermissionDenied(status) && !absl::IsFailedPrecondition(status)) return status;
  // These codes would tell a worker that its result is refused, or must be sent in another way.
  return absl::UnavailableError(std::string(status.message()));
}

std::optional<PutTicket> SqlJobStore::TicketFor(const PartRow& row) {
  return parts_->TicketToPut(NameOf(row), {row.digest.sha256_hex, row.digest.size_bytes});
}

// The first caller commits the parts of all waiting calls; calls that arrive meanwhile form the
// next group, which the first of them commits. Each call waits only for its own parts, so that the
// end of a group does not wake other calls.
void SqlJobStore::CommitParts(PendingCall* mine) {
  mine->statuses.resize(mine->rows.size());
  if (mine->rows.empty()) return;
  MutexLock lock(&pending_mutex_);
  pending_.push_back(mine);
  mine->leads = !std::exchange(committing_, true);
  mine->changed.Wait(&pending_mutex_, [mine] { return mine->finished || mine->leads; });
  if (mine->finished) return;
  const std::vector<PendingCall*> group = TakeGroup();
  lock.Unlock();
  CommitGroup(group);
  lock.Lock();
  for (PendingCall* call : group) {
    call->finished = true;
    call->changed.NotifyOne();
  }
  committing_ = !pending_.empty();
  if (committing_) {
    pending_.front()->leads = true;
    pending_.front()->changed.NotifyOne();
  }
}

std::vector<SqlJobStore::PendingCall*> SqlJobStore::TakeGroup() {
  std::vector<PendingCall*> group;
  size_t part_count = 0;
  while (!pending_.empty()) {
    part_count += pending_.front()->rows.size();
    if (!group.empty() && part_count > kGroupPartsMax) break;
    group.push_back(pending_.front());
    pending_.pop_front();
  }
  return group;
}

void SqlJobStore::CommitGroup(const std::vector<PendingCall*>& calls) {
  absl::Status shared = parts_->Sync();
  if (shared.ok()) shared = CommitRows(calls);
  if (shared.ok()) return;
  for (PendingCall* call : calls) std::ranges::fill(call->statuses, shared);
}

absl::Status SqlJobStore::CommitRows(const std::vector<PendingCall*>& calls) {
  std::vector<const PartRow*> of_parts;
  for (const PendingCall* call : calls) {
    of_parts.insert(of_parts.end(), call->rows.begin(), call->rows.end());
  }
  std::vector<absl::Status> outcomes;
  const MutexLock lock(&database_mutex_);
  absl::Status status =
      database_->InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
        absl::Status inserted = rows::InsertParts(of_parts, &outcomes, database_.get());
        if (!inserted.ok()) return inserted;
        std::map<uint64_t, Usage> by_job;
        for (size_t i = 0; i < of_parts.size(); ++i) {
          if (!outcomes[i].ok()) continue;  // Its key has a row already.
          by_job[of_parts[i]->key.frame.job_id] += UsageOfPart(*of_parts[i]);
        }
        // In the transaction of the rows: it costs no extra commit, and the two always agree.
        for (const auto& [job_id, usage] : by_job) {
          absl::Status added = rows::AddUsage({job_id}, usage, database_.get());
          if (!added.ok()) return added;
        }
        return absl::OkStatus();
      });
  if (!status.ok()) return status;
  auto outcome = outcomes.begin();
  for (PendingCall* call : calls) {
    for (absl::Status& told : call->statuses) told = *outcome++;
  }
  return status;
}

absl::StatusOr<JobStore::LoadedParts> SqlJobStore::LoadParts(uint64_t job_id) {
  LoadedParts loaded;
  std::vector<PartRow> with_row;
  {
    const MutexLock lock(&database_mutex_);
    absl::StatusOr<std::vector<PartRow>> all =
        rows::LoadPartRows(job_id, &loaded.lost, database_.get());
    if (!all.ok()) return all.status();
    with_row = std::move(*all);
  }
  std::map<std::string, uint64_t> stored;  // Sizes by name.
  absl::Status listed = parts_->List(
      absl::StrCat(job_id, "/"),
      [&stored](const StoredObject& object) { stored[object.key] = object.size_bytes; });
  if (!listed.ok()) return listed;
  std::set<std::string> known, lost;
  for (const PartRow& row : loaded.lost) lost.insert(NameOf(row));
  for (PartRow& row : with_row) {
    const std::string name = NameOf(row);
    const auto object = stored.find(name);
    if (object == stored.end() || object->second != row.digest.size_bytes) {
      lost.insert(name);
      loaded.lost.push_back(std::move(row));
      continue;
    }
    known.insert(name);
    loaded.rows.push_back(std::move(row));
  }
  for (const auto& [name, size_bytes] : stored) {
    if (known.contains(name)) continue;
    if (!lost.contains(name) && name.ends_with(".exr")) ++loaded.files_without_row;
    parts_->Remove(name).IgnoreError();  // Nothing reads it.
  }
  return loaded;
}

absl::StatusOr<std::string> SqlJobStore::ReadPart(const PartRow& row) {
  return parts_->Get(NameOf(row), {row.digest.sha256_hex, row.digest.size_bytes});
}

absl::Status SqlJobStore::RemovePart(const PartRow& row) {
  absl::StatusOr<uint64_t> bytes = 0;
  {
    const MutexLock lock(&database_mutex_);
    bytes = rows::DeletePart(row.key, database_.get());
  }
  if (!bytes.ok()) return bytes.status();
  parts_bytes_ -= std::min<uint64_t>(*bytes, parts_bytes_);
  // A remaining object has no row, and is removed with its frame or at the next start.
  const absl::Status gone = parts_->Remove(NameOf(row));
  if (!gone.ok()) LogWarning(absl::StrCat("removing a part: ", gone.message()));
  return absl::OkStatus();
}

absl::Status SqlJobStore::RemoveFrameParts(const FrameId& frame) {
  absl::StatusOr<uint64_t> bytes = 0;
  {
    const MutexLock lock(&database_mutex_);
    bytes = rows::DeleteFrameParts(frame, database_.get());
  }
  if (!bytes.ok()) return bytes.status();
  parts_bytes_ -= std::min<uint64_t>(*bytes, parts_bytes_);
  const absl::Status gone = parts_->RemoveFolder(FolderOf(frame));
  if (!gone.ok()) {
    LogWarning(
        absl::StrCat("removing parts; some are left until the next start: ", gone.message()));
  }
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
