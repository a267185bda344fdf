// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/process/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/timerfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"

namespace sheaf {
namespace {

// A process that accepts no bytes for this long hangs.
constexpr timeval kSendTimeout{60, 0};

constexpr const char* kKeptVariables[] = {"LD_LIBRARY_PATH", "LD_PRELOAD",   "ASAN_OPTIONS",
                                          "LSAN_OPTIONS",    "TSAN_OPTIONS", "UBSAN_OPTIONS"};

std::vector<std::string> KeptEnvironment() {
  std::vector<std::string> kept;
  for (const char* name : kKeptVariables) {
    if (const char* value = std::getenv(name); value != nullptr) {
      kept.push_back(absl::StrCat(name, "=", value));
    }
  }
  return kept;
}

std::vector<char*> PointersOf(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

struct Pipe {
  FileDescriptor read, write;
};

absl::StatusOr<Pipe> MakePipe() {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return StatusFromErrno(errno, "making a pipe");
  return Pipe{FileDescriptor(ends[0]), FileDescriptor(ends[1])};
}

absl::StatusOr<Pipe> MakeSockets() {
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    return StatusFromErrno(errno, "making a socket");
  }
  Pipe sockets{FileDescriptor(ends[0]), FileDescriptor(ends[1])};
  ::setsockopt(sockets.read.get(), SOL_SOCKET, SO_SNDTIMEO, &kSendTimeout, sizeof kSendTimeout);
  return sockets;
}

// The new process's descriptors: standard ones, and the socket.
class FileActions {
 public:
  FileActions(int input, int output, int socket) {
    ::posix_spawn_file_actions_init(&actions_);
    if (input >= 0) {
      ::posix_spawn_file_actions_adddup2(&actions_, input, STDIN_FILENO);
    } else {
      ::posix_spawn_file_actions_addopen(&actions_, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    }
    ::posix_spawn_file_actions_adddup2(&actions_, output, STDOUT_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions_, output, STDERR_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions_, socket, kChildSocket);
  }
  ~FileActions() { ::posix_spawn_file_actions_destroy(&actions_); }
  FileActions(const FileActions&) = delete;
  FileActions& operator=(const FileActions&) = delete;
  const posix_spawn_file_actions_t* get() const { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_;
};

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
  const FileActions actions(input, output->write.get(), sockets->write.get());
  std::vector<std::string> argument_texts = arguments;
  std::vector<std::string> environment_texts = KeptEnvironment();
  pid_t pid = -1;
  const int error =
      ::posix_spawn(&pid, program.c_str(), actions.get(), nullptr,
                    PointersOf(argument_texts).data(), PointersOf(environment_texts).data());
  if (error != 0) return StatusFromErrno(error, "starting a confined process");
  return std::unique_ptr<ChildProcess>(new ChildProcess(
      pid, kill_signal, std::move(sockets->read), std::move(output->read), std::move(overdue)));
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
