// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/system_call_filter.h"

#include <fcntl.h>
#include <sched.h>
#include <seccomp.h>
#include <unistd.h>

#include <cerrno>
#include <memory>

#include "common/base/status.h"
#include "common/process/spawn.h"

namespace sheaf::worker {
namespace {

constexpr int kAllowed[] = {
    // Files, to read them. Writing needs a file that is open for writing.
    SCMP_SYS(access), SCMP_SYS(close), SCMP_SYS(close_range), SCMP_SYS(dup), SCMP_SYS(faccessat),
    SCMP_SYS(faccessat2), SCMP_SYS(fadvise64), SCMP_SYS(fcntl), SCMP_SYS(fstat), SCMP_SYS(fstatfs),
    SCMP_SYS(getcwd), SCMP_SYS(getdents64), SCMP_SYS(lseek), SCMP_SYS(lstat), SCMP_SYS(newfstatat),
    SCMP_SYS(poll), SCMP_SYS(ppoll), SCMP_SYS(pread64), SCMP_SYS(preadv), SCMP_SYS(read),
    SCMP_SYS(readahead), SCMP_SYS(readlink), SCMP_SYS(readlinkat), SCMP_SYS(readv), SCMP_SYS(stat),
    SCMP_SYS(statfs), SCMP_SYS(statx), SCMP_SYS(write), SCMP_SYS(writev),
    // Memory.
    SCMP_SYS(brk), SCMP_SYS(madvise), SCMP_SYS(mmap), SCMP_SYS(mprotect), SCMP_SYS(mremap),
    SCMP_SYS(munmap),
    // Threads and signals of this process.
    SCMP_SYS(exit), SCMP_SYS(exit_group), SCMP_SYS(futex), SCMP_SYS(getcpu), SCMP_SYS(getpid),
    SCMP_SYS(gettid), SCMP_SYS(membarrier), SCMP_SYS(restart_syscall), SCMP_SYS(rseq),
    SCMP_SYS(rt_sigaction), SCMP_SYS(rt_sigprocmask), SCMP_SYS(rt_sigreturn),
    SCMP_SYS(sched_getaffinity), SCMP_SYS(sched_yield), SCMP_SYS(set_robust_list),
    SCMP_SYS(sigaltstack),
    // Clocks and facts about the machine.
    SCMP_SYS(clock_getres), SCMP_SYS(clock_gettime), SCMP_SYS(clock_nanosleep), SCMP_SYS(getegid),
    SCMP_SYS(geteuid), SCMP_SYS(getgid), SCMP_SYS(getrandom), SCMP_SYS(getrusage),
    SCMP_SYS(gettimeofday), SCMP_SYS(getuid), SCMP_SYS(nanosleep), SCMP_SYS(sysinfo),
    SCMP_SYS(times), SCMP_SYS(uname)};

// For a process with a folder that it may write to.
constexpr int kWritingCalls[] = {
    SCMP_SYS(chdir),     SCMP_SYS(fchmod),   SCMP_SYS(fdatasync), SCMP_SYS(fsync),
    SCMP_SYS(ftruncate), SCMP_SYS(mkdir),    SCMP_SYS(mkdirat),   SCMP_SYS(open),
    SCMP_SYS(openat),    SCMP_SYS(pwrite64), SCMP_SYS(rename),    SCMP_SYS(renameat),
    SCMP_SYS(renameat2), SCMP_SYS(rmdir),    SCMP_SYS(unlink),    SCMP_SYS(unlinkat)};

// No library that renders makes these calls.
constexpr int kDeadly[] = {
    // Networks and other processes' channels.
    SCMP_SYS(accept), SCMP_SYS(accept4), SCMP_SYS(bind), SCMP_SYS(connect), SCMP_SYS(listen),
    SCMP_SYS(recvfrom), SCMP_SYS(sendmsg), SCMP_SYS(sendto), SCMP_SYS(socket), SCMP_SYS(socketpair),
    // Other processes.
    SCMP_SYS(pidfd_getfd), SCMP_SYS(pidfd_open), SCMP_SYS(pidfd_send_signal),
    SCMP_SYS(process_vm_readv), SCMP_SYS(process_vm_writev), SCMP_SYS(ptrace),
    // Privileges, namespaces and mounts.
    SCMP_SYS(capset), SCMP_SYS(chroot), SCMP_SYS(fsmount), SCMP_SYS(fsopen), SCMP_SYS(mount),
    SCMP_SYS(move_mount), SCMP_SYS(open_by_handle_at), SCMP_SYS(open_tree), SCMP_SYS(pivot_root),
    SCMP_SYS(setgid), SCMP_SYS(setns), SCMP_SYS(setuid), SCMP_SYS(umount2), SCMP_SYS(unshare),
    // The kernel itself.
    SCMP_SYS(add_key), SCMP_SYS(bpf), SCMP_SYS(delete_module), SCMP_SYS(finit_module),
    SCMP_SYS(init_module), SCMP_SYS(io_uring_enter), SCMP_SYS(io_uring_setup), SCMP_SYS(keyctl),
    SCMP_SYS(kexec_load), SCMP_SYS(perf_event_open), SCMP_SYS(reboot), SCMP_SYS(request_key),
    SCMP_SYS(userfaultfd)};

// Programs, which others than renderers start.
constexpr int kDeadlyPrograms[] = {SCMP_SYS(execve), SCMP_SYS(execveat), SCMP_SYS(fork),
                                   SCMP_SYS(kill), SCMP_SYS(vfork)};

// Collects rules; remembers the first error.
class Filter {
 public:
  // otherwise: what happens to calls without a rule.
  explicit Filter(uint32_t otherwise) : context_(seccomp_init(otherwise)) {
    if (context_ == nullptr) error_ = ENOMEM;
  }
  ~Filter() { seccomp_release(context_); }
  Filter(const Filter&) = delete;
  Filter& operator=(const Filter&) = delete;

