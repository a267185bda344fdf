// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneProcess: the worker's end of the process in which one scene lives. The process is not
// trusted: its messages have limits, calls have deadlines, and its end, however it comes, fails the
// calls under way with the reason.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/process/child_process.h"
#include "sheaf/v1/sandbox.pb.h"
#include "worker/agent/work.h"
#include "worker/sandbox/file_server.h"
#include "worker/sandbox/message_channel.h"
#include "worker/sandbox/protections.h"
#include "worker/sandbox/scene_opener.h"

namespace sheaf::worker {

// The program of scenes' processes: by default this one, in the mode of RunSceneProcess.
struct SceneProgram {
  std::string path = "/proc/self/exe";
  std::vector<std::string> arguments;
};

// Lines of a process that are logged; later ones are counted only.
inline constexpr int kOutputLinesMax = 1'000;
inline constexpr size_t kOutputLineBytesMax = 4'096;

// Thread safety: all members may be called concurrently.
class SceneProcess {
 public:
  // protections: those that it is going to be confined with. Errors: those of ChildProcess::Start.
  static absl::StatusOr<std::unique_ptr<SceneProcess>> Start(const SceneProgram& program,
                                                             Protections protections);
  // Kills the process.
  ~SceneProcess();
  SceneProcess(const SceneProcess&) = delete;
  SceneProcess& operator=(const SceneProcess&) = delete;

  // A reply, or the reason why there is none.
  struct Answer {
    absl::Status status;                                // OK if there is a reply, whatever it says.
    FailureKind failure_kind = FailureKind::kInternal;  // The class of a status that is not OK.
    v1::SandboxReply reply;
    std::string payload;
  };
  // A request to stop asks a task to end, and kills it after some seconds; it kills a load at once.
  enum class OnStop { kCancelCall, kKill };

  // From now on the process may ask for these files. Call at most once.
  void ServeFiles(OpenOnDemand open) ABSL_LOCKS_EXCLUDED(mutex_);

  // Sends the request, whose call_id it sets, and waits for the reply. The process is killed if
  // there is none in time. Errors: kCancelled only after a request to stop.
  Answer Call(v1::SandboxRequest request, absl::Duration time_max, std::stop_token stop,
              OnStop on_stop);

 private:
  struct PendingCall {
    bool done = false;
    bool is_cancelled = false;
    v1::SandboxReply reply;
    std::string payload;
  };
  // Why the process has ended.
  struct Ending {
    absl::Status status;
    FailureKind failure_kind = FailureKind::kInternal;
  };

  SceneProcess() = default;
  // Waits until Run has started the process, or has failed to.
  absl::Status WaitForStart();
  // The thread that owns the process: starts it, receives its messages and output, and reaps it.
  void Run(const SceneProgram& program, Protections protections);
  void Receive();
  // Takes a message. Returns whether more may follow.
  bool TakeMessage();
  // Answers a process that asked for a file.
  void SendFile(uint64_t ask_id, const absl::StatusOr<volume::FileBytes>& file);
  // Logs what the process has written. Returns whether more may follow.
  bool TakeOutput();
  void LogOutputLine(const std::string& line);
  void LogOutputRest();
  // Kills the process for a reason of the worker's; the first reason counts.
  void Kill(const Ending& reason);
  Ending Describe(const ProcessEnd& end) const;
  void Cancel(uint64_t call_id);

  std::unique_ptr<ChildProcess> child_;      // Set before Start returns.
  std::unique_ptr<MessageChannel> channel_;  // The same.

  // Used by the owning thread alone.
  std::string line_;       // The begin of a line of output.
  std::string last_line_;  // Often the reason for a sudden end.
  int line_count_ = 0;

  Mutex mutex_;
  CondVar changed_;
  std::optional<absl::Status> started_ ABSL_GUARDED_BY(mutex_);
  std::map<uint64_t, PendingCall*> pending_ ABSL_GUARDED_BY(mutex_);  // By call_id.
  uint64_t calls_ ABSL_GUARDED_BY(mutex_) = 0;
  std::optional<Ending> kill_reason_ ABSL_GUARDED_BY(mutex_);
  std::optional<Ending> ending_ ABSL_GUARDED_BY(mutex_);
  std::unique_ptr<FileServer> files_ ABSL_GUARDED_BY(mutex_);  // Null: it may not ask.
  std::jthread thread_;
};

}  // namespace sheaf::worker
