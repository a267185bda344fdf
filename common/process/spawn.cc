// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/process/spawn.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/status.h"
#include "common/base/steady_time.h"

namespace sheaf {
namespace {

constexpr const char* kLoaderVariables[] = {"LD_LIBRARY_PATH", "LD_PRELOAD",   "ASAN_OPTIONS",
                                            "LSAN_OPTIONS",    "TSAN_OPTIONS", "UBSAN_OPTIONS"};
constexpr absl::Duration kEndPollInterval = absl::Milliseconds(5);

// Null-terminated, as execve takes them. The pointers are those of `texts`.
std::vector<char*> PointersOf(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

// Descriptors, group and signals of a new process.
class SpawnSettings {
 public:
  explicit SpawnSettings(const ProcessStart& start) {
    ::posix_spawn_file_actions_init(&actions_);
    Connect(start.input, STDIN_FILENO, O_RDONLY);
    Connect(start.output, STDOUT_FILENO, O_WRONLY);
    Connect(start.error, STDERR_FILENO, O_WRONLY);
    if (start.socket >= 0) {
      ::posix_spawn_file_actions_adddup2(&actions_, start.socket, kChildSocket);
    }
    ::posix_spawnattr_init(&attributes_);
    if (start.leads_group) LeadGroup();
  }
  ~SpawnSettings() {
    ::posix_spawnattr_destroy(&attributes_);
    ::posix_spawn_file_actions_destroy(&actions_);
  }
  SpawnSettings(const SpawnSettings&) = delete;
  SpawnSettings& operator=(const SpawnSettings&) = delete;
  const posix_spawn_file_actions_t* actions() const { return &actions_; }
  const posix_spawnattr_t* attributes() const { return &attributes_; }

 private:
  void Connect(int descriptor, int standard, int flags) {
    if (descriptor >= 0) {
      ::posix_spawn_file_actions_adddup2(&actions_, descriptor, standard);
    } else {
      ::posix_spawn_file_actions_addopen(&actions_, standard, "/dev/null", flags, 0);
    }
  }
  void LeadGroup() {
    ::posix_spawnattr_setflags(
        &attributes_, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    ::posix_spawnattr_setpgroup(&attributes_, 0);
    sigset_t signals;
    sigemptyset(&signals);
    ::posix_spawnattr_setsigmask(&attributes_, &signals);
    for (const int number : {SIGPIPE, SIGXFSZ, SIGINT, SIGTERM}) sigaddset(&signals, number);
    ::posix_spawnattr_setsigdefault(&attributes_, &signals);
  }

  posix_spawn_file_actions_t actions_;
  posix_spawnattr_t attributes_;
};

}  // namespace

absl::StatusOr<Pipe> MakePipe() {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return StatusFromErrno(errno, "making a pipe");
  return Pipe{FileDescriptor(ends[0]), FileDescriptor(ends[1])};
}

std::vector<std::string> LoaderEnvironment() {
  std::vector<std::string> kept;
  for (const char* name : kLoaderVariables) {
    if (const char* value = std::getenv(name); value != nullptr) {
      kept.push_back(absl::StrCat(name, "=", value));
    }
  }
  return kept;
}

absl::StatusOr<pid_t> SpawnProcess(const ProcessStart& start, const std::string& context) {
  const SpawnSettings settings(start);
  std::vector<std::string> arguments = start.arguments;
  std::vector<std::string> variables = start.environment.value_or(std::vector<std::string>());
  std::vector<char*> of_start = PointersOf(variables);
  pid_t pid = -1;
  const int error =
      ::posix_spawn(&pid, start.program.c_str(), settings.actions(), settings.attributes(),
                    PointersOf(arguments).data(), start.environment ? of_start.data() : environ);
  if (error != 0) return StatusFromErrno(error, context);
  return pid;
}

absl::StatusOr<std::unique_ptr<ProcessGroup>> ProcessGroup::Start(ProcessStart start,
                                                                  const std::string& context) {
  start.leads_group = true;
  const absl::StatusOr<pid_t> pid = SpawnProcess(start, context);
  if (!pid.ok()) return pid.status();
  return std::unique_ptr<ProcessGroup>(new ProcessGroup(*pid));
}

bool ProcessGroup::HasEnded() const {
  if (status_) return true;
  siginfo_t info{};
  const int failed = ::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOWAIT | WNOHANG);
  return (failed != 0 && errno != EINTR) || info.si_pid == pid_;
}

int ProcessGroup::End(absl::Duration patience) {
  if (status_) return *status_;
  for (const SteadyTime end = SteadyTime::Now() + patience;
       SteadyTime::Now() < end && !HasEnded();) {
    absl::SleepFor(kEndPollInterval);
  }
  // The group exists until its leader is waited for.
  ::kill(-pid_, SIGKILL);
  int status = 0;
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  status_ = status;
  return status;
}

}  // namespace sheaf