  void Add(uint32_t action, int call) { Note(seccomp_rule_add(context_, action, call, 0)); }
  // Applies to calls whose argument, masked, has the value.
  void AddWhere(uint32_t action, int call, unsigned argument, scmp_datum_t mask,
                scmp_datum_t value) {
    Note(seccomp_rule_add(context_, action, call, 1,
                          SCMP_CMP64(argument, SCMP_CMP_MASKED_EQ, mask, value)));
  }
  absl::Status Load() {
    if (error_ == 0) Note(seccomp_attr_set(context_, SCMP_FLTATR_CTL_NNP, 0));
    // Other architectures' calls of this processor are as deadly.
    if (error_ == 0) {
      Note(seccomp_attr_set(context_, SCMP_FLTATR_ACT_BADARCH, SCMP_ACT_KILL_PROCESS));
    }
    // Older kernels slow filtered processes down against speculation, which protects a process from
    // code in itself: here there is one scene, and nothing else to read.
    if (error_ == 0) Note(seccomp_attr_set(context_, SCMP_FLTATR_CTL_SSB, 1));
    // A binary tree instead of a list: filters cost the calls of rendering less.
    if (error_ == 0) Note(seccomp_attr_set(context_, SCMP_FLTATR_CTL_OPTIMIZE, 2));
    if (error_ == 0) Note(seccomp_load(context_));
    return error_ == 0 ? absl::OkStatus() : StatusFromErrno(error_, "filtering system calls");
  }

 private:
  void Note(int result) {
    if (error_ == 0 && result < 0) error_ = -result;
  }

  const scmp_filter_ctx context_;
  int error_ = 0;
};

// Files are opened for reading only, and never created.
void AllowOpening(Filter* filter) {
  constexpr scmp_datum_t kWriting = O_ACCMODE | O_CREAT | O_TRUNC;
  filter->AddWhere(SCMP_ACT_ALLOW, SCMP_SYS(open), 1, kWriting, O_RDONLY);
  filter->AddWhere(SCMP_ACT_ALLOW, SCMP_SYS(openat), 2, kWriting, O_RDONLY);
}

// Threads, but no processes. clone3 hides its flags from filters; libraries then call clone.
void AllowThreads(Filter* filter) {
  filter->AddWhere(SCMP_ACT_ALLOW, SCMP_SYS(clone), 0, CLONE_THREAD, CLONE_THREAD);
  filter->AddWhere(SCMP_ACT_KILL_PROCESS, SCMP_SYS(clone), 0, CLONE_THREAD, 0);
  filter->Add(SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(clone3));
}

// abort() and the like signal this process; other processes are out of reach.
void AllowOwnSignals(Filter* filter) {
  filter->AddWhere(SCMP_ACT_ALLOW, SCMP_SYS(tgkill), 0, UINT32_MAX,
                   static_cast<scmp_datum_t>(::getpid()));
}

// Open files that come from the process's own worker; other descriptors fail.
void AllowReceivingFiles(Filter* filter) {
  filter->AddWhere(SCMP_ACT_ALLOW, SCMP_SYS(recvmsg), 0, UINT32_MAX, kChildSocket);
}

// Asking for the limits of this process.
void AllowReadingLimits(Filter* filter) {
  filter->AddWhere(SCMP_ACT_ALLOW, SCMP_SYS(prlimit64), 2, UINT64_MAX, 0);
  filter->Add(SCMP_ACT_ALLOW, SCMP_SYS(getrlimit));
}

}  // namespace

absl::Status FilterSystemCalls(bool writes) {
  Filter filter(SCMP_ACT_ERRNO(EPERM));
  for (const int call : kAllowed) filter.Add(SCMP_ACT_ALLOW, call);
  for (const int call : kDeadly) filter.Add(SCMP_ACT_KILL_PROCESS, call);
  for (const int call : kDeadlyPrograms) filter.Add(SCMP_ACT_KILL_PROCESS, call);
  if (writes) {
    for (const int call : kWritingCalls) filter.Add(SCMP_ACT_ALLOW, call);
  } else {
    AllowOpening(&filter);
  }
  AllowThreads(&filter);
  AllowOwnSignals(&filter);
  AllowReceivingFiles(&filter);
  AllowReadingLimits(&filter);
  return filter.Load();
}

absl::Status ForbidNetworkAndTracing() {
  Filter filter(SCMP_ACT_ALLOW);
  for (const int call : kDeadly) filter.Add(SCMP_ACT_ERRNO(EPERM), call);
  return filter.Load();
}

}  // namespace sheaf::worker
