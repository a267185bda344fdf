// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/scene_server.h"

#include <signal.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <cstdlib>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "common/base/log.h"
#include "common/base/mutex.h"
#include "common/base/status.h"
#include "worker/agent/task_border.h"
#include "worker/sandbox/confinement.h"
#include "worker/sandbox/direct_scenes.h"
#include "worker/sandbox/message_channel.h"
#include "worker/sandbox/scene_messages.h"
#include "worker/sandbox/starting_room.h"
#include "worker/wire/lease_codec.h"

namespace sheaf::worker {
namespace {

// The first process of a process namespace ignores signals without a handler, SIGABRT too.
void EndAsAborted(int number) { ::_exit(kExitBySignal + number); }

void PrepareProcess() {
  EndWithParent();
  ::close_range(kSceneSocket + 1, ~0U, 0);
  ::signal(SIGPIPE, SIG_IGN);
  ::signal(SIGABRT, EndAsAborted);
  // A terminal and a supervisor send these to all processes; the worker decides what they mean.
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) ::signal(number, SIG_IGN);
  SetLogForRelay();
}

class SceneServer {
 public:
  SceneServer(MessageChannel* channel, SceneOpener* scenes) : channel_(channel), scenes_(scenes) {}

  // Returns when the worker has closed the channel, or sends what it never sends.
  absl::Status Serve() {
    while (true) {
      absl::StatusOr<MessageChannel::Received> received = channel_->Receive();
      if (absl::IsOutOfRange(received.status())) return absl::OkStatus();
      if (!received.ok()) return received.status();
      v1::SandboxRequest request;
      if (!request.ParseFromString(received->message)) {
        return absl::InternalError("the worker sent a malformed request");
      }
      Handle(std::move(request), std::move(received->file));
    }
  }

 private:
  struct Call {
    v1::SandboxRequest request;
    std::stop_source stop;
  };

  // A file that the worker was asked for.
  struct AskedFile {
    bool is_answered = false;
    absl::Status status;
    FileDescriptor file;
  };

  void Handle(v1::SandboxRequest request, FileDescriptor file) {
    switch (request.request_case()) {
      case v1::SandboxRequest::kConfine:
        return ConfineThis(request);
      case v1::SandboxRequest::kLoad:
        // On a thread of its own, since loading may ask for files.
        loading_ = std::jthread([this, loaded = std::move(request)] { Load(loaded); });
        return;
      case v1::SandboxRequest::kSetField:
      case v1::SandboxRequest::kRender:
        return Enqueue(std::move(request));
      case v1::SandboxRequest::kCancel:
        return Cancel(request.cancel().call_id());
      case v1::SandboxRequest::kFileOpened:
        return TakeFile(request.file_opened(), std::move(file));
      case v1::SandboxRequest::REQUEST_NOT_SET:
        return;
    }
  }

  void Reply(const v1::SandboxReply& reply, std::string_view payload = {}) {
    // The worker is gone if this fails, and Serve ends.
    channel_->Send(reply.SerializeAsString(), payload).IgnoreError();
  }

  void ConfineThis(const v1::SandboxRequest& request) {
    Confinement confinement;
    confinement.protections = Protections(request.confine().protections());
    confinement.memory_bytes_max = request.confine().memory_bytes_max();
    for (const v1::SandboxFile& file : request.confine().files()) {
      confinement.files.push_back({file.source(), file.target()});
      local_paths_[file.name()] = file.target();
    }
    v1::SandboxReply reply;
    reply.set_call_id(request.call_id());
    Protections missing;
    SetStatus(Confine(confinement, &missing), &reply);
    reply.set_missing_protection(missing.bits());
    Reply(reply);
  }

  void Load(const v1::SandboxRequest& request) {
    v1::SandboxReply reply;
    reply.set_call_id(request.call_id());
    OpenResult opened;
    absl::StatusOr<SceneInputs> inputs = FromWire(request.load());
    absl::Status status = inputs.status();
    if (inputs.ok()) {
      inputs->local_paths = local_paths_;
      inputs->open_on_demand = [this](const std::string& name, const std::stop_token&) {
        return OpenFile(name);
      };
      status = CatchOutOfMemory("loading the scene", [&] { opened = scenes_->Open(*inputs, {}); });
      if (!status.ok()) opened = {nullptr, status, FailureKind::kMemory};
      status = opened.status;
    }
    SetStatus(status, &reply);
    if (opened.scene != nullptr) reply.set_memory_bytes(opened.scene->memory_bytes());
    reply.set_failure_kind(ToWire(opened.failure_kind));
    {
      const MutexLock lock(&mutex_);
      if (inputs.ok()) render_threads_max_ = inputs->limits.render_threads;
      scene_ = std::move(opened.scene);
    }
    Reply(reply);
  }

