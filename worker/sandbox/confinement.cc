// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/confinement.h"

#include <fcntl.h>
#include <linux/capability.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/content/file_descriptor.h"
#include "common/process/child_process.h"
#include "common/volume/vdb_file.h"
#include "worker/sandbox/file_access_rules.h"
#include "worker/sandbox/readable_paths.h"
#include "worker/sandbox/system_call_filter.h"

namespace sheaf::worker {
namespace {

constexpr int kNamespaces =
    CLONE_NEWNS | CLONE_NEWNET | CLONE_NEWPID | CLONE_NEWIPC | CLONE_NEWUTS | CLONE_NEWCGROUP;
// Where memory runs out, the kernel ends scenes before the worker and what else runs there.
constexpr int kOutOfMemoryScore = 500;

void RaiseOutOfMemoryScore() {
  constexpr char kPath[] = "/proc/self/oom_score_adj";
  int score = 0;
  if (std::ifstream(kPath) >> score && score < kOutOfMemoryScore) {
    std::ofstream(kPath) << kOutOfMemoryScore;
  }
}

absl::Status WriteOnce(const char* path, std::string_view text) {
  const FileDescriptor file(::open(path, O_WRONLY | O_CLOEXEC));
  if (!file.ok() || ::write(file.get(), text.data(), text.size()) < 0) {
    return StatusFromErrno(errno, absl::StrCat("writing ", path));
  }
  return absl::OkStatus();
}

// In its user namespace, this process keeps its user and group.
absl::Status KeepUser(uid_t user, gid_t group) {
  absl::Status status = WriteOnce("/proc/self/setgroups", "deny");
  if (status.ok()) status = WriteOnce("/proc/self/gid_map", absl::StrCat(group, " ", group, " 1"));
  if (status.ok()) status = WriteOnce("/proc/self/uid_map", absl::StrCat(user, " ", user, " 1"));
  return status;
}

pid_t supervised_process = 0;  // For the handler.

void KillSupervised(int) { ::kill(supervised_process, SIGKILL); }

// While it lives, the stop signal waits.
class StopSignalBlocked {
 public:
  StopSignalBlocked() {
    sigset_t stop_signal;
    sigemptyset(&stop_signal);
    sigaddset(&stop_signal, kStopSupervised);
    ::sigprocmask(SIG_BLOCK, &stop_signal, &before_);
  }
  ~StopSignalBlocked() { ::sigprocmask(SIG_SETMASK, &before_, nullptr); }
  StopSignalBlocked(const StopSignalBlocked&) = delete;
  StopSignalBlocked& operator=(const StopSignalBlocked&) = delete;

