// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/surroundings/standard_streams.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

// The stream's error flag has no reason, so a pipe without a reader is asked for.
bool IsReaderGone() {
  pollfd output{STDOUT_FILENO, POLLOUT, 0};
  return ::poll(&output, 1, 0) == 1 && (output.revents & POLLERR) != 0;
}

// No sanitizer has begun when it runs.
__attribute__((no_sanitize("address"))) void OpenStandardStreams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(stream, F_GETFD) != -1 || errno != EBADF) continue;
    // In the other direction than its use, which therefore fails as with a closed descriptor. Lost
    // messages cannot be told of.
    const int flags = stream == STDOUT_FILENO ? O_RDONLY : O_WRONLY;
    // open(2) returns the lowest free number, which is this one. Without /dev/null, as in a bare
    // chroot, the program could not keep files off these numbers.
    if (::open("/dev/null", flags) != stream) std::abort();
  }
}

__attribute__((section(".preinit_array"),
               used)) void (*const kBeforeLibraries)() = OpenStandardStreams;

}  // namespace

int CodeAfterOutput(int code, const std::function<void(const std::string&)>& on_error) {
  const bool failed_before = std::ferror(stdout) != 0;
  errno = 0;
  const bool failed_now = std::fflush(stdout) != 0;
  const int reason = failed_now ? errno : 0;
  if ((!failed_before && !failed_now) || reason == EPIPE || IsReaderGone()) return code;
  on_error(absl::StrCat("standard output: not all could be written",
                        reason != 0 ? absl::StrCat(": ", std::strerror(reason)) : "",
                        "; what was printed is incomplete. Write it to an open file on a disk that "
                        "has room"));
  return code == 0 ? kOutputExitCode : code;
}

}  // namespace sheaf
