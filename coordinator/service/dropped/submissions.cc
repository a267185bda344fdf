// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/dropped/submissions.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/base/status.h"

namespace sheaf::coordinator {
namespace {

// Bits of sheaf::worker::Protection.
constexpr uint32_t kNamespacesBit = 1, kFileAccessBit = 2, kSystemCallsBit = 4;
constexpr uint32_t kAllProtectionBits = kNamespacesBit | kFileAccessBit | kSystemCallsBit;

// A scene that names the coordinator's own files must not be able to read them, and a scene that
// takes over the process must not be able to communicate.
bool Suffice(uint32_t protections) {
  return (protections & kSystemCallsBit) != 0 &&
         (protections & (kNamespacesBit | kFileAccessBit)) != 0;
}

bool HasEnded(SubmissionState state) {
  return state == SubmissionState::kSubmitted || state == SubmissionState::kRefused;
}

// Whether fewer than count_max of the counted submissions are left; removes the oldest ended one to
// make room.
template <typename Counts, typename Entries>
bool MakeRoomAmong(size_t count_max, const Counts& counts, Entries* entries) {
  size_t count = 0;
  auto ended = entries->end();
  for (auto it = entries->begin(); it != entries->end(); ++it) {
    if (!counts(*it->second)) continue;
    ++count;
    if (ended == entries->end() && HasEnded(it->second->view.state)) ended = it;
  }
  if (count < count_max) return true;
  if (ended == entries->end()) return false;
  entries->erase(ended);
  return true;
}

absl::Status NoSuchSubmissionError(const std::string& id) {
  return absl::NotFoundError(absl::StrCat(
      "submissions/", Printable(id, 40), ": there is none, or it has ended; drop the files again"));
}

absl::Status StateError(const SubmissionView& view, const char* what) {
  return absl::FailedPreconditionError(
      absl::StrCat("submissions/", view.id, " is ", SubmissionStateName(view.state), ": ", what));
}

std::string NotesOf(const v1::PrepareReply& reply) {
  std::string notes;
  for (const std::string& note : reply.notes()) {
    if (notes.size() > kSubmissionTextBytesMax) break;
    absl::StrAppend(&notes, notes.empty() ? "" : "\n", note);
  }
  return notes;
}

// Sanitizes text of an untrusted process.
std::string ForPeople(std::string text) {
  if (text.size() > kSubmissionTextBytesMax) {
    text.resize(kSubmissionTextBytesMax);
    text += " ...";
  }
  return PrintableLines(text);
}

absl::Status StatusOfReply(const v1::PrepareReply& reply) {
  return reply.code() == 0 ? absl::OkStatus()
                           : absl::InvalidArgumentError(ForPeople(reply.message()));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Submissions>> Submissions::Start(SubmissionOptions options,
                                                                JobMaker make_job) {
  std::error_code error;
  std::filesystem::remove_all(options.folder, error);
  if (error) return StatusFromErrno(error.value(), absl::StrCat("emptying ", options.folder));
  if (absl::Status status = MakePrivateDirectory(options.folder); !status.ok()) return status;
  // The process sees the folder under this path, too, in which it cannot follow links.
  options.folder = std::filesystem::canonical(options.folder, error).string();
  if (error) return StatusFromErrno(error.value(), "finding the folder of submissions");
  std::unique_ptr<Submissions> desk(new Submissions(std::move(options), std::move(make_job)));
  {
    const MutexLock lock(&desk->mutex_);
    desk->protections_ = kAllProtectionBits;
  }
  if (!desk->options_.why_not.empty()) return desk;
  for (size_t i = 0; i < kSceneReadersMax; ++i) {
    desk->readers_.emplace_back(
        [raw = desk.get()](const std::stop_token& stop) { raw->ReadInTurn(stop); });
  }
  return desk;
}

Submissions::~Submissions() {
  for (std::jthread& reader : readers_) reader.request_stop();
  readers_.clear();
  const MutexLock lock(&mutex_);
  waiting_.clear();
  entries_.clear();
  std::error_code ignored;
  std::filesystem::remove_all(options_.folder, ignored);
}

SubmissionOffer Submissions::Offer() const {
  return {options_.why_not, options_.limits.bytes_max, options_.limits.files_max, kPieceBytesMax};
}

absl::StatusOr<std::shared_ptr<Submissions::Submission>> Submissions::FindOf(
    const SubmissionCaller& caller, const std::string& id) const {
  uint64_t number = 0;
  if (!absl::SimpleAtoi(id, &number)) return NoSuchSubmissionError(id);
  const auto found = entries_.find(number);
  if (found == entries_.end() || found->second->caller.owner != caller.owner) {
    return NoSuchSubmissionError(id);
  }
  return found->second;
}

void Submissions::EndSilent(SteadyTime now) {
  std::erase_if(entries_, [&](const auto& entry) {
    const Submission& submission = *entry.second;
    return submission.view.state != SubmissionState::kReading &&
           now - submission.heard > kSubmissionSilenceMax;
  });
}

absl::Status Submissions::MakeRoom(const std::string& owner) {
  const auto is_owners = [&](const Submission& other) { return other.caller.owner == owner; };
  if (!MakeRoomAmong(kSubmissionsOfOwnerMax, is_owners, &entries_)) {
    return absl::ResourceExhaustedError(
        absl::StrCat(owner, " has ", kSubmissionsOfOwnerMax,
                     " submissions under way, the limit; wait until one has ended"));
  }
  const auto is_any = [](const Submission&) { return true; };
  if (!MakeRoomAmong(kSubmissionsMax, is_any, &entries_)) {
    return absl::ResourceExhaustedError(
        absl::StrCat(kSubmissionsMax, " submissions are under way, the limit; try again later"));
  }
  return absl::OkStatus();
}

absl::StatusOr<SubmissionView> Submissions::Begin(const SubmissionCaller& caller) {
  if (!options_.why_not.empty()) return absl::FailedPreconditionError(options_.why_not);
  const SteadyTime now = SteadyTime::Now();
  const MutexLock lock(&mutex_);
  EndSilent(now);
  if (absl::Status status = MakeRoom(caller.owner); !status.ok()) return status;
  const uint64_t id = next_id_++;
  absl::StatusOr<std::unique_ptr<DroppedFiles>> files = DroppedFiles::Create(
      absl::StrCat(options_.folder, "/", id), options_.limits, options_.write_with_space);
  if (!files.ok()) return files.status();
  auto submission = std::make_shared<Submission>();
  submission->caller = caller;
  submission->view.id = absl::StrCat(id);
  submission->files = *std::move(files);
  submission->heard = now;
  entries_[id] = submission;
  return submission->view;
}

absl::StatusOr<uint64_t> Submissions::Append(const SubmissionCaller& caller, const std::string& id,
                                             const std::string& name, uint64_t offset_bytes,
                                             std::string_view bytes) {
  if (bytes.size() > kPieceBytesMax) {
    return absl::InvalidArgumentError(
        absl::StrCat("a piece has at most ", kPieceBytesMax, " bytes; send the rest after it"));
  }
  // Writes go to the page cache; requests are sequential anyway.
  const MutexLock lock(&mutex_);
  absl::StatusOr<std::shared_ptr<Submission>> found = FindOf(caller, id);
  if (!found.ok()) return found.status();
  Submission& submission = **found;
  if (submission.view.state != SubmissionState::kReceiving) {
    return StateError(submission.view, "it takes no further files");
  }
  submission.heard = SteadyTime::Now();
  absl::StatusOr<uint64_t> size = submission.files->Append(name, offset_bytes, bytes);
  submission.view.received_bytes = submission.files->bytes();
  submission.view.file_count = submission.files->file_count();
  return size;
}

absl::StatusOr<SubmissionView> Submissions::Read(const SubmissionCaller& caller,
                                                 const std::string& id,
                                                 const SubmissionWish& wish) {
  const MutexLock lock(&mutex_);
  const absl::StatusOr<std::shared_ptr<Submission>> found = FindOf(caller, id);
  if (!found.ok()) return found.status();
  Submission& submission = **found;
  const SubmissionState state = submission.view.state;
  if (state != SubmissionState::kReceiving && state != SubmissionState::kChoosing) {
    return StateError(submission.view, "its scene is being read, or has been");
  }
  if (submission.view.file_count == 0) {
    return absl::InvalidArgumentError("no file was dropped; drop a scene with its files");
  }
  submission.wish = wish;
  submission.heard = SteadyTime::Now();
  submission.view.state = SubmissionState::kReading;
  submission.view.scenes.clear();
  waiting_.push_back(*found);
  changed_.NotifyOne();
  return submission.view;
}

absl::StatusOr<SubmissionView> Submissions::Find(const SubmissionCaller& caller,
                                                 const std::string& id) const {
  const MutexLock lock(&mutex_);
  const absl::StatusOr<std::shared_ptr<Submission>> found = FindOf(caller, id);
  if (!found.ok()) return found.status();
  return (*found)->view;
}

absl::Status Submissions::Discard(const SubmissionCaller& caller, const std::string& id) {
  std::shared_ptr<Submission> discarded;  // Its files are removed without the lock.
  const MutexLock lock(&mutex_);
  const absl::StatusOr<std::shared_ptr<Submission>> found = FindOf(caller, id);
  if (!found.ok()) return found.status();
  if ((*found)->view.state == SubmissionState::kReading) {
    return StateError((*found)->view, "wait until the scene is read");
  }
  discarded = *found;
  uint64_t number = 0;
  if (absl::SimpleAtoi(id, &number)) entries_.erase(number);
  return absl::OkStatus();
}

void Submissions::ReadInTurn(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::shared_ptr<Submission> next;
    {
      const MutexLock lock(&mutex_);
      changed_.WaitFor(&mutex_, stop, kSubmissionSilenceMax / 4,
                       [this]()
                           ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return !waiting_.empty(); });
      EndSilent(SteadyTime::Now());
      if (waiting_.empty() || stop.stop_requested()) continue;
      next = waiting_.front();
      waiting_.pop_front();
    }
    ReadOne(next.get(), stop);
  }
}

absl::StatusOr<v1::PrepareReply> Submissions::ReadConfined(DroppedFiles* files,
                                                           const SubmissionWish& wish,
                                                           const std::stop_token& stop) {
  v1::PrepareRequest request;
  request.set_scene(wish.scene);
  request.set_title(wish.title);
  request.set_samples(wish.samples);
  request.set_target_error(wish.target_error);
  uint32_t protections = 0;
  {
    const MutexLock lock(&mutex_);
    protections = protections_;
  }
  while (true) {
    if (absl::Status status = files->ClearScratch(); !status.ok()) return status;
    request.set_protections(protections);
    absl::StatusOr<v1::PrepareReply> reply =
        ReadDroppedScene(options_.program, files->folder(), request, options_.reader, stop);
    if (!reply.ok() || reply->code() == 0) return reply;
    const uint32_t missing = reply->missing_protection() & protections;
    if (missing == 0) return reply;
    protections &= ~missing;
    if (!Suffice(protections)) {
      return absl::FailedPreconditionError(absl::StrCat(
          "this machine cannot confine a process that reads a scene: ", ForPeople(reply->message()),
          "; use sheaf submit, which reads it on yours"));
    }
    LogInfo(absl::StrCat("dropped scenes are read with fewer protections: ",
                         ForPeople(reply->message())));
    const MutexLock lock(&mutex_);
    protections_ = protections;
  }
}

void Submissions::ReadOne(Submission* submission, const std::stop_token& stop) {
  // While it is being read, only `heard` changes.
  DroppedFiles* files = nullptr;
  SubmissionWish wish;
  SubmissionCaller caller;
  {
    const MutexLock lock(&mutex_);
    files = submission->files.get();
    wish = submission->wish;
    caller = submission->caller;
  }
  const absl::StatusOr<v1::PrepareReply> reply = ReadConfined(files, wish, stop);
  absl::Status status = reply.ok() ? StatusOfReply(*reply) : reply.status();
  if (!status.ok()) return Finish(submission, status);
  if (reply->scenes_size() > 0) {
    const MutexLock lock(&mutex_);
    submission->view.state = SubmissionState::kChoosing;
    for (const std::string& scene : reply->scenes()) {
      submission->view.scenes.push_back(ForPeople(scene));
    }
    submission->heard = SteadyTime::Now();
    return;
  }
  const absl::StatusOr<std::string> job = make_job_(caller, files->folder(), *reply);
  if (job.ok()) {
    const MutexLock lock(&mutex_);
    submission->view.job_id = *job;
    submission->view.messages = ForPeople(NotesOf(*reply));
  }
  Finish(submission, job.status());
}

void Submissions::Finish(Submission* submission, const absl::Status& status) {
  std::unique_ptr<DroppedFiles> files;
  {
    const MutexLock lock(&mutex_);
    files = std::move(submission->files);
  }
  files.reset();  // Without the lock, and before the end is visible.
  const MutexLock lock(&mutex_);
  submission->heard = SteadyTime::Now();
  submission->view.state = status.ok() ? SubmissionState::kSubmitted : SubmissionState::kRefused;
  if (!status.ok()) submission->view.messages = std::string(status.message());
}

}  // namespace sheaf::coordinator