 private:
  sigset_t before_;
};

// Ends as the child ends. Holds nothing open that the child's end must close.
[[noreturn]] void EndAs(pid_t child) {
  ::close_range(0, ~0U, 0);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  ::_exit(WIFSIGNALED(status) ? kExitBySignal + WTERMSIG(status) : WEXITSTATUS(status));
}

absl::Status EnterNamespaces() {
  const uid_t user = ::geteuid();
  const gid_t group = ::getegid();
  if (::unshare(kNamespaces | CLONE_NEWUSER) == 0) {
    if (absl::Status status = KeepUser(user, group); !status.ok()) return status;
  } else if (const int error = errno; ::unshare(kNamespaces) != 0) {
    return StatusFromErrno(error, "making namespaces");
  }
  EndWithParent();
  pid_t child = 0;
  {
    const StopSignalBlocked blocked;
    child = ::fork();  // The first process of the process namespace.
    if (child < 0) return StatusFromErrno(errno, "starting a process in its namespaces");
    if (child > 0) {
      supervised_process = child;
      ::signal(kStopSupervised, KillSupervised);
    }
  }
  if (child > 0) EndAs(child);
  EndWithParent();
  return absl::OkStatus();
}

// Whether there is nothing to drop. Service managers may refuse capset to those who have none.
bool HasNoPrivileges() {
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  __user_cap_data_struct held[_LINUX_CAPABILITY_U32S_3] = {};
  if (::syscall(SYS_capget, &header, held) != 0) return false;
  return std::all_of(std::begin(held), std::end(held), [](const __user_cap_data_struct& set) {
    return set.effective == 0 && set.permitted == 0 && set.inheritable == 0;
  });
}

// Also for the superuser: it keeps its name, but may do nothing that others may not.
absl::Status DropPrivileges() {
  for (int capability = 0; ::prctl(PR_CAPBSET_READ, capability, 0, 0, 0) >= 0; ++capability) {
    ::prctl(PR_CAPBSET_DROP, capability, 0, 0, 0);  // Fails without privileges to drop.
  }
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  __user_cap_data_struct none[_LINUX_CAPABILITY_U32S_3] = {};
  if (::syscall(SYS_capset, &header, none) != 0 && !HasNoPrivileges()) {
    return StatusFromErrno(errno, "dropping privileges");
  }
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) {
    return StatusFromErrno(errno, "giving up new privileges");
  }
  return absl::OkStatus();
}

absl::Status Limit(__rlimit_resource resource, uint64_t value, const char* name) {
  rlimit limit{};
  if (::getrlimit(resource, &limit) != 0) return StatusFromErrno(errno, name);
  limit.rlim_max = std::min<rlim_t>(limit.rlim_max, value);
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_cur, limit.rlim_max);
  if (::setrlimit(resource, &limit) != 0) return StatusFromErrno(errno, name);
  return absl::OkStatus();
}

absl::Status SetLimits(const Confinement& confinement) {
  absl::Status status = Limit(RLIMIT_CORE, 0, "limiting core files");
  if (status.ok())
    status = Limit(RLIMIT_FSIZE, confinement.file_bytes_max, "limiting written files");
  if (status.ok()) status = Limit(RLIMIT_NOFILE, kConfinedOpenFilesMax, "limiting open files");
  if (status.ok() && confinement.protections.Has(Protection::kNamespaces)) {
    status = Limit(RLIMIT_NPROC, kConfinedThreadsMax, "limiting threads");
  }
#ifndef __SANITIZE_ADDRESS__  // It maps terabytes, which count as writable.
  if (status.ok()) status = Limit(RLIMIT_DATA, confinement.memory_bytes_max, "limiting memory");
#endif
  return status;
}

std::vector<std::string> ReadablePaths(const Confinement& confinement,
                                       std::vector<std::string> libraries) {
  for (const MountedFile& file : confinement.files) libraries.push_back(file.target);
  return libraries;
}

}  // namespace

void EndWithParent() { ::prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0); }

absl::Status Confine(const Confinement& confinement, Protections* missing) {
  const auto apply = [missing](Protection protection, const auto& step) {
    absl::Status status = step();
    if (!status.ok()) missing->Add(protection);
    return status;
  };
  const Protections protections = confinement.protections;
  const std::vector<std::string> libraries = LibraryPaths();
  RaiseOutOfMemoryScore();
  absl::Status status;
  if (protections.Has(Protection::kNamespaces)) {
    status = apply(Protection::kNamespaces, [&] {
      const absl::Status entered = EnterNamespaces();
      return entered.ok()
                 ? EnterPrivateRoot(confinement.files, libraries, confinement.writable_folder)
                 : entered;
    });
  }
  if (status.ok()) status = DropPrivileges();
  if (status.ok()) status = SetLimits(confinement);
  if (status.ok() && protections.Has(Protection::kFileAccess)) {
    status = apply(Protection::kFileAccess, [&] {
      return AllowReadingOnly(ReadablePaths(confinement, libraries), confinement.writable_folder);
    });
  }
  if (status.ok() && protections.Has(Protection::kSystemCalls)) {
    status = apply(Protection::kSystemCalls,
                   [&] { return FilterSystemCalls(!confinement.writable_folder.empty()); });
  }
  if (status.ok()) volume::ReadVdbInThisProcess();
  return status;
}

}  // namespace sheaf::worker
