// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Runs a test and appends what it took to a file:
//
//   sheaf_test_timer FILE NAME COMMAND [ARGUMENT ...]
//
// A line has the name, the wall time and the CPU time in seconds, and the exit status (128 + N for
// signal N), separated by tabs. The CPU time is that of the test and of all its descendants that
// were waited for. Exits as the test does.
#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>

namespace {

constexpr int kUsageError = 2;
constexpr int kStartError = 127;

volatile pid_t child = 0;

void Forward(int signal) {
  if (child > 0) kill(child, signal);
}

double Seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: sheaf_test_timer FILE NAME COMMAND [ARGUMENT ...]\n");
    return kUsageError;
  }
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) signal(number, Forward);
  const auto begin = std::chrono::steady_clock::now();
  const pid_t pid = fork();
  if (pid == 0) {
    // ctest ends a test that hangs by SIGKILL to its own child, which is this program.
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    execvp(argv[3], argv + 3);
    std::fprintf(stderr, "%s: %s\n", argv[3], std::strerror(errno));
    _exit(kStartError);
  }
  if (pid < 0) {
    std::fprintf(stderr, "no process for %s: %s\n", argv[3], std::strerror(errno));
    return kStartError;
  }
  child = pid;
  int status = 0;
  rusage usage = {};
  while (wait4(pid, &status, 0, &usage) < 0) {
    if (errno != EINTR) return kStartError;
  }
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin;
  const int code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  char line[512];
  const int size = std::snprintf(line, sizeof line, "%s\t%.3f\t%.3f\t%d\n", argv[2], wall.count(),
                                 Seconds(usage.ru_utime) + Seconds(usage.ru_stime), code);
  // One write appends a whole line, also while other tests append theirs.
  const int file = open(argv[1], O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0644);
  if (file < 0 || size <= 0 || size >= static_cast<int>(sizeof line) ||
      write(file, line, static_cast<size_t>(size)) != size) {
    std::fprintf(stderr, "%s: could not be written\n", argv[1]);
  }
  return code;
}
