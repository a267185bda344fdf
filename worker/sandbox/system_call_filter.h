// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FilterSystemCalls: seccomp, by which a process gives up system calls. The door to libseccomp.
#pragma once

#include "absl/status/status.h"

namespace sheaf::worker {

// From now on, this process and its threads to come have only the system calls of rendering:
// reading files, memory, threads, clocks. Calls that only an intruder makes (sockets, programs,
// other processes, mounts, tracing) kill the process with SIGSYS; all others fail with EPERM, so
// that libraries do without them.
// writes: files may be made, written and removed, too.
// Requires: no new privileges (PR_SET_NO_NEW_PRIVS); one thread.
// Errors: kUnavailable if the kernel has no seccomp filters.
absl::Status FilterSystemCalls(bool writes = false);

// For programs of others, which need more: from now on, this process and its threads to come cannot
// use networks, trace or read other processes, mount, or change the kernel; such calls fail with
// EPERM. Requires and errors: as FilterSystemCalls.
absl::Status ForbidNetworkAndTracing();

}  // namespace sheaf::worker
