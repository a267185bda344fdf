// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/process/child_process.h"

#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/timerfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "common/base/status.h"

namespace sheaf {
namespace {

// A process that accepts no bytes for this long hangs.
constexpr timeval kSendTimeout{60, 0};

absl::StatusOr<Pipe> MakeSockets() {
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    return StatusFromErrno(errno, "making a socket");
  }
  Pipe sockets{FileDescriptor(ends[0]), FileDescriptor(ends[1])};
  ::setsockopt(sockets.read.get(), SOL_SOCKET, SO_SNDTIMEO, &kSendTimeout, sizeof kSendTimeout);
  return sockets;
}

}  // namespace

absl::StatusOr<std::unique_ptr<ChildProcess>> ChildProcess::Start(
    const std::string& program, const std::vector<std::string>& arguments, int kill_signal,
    int input) {
  absl::StatusOr<Pipe> sockets = MakeSockets();
  if (!sockets.ok()) return sockets.status();
  absl::StatusOr<Pipe> output = MakePipe();
  if (!output.ok()) return output.status();
  FileDescriptor overdue(::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC));
  if (!overdue.ok()) return StatusFromErrno(errno, "making a timer");
  const ProcessStart start{program,
                           arguments,
                           LoaderEnvironment(),
                           input,
                           output->write.get(),
                           output->write.get(),
                           sockets->write.get()};
  const absl::StatusOr<pid_t> pid = SpawnProcess(start, "starting a confined process");
  if (!pid.ok()) return pid.status();
  return std::unique_ptr<ChildProcess>(new ChildProcess(
      *pid, kill_signal, std::move(sockets->read), std::move(output->read), std::move(overdue)));
}

ChildProcess::~ChildProcess() { Wait(absl::ZeroDuration()); }

void ChildProcess::Kill() {
  Signal(kill_signal_);
  if (kill_signal_ == SIGKILL) return;
  itimerspec timer{};
  timer.it_value = absl::ToTimespec(kKillPatience);
  ::timerfd_settime(overdue_.get(), 0, &timer, nullptr);
}

void ChildProcess::KillForCertain() { Signal(SIGKILL); }

void ChildProcess::Signal(int number) {
  const MutexLock lock(&mutex_);
  if (!ended_) ::kill(pid_, number);
}

ProcessEnd ChildProcess::Wait(absl::Duration patience) {
  {
    const MutexLock lock(&mutex_);
    if (ended_) return {};
  }
  const FileDescriptor handle(static_cast<int>(::syscall(SYS_pidfd_open, pid_, 0)));
  pollfd ending{handle.get(), POLLIN, 0};
  const int milliseconds = static_cast<int>(absl::ToInt64Milliseconds(patience));
  if (!handle.ok() || ::poll(&ending, 1, milliseconds) != 1) Signal(SIGKILL);
  siginfo_t info{};
  // The id stays its own until it is waited for under the mutex.
  while (::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOWAIT) < 0 && errno == EINTR) {
  }
  const MutexLock lock(&mutex_);
  int status = 0;
  ::waitpid(pid_, &status, 0);
  ended_ = true;
  if (WIFSIGNALED(status)) return {WTERMSIG(status), 0};
  const int code = WEXITSTATUS(status);
  return code > kExitBySignal ? ProcessEnd{code - kExitBySignal, 0} : ProcessEnd{0, code};
}

}  // namespace sheaf
