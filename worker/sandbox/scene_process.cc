// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/scene_process.h"

#include <poll.h>
#include <signal.h>
#include <string.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/base/status.h"
#include "worker/sandbox/scene_messages.h"

namespace sheaf::worker {
namespace {

// The time in which a process that has closed its socket must end on its own.
constexpr absl::Duration kEndTimeMax = absl::Seconds(5);

// The time that a process has to end a call that is cancelled: it looks for that far more often.
constexpr absl::Duration kCancelTimeMax = absl::Seconds(5);

constexpr char kOutOfMemoryAdvice[] =
    "; make the scene smaller, or give this worker more memory or fewer --threads";

}  // namespace

absl::StatusOr<std::unique_ptr<SceneProcess>> SceneProcess::Start(const SceneProgram& program,
                                                                  Protections protections) {
  std::unique_ptr<SceneProcess> process(new SceneProcess());
  process->thread_ =
      std::jthread([raw = process.get(), program, protections] { raw->Run(program, protections); });
  const absl::Status started = process->WaitForStart();
  if (!started.ok()) return started;
  return process;
}

absl::Status SceneProcess::WaitForStart() {
  const MutexLock lock(&mutex_);
  changed_.Wait(&mutex_,
                [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return started_.has_value(); });
  return *started_;
}

SceneProcess::~SceneProcess() {
  if (child_ != nullptr) child_->Kill();
  thread_.join();
  // Its threads use the channel.
  std::unique_ptr<FileServer> files;
  const MutexLock lock(&mutex_);
  files = std::move(files_);
}

void SceneProcess::ServeFiles(OpenOnDemand open) {
  const MutexLock lock(&mutex_);
  files_ = std::make_unique<FileServer>(
      std::move(open), [this](uint64_t ask_id, const absl::StatusOr<volume::FileBytes>& file) {
        SendFile(ask_id, file);
      });
}

void SceneProcess::SendFile(uint64_t ask_id, const absl::StatusOr<volume::FileBytes>& file) {
  v1::SandboxRequest request;
  v1::FileOpened& opened = *request.mutable_file_opened();
  opened.set_call_id(ask_id);
  opened.set_code(static_cast<int32_t>(file.status().code()));
  opened.set_message(Printable(std::string(file.status().message()), kReplyTextBytesMax));
  // If it cannot be sent, the process ends.
  channel_->Send(request.SerializeAsString(), {}, file.ok() ? file->descriptor() : -1)
      .IgnoreError();
}

void SceneProcess::Run(const SceneProgram& program, Protections protections) {
  // With namespaces, the child waits for the process that has the scene, and ends it when told to.
  const int kill_signal = protections.Has(Protection::kNamespaces) ? kStopSupervised : SIGKILL;
  absl::StatusOr<std::unique_ptr<ChildProcess>> child =
      ChildProcess::Start(program.path, program.arguments, kill_signal);
  if (child.ok()) {
    child_ = *std::move(child);
    channel_ = std::make_unique<MessageChannel>(child_->TakeSocket(), kReplyLimits);
  }
  {
    const MutexLock lock(&mutex_);
    started_ = child.status();
    changed_.NotifyAll();
  }
  if (child_ == nullptr) return;
  Receive();
  const ProcessEnd end = child_->Wait(kEndTimeMax);
  LogOutputRest();
  const Ending ending = Describe(end);
  const MutexLock lock(&mutex_);
  ending_ = ending;
  changed_.NotifyAll();
}

void SceneProcess::Receive() {
  std::array<pollfd, 3> sources = {{{channel_->descriptor(), POLLIN, 0},
                                    {child_->output().get(), POLLIN, 0},
                                    {child_->overdue().get(), POLLIN, 0}}};
  while (true) {
    if (::poll(sources.data(), sources.size(), -1) < 0 && errno != EINTR) return;
    // Output first: it tells why the process ends.
    if (sources[1].revents != 0 && !TakeOutput()) sources[1].fd = -1;
    if (sources[0].revents != 0 && !TakeMessage()) return;
    // It did not heed the signal, as where it is stopped. With it its own child dies
    // (EndWithParent); nothing more of them is waited for.
    if (sources[2].revents != 0) return child_->KillForCertain();
  }
}

bool SceneProcess::TakeMessage() {
  absl::StatusOr<MessageChannel::Received> received = channel_->Receive();
  if (absl::IsOutOfRange(received.status())) return false;
  v1::SandboxReply reply;
  if (!received.ok() || !reply.ParseFromString(received->message)) {
    Kill({absl::InternalError(
              absl::StrCat("its process was stopped, as it sent ",
                           received.ok() ? "a malformed message" : received.status().message())),
          FailureKind::kInternal});
    return false;
  }
  MutexLock lock(&mutex_);
  if (!reply.open_file().empty()) {
    if (files_ != nullptr && files_->Ask(reply.call_id(), reply.open_file())) return true;
    lock.Unlock();
    Kill(
        {absl::InternalError("its process was stopped, as it asked for files that are not its own"),
         FailureKind::kInternal});
    return false;
  }
  const auto found = pending_.find(reply.call_id());
  if (found == pending_.end()) return true;  // Given up meanwhile.
  PendingCall& call = *found->second;
  call.reply = std::move(reply);
  call.payload = std::move(received->payload);
  call.done = true;
  changed_.NotifyAll();
  return true;
}

bool SceneProcess::TakeOutput() {
  std::array<char, 4'096> bytes;
  const ssize_t got = ::read(child_->output().get(), bytes.data(), bytes.size());
  if (got < 0 && errno == EINTR) return true;
  if (got <= 0) return false;
  for (ssize_t i = 0; i < got; ++i) {
    const char c = bytes[static_cast<size_t>(i)];
    if (c != '\n') line_ += c;
    if (c != '\n' && line_.size() < kOutputLineBytesMax) continue;
    LogOutputLine(line_);
    line_.clear();
  }
  return true;
}

void SceneProcess::LogOutputLine(const std::string& line) {
  last_line_ = line;
  if (++line_count_ <= kOutputLinesMax) return RelayLog(line);
  if (line_count_ == kOutputLinesMax + 1) {
    LogWarning(absl::StrCat("a scene's process has written ", kOutputLinesMax,
                            " lines; its further ones are not shown"));
  }
}

void SceneProcess::LogOutputRest() {
  pollfd output{child_->output().get(), POLLIN, 0};
  while (::poll(&output, 1, 0) == 1 && TakeOutput()) {
  }
  if (!line_.empty()) LogOutputLine(line_);
}

void SceneProcess::Kill(const Ending& reason) {
  {
    const MutexLock lock(&mutex_);
    if (!kill_reason_.has_value() && !ending_.has_value()) kill_reason_ = reason;
  }
  child_->Kill();
}

SceneProcess::Ending SceneProcess::Describe(const ProcessEnd& end) const {
  const std::string last_words =
      last_line_.empty() ? "" : absl::StrCat("; its last line: ", Printable(last_line_, 1'000));
  if (end.signal == SIGKILL) {
    return {
        absl::ResourceExhaustedError(absl::StrCat(
            "the system killed its process, as it does when memory runs out", kOutOfMemoryAdvice)),
        FailureKind::kMemory};
  }
  if (end.signal == SIGABRT && absl::StrContains(last_line_, "std::bad_alloc")) {
    return {absl::ResourceExhaustedError(
                absl::StrCat("its process ran out of memory", kOutOfMemoryAdvice)),
            FailureKind::kMemory};
  }
  if (end.signal == SIGSYS) {
    return {absl::InternalError(absl::StrCat(
                "its process was killed for a system call that rendering does not need (SIGSYS): "
                "either the scene attacks the renderer, or this system's libraries need more calls "
                "than the filter knows",
                last_words)),
            FailureKind::kInternal};
  }
  if (end.signal != 0) {
    const char* name = ::sigabbrev_np(end.signal);
    return {
        absl::InternalError(absl::StrCat(
            "its process crashed with SIG", name == nullptr ? "?" : name, " (signal ", end.signal,
            "), a defect of the renderer; please report it with the scene", last_words)),
        FailureKind::kInternal};
  }
  return {absl::InternalError(absl::StrCat("its process ended by itself with code ", end.exit_code,
                                           ", a defect of the renderer", last_words)),
          FailureKind::kInternal};
}

void SceneProcess::Cancel(uint64_t call_id) {
  v1::SandboxRequest request;
  request.mutable_cancel()->set_call_id(call_id);
  // If it cannot be sent, the process ends, and with it the call.
  channel_->Send(request.SerializeAsString()).IgnoreError();
}

SceneProcess::Answer SceneProcess::Call(v1::SandboxRequest request, absl::Duration time_max,
                                        std::stop_token stop, OnStop on_stop) {
  PendingCall call;
  uint64_t call_id = 0;
  {
    const MutexLock lock(&mutex_);
    call_id = ++calls_;
    pending_[call_id] = &call;
  }
  request.set_call_id(call_id);
  const Ending stopped{absl::CancelledError("stopped"), FailureKind::kReleased};
  Ending late{
      absl::DeadlineExceededError(absl::StrCat(
          "its process was stopped, as it did not finish within ", absl::FormatDuration(time_max))),
      FailureKind::kInternal};
  const absl::Status sent = channel_->Send(request.SerializeAsString());
  if (!sent.ok()) {  // Most likely it is ending, and the reason is about to be known.
    late.status = Annotate(sent, "its process was stopped, as it takes no requests");
    time_max = kEndTimeMax;
  }
  const std::stop_callback on_request(stop, [&] {
    if (on_stop == OnStop::kKill) return Kill(stopped);
    Cancel(call_id);
    const MutexLock lock(&mutex_);
    call.is_cancelled = true;
    changed_.NotifyAll();
  });
  const auto done = [&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return call.done || ending_.has_value();
  };
  const auto done_or_cancelled = [&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return done() || call.is_cancelled;
  };
  MutexLock lock(&mutex_);
  bool in_time = changed_.WaitFor(&mutex_, time_max, done_or_cancelled);
  if (call.is_cancelled) in_time = changed_.WaitFor(&mutex_, kCancelTimeMax, done);
  if (!in_time) {
    const bool is_cancelled = call.is_cancelled;
    lock.Unlock();
    if (is_cancelled) {
      LogWarning(absl::StrCat("a scene's process did not end a cancelled task within ",
                              absl::FormatDuration(kCancelTimeMax), " and is killed"));
    }
    Kill(is_cancelled ? stopped : late);
    lock.Lock();
    changed_.Wait(&mutex_, done);
  }
  pending_.erase(call_id);
  if (call.done) {
    return {absl::OkStatus(), FailureKind::kInternal, std::move(call.reply),
            std::move(call.payload)};
  }
  const Ending& ending = kill_reason_.has_value() ? *kill_reason_ : *ending_;
  return {ending.status, ending.failure_kind, {}, {}};
}

}  // namespace sheaf::worker
