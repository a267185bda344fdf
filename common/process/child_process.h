// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ChildProcess: starts a program with a socket as its only link to this process, and says how it
// ended.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/content/file_descriptor.h"
#include "common/process/spawn.h"

namespace sheaf {

// The exit code of a process that waited for another one, which was ended by signal N, or that
// handles the signal itself, is this + N, as with shells.
inline constexpr int kExitBySignal = 128;

// How a process ended: by a signal, or with an exit code. A shell's code for a signal (128 + N)
// counts as the signal N.
struct ProcessEnd {
  int signal = 0;
  int exit_code = 0;
};

// The time that a process has to end after a signal other than SIGKILL. A stopped process handles
// no such signal.
inline constexpr absl::Duration kKillPatience = absl::Seconds(3);

// Thread safety: Kill may be called by any thread; the others by one.
class ChildProcess {
 public:
  // Starts the program, whose descriptor kChildSocket is the other end of socket(), and which
  // writes its standard output and error into output(). It gets only the environment variables that
  // libraries need to load: others may hold secrets. input: its standard input, an open file; -1:
  // empty.
  // The process should die with the calling thread (see EndWithParent), so that thread must outlive
  // it. kill_signal: the signal that Kill sends. Errors: kUnavailable and similar.
  static absl::StatusOr<std::unique_ptr<ChildProcess>> Start(
      const std::string& program, const std::vector<std::string>& arguments, int kill_signal,
      int input = -1);
  // Kills the process with SIGKILL if it still runs.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  const FileDescriptor& output() const { return output_; }
  // The socket, once.
  FileDescriptor TakeSocket() { return std::move(socket_); }

  void Kill();
  // Becomes readable kKillPatience after a Kill by a signal other than SIGKILL; then the caller
  // that waits calls KillForCertain.
  const FileDescriptor& overdue() const { return overdue_; }
  void KillForCertain();
  // Waits for the end for at most this long, then kills the process with SIGKILL. Call once.
  ProcessEnd Wait(absl::Duration patience);

 private:
  ChildProcess(pid_t pid, int kill_signal, FileDescriptor socket, FileDescriptor output,
               FileDescriptor overdue)
      : pid_(pid),
        kill_signal_(kill_signal),
        socket_(std::move(socket)),
        output_(std::move(output)),
        overdue_(std::move(overdue)) {}
  void Signal(int number);

  const pid_t pid_;
  const int kill_signal_;
  FileDescriptor socket_;
  const FileDescriptor output_;
  const FileDescriptor overdue_;  // A timer.
  Mutex mutex_;
  bool ended_ ABSL_GUARDED_BY(mutex_) = false;  // Its id may belong to another process.
};

}  // namespace sheaf