  // Asks the worker for a file, and waits for the answer: the worker has limits of time.
  absl::StatusOr<volume::FileBytes> OpenFile(const std::string& name) {
    const auto asked = std::make_shared<AskedFile>();
    v1::SandboxReply ask;
    ask.set_open_file(name);
    {
      const MutexLock lock(&mutex_);
      ask.set_call_id(++asks_);
      asked_files_[asks_] = asked;
    }
    Reply(ask);
    MutexLock lock(&mutex_);
    answered_.Wait(&mutex_, [&] { return asked->is_answered; });
    if (!asked->status.ok()) return asked->status;
    return volume::FileBytes::Adopt(name, asked->file.Release());
  }

  void TakeFile(const v1::FileOpened& opened, FileDescriptor file) {
    const MutexLock lock(&mutex_);
    const auto found = asked_files_.find(opened.call_id());
    if (found == asked_files_.end()) return;
    found->second->is_answered = true;
    found->second->status = StatusOf(opened);
    found->second->file = std::move(file);
    asked_files_.erase(found);
    answered_.NotifyAll();
  }

  void Enqueue(v1::SandboxRequest request) {
    const MutexLock lock(&mutex_);
    const auto call = std::make_shared<Call>();
    call->request = std::move(request);
    running_[call->request.call_id()] = call;
    queue_.push_back(call);
    if (queue_.size() > idle_threads_ && threads_.size() < render_threads_max_) {
      threads_.emplace_back([this](std::stop_token ended) { Work(ended); });
    }
    queued_.NotifyOne();
  }

  void Cancel(uint64_t call_id) {
    const MutexLock lock(&mutex_);
    const auto call = running_.find(call_id);
    if (call != running_.end()) call->second->stop.request_stop();
  }

  void Work(std::stop_token ended) {
    MutexLock lock(&mutex_);
    const auto has_call = [this]()
                              ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return !queue_.empty(); };
    while (true) {
      ++idle_threads_;
      const bool more = queued_.Wait(&mutex_, ended, has_call);
      --idle_threads_;
      if (!more) return;
      const std::shared_ptr<Call> call = queue_.front();
      queue_.pop_front();
      lock.Unlock();
      if (call->request.has_set_field()) {
        SetField(*call);
      } else {
        Render(*call);
      }
      lock.Lock();
      running_.erase(call->request.call_id());
    }
  }

  void SetField(const Call& call) {
    absl::Status status = absl::InternalError("no scene is loaded");
    const absl::Status in_memory = CatchOutOfMemory("setting the guiding field", [&] {
      if (scene_ == nullptr) return;
      status = scene_->SetField(call.request.set_field().field(), call.stop.get_token());
    });
    v1::SandboxReply reply;
    reply.set_call_id(call.request.call_id());
    SetStatus(in_memory.ok() ? status : in_memory, &reply);
    Reply(reply);
  }

  void Render(const Call& call) {
    absl::StatusOr<RenderedPart> part;
    const absl::Status in_memory = CatchOutOfMemory("rendering", [&] {
      const absl::StatusOr<Lease> lease = FromWire(call.request.render());
      if (!lease.ok() || scene_ == nullptr) {
        part = lease.ok() ? absl::InternalError("no scene is loaded") : lease.status();
        return;
      }
      part = scene_->Render(*lease, call.stop.get_token());
    });
    v1::SandboxReply reply;
    reply.set_call_id(call.request.call_id());
    SetStatus(in_memory.ok() ? part.status() : in_memory, &reply);
    if (!in_memory.ok() || !part.ok()) return Reply(reply);
    reply.set_ray_count(part->ray_count);
    reply.set_cpu_seconds(part->cpu_seconds);
    SetPages(*part, &reply);
    Reply(reply, part->exr_bytes);
  }

  MessageChannel* const channel_;
  SceneOpener* const scenes_;
  std::map<std::string, std::string> local_paths_;
  std::unique_ptr<const OpenScene> scene_;  // Written, under the lock, before any thread renders.
  std::jthread loading_;

  Mutex mutex_;
  size_t render_threads_max_ ABSL_GUARDED_BY(mutex_) = 1;
  CondVar answered_;
  uint64_t asks_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<uint64_t, std::shared_ptr<AskedFile>> asked_files_ ABSL_GUARDED_BY(mutex_);
  CondVar queued_;
  std::deque<std::shared_ptr<Call>> queue_ ABSL_GUARDED_BY(mutex_);
  std::map<uint64_t, std::shared_ptr<Call>> running_ ABSL_GUARDED_BY(mutex_);
  size_t idle_threads_ ABSL_GUARDED_BY(mutex_) = 0;
  std::vector<std::jthread> threads_;  // Last, so that they end first.
};

}  // namespace

int RunSceneProcess(SceneOpener* scenes) {
  PrepareProcess();
  MessageChannel channel(FileDescriptor(kSceneSocket), kRequestLimits);
  SceneServer server(&channel, scenes);
  const absl::Status status = server.Serve();
  if (!status.ok()) LogError(std::string(status.message()));
  // At once, whatever its threads do: no one waits for them.
  ::_exit(status.ok() ? EXIT_SUCCESS : EXIT_FAILURE);
}

int RunDirectSceneProcess() {
  const StartingRoom room;
  DirectScenes scenes([&room] { return room.Left(); });
  return RunSceneProcess(&scenes);
}

}  // namespace sheaf::worker
