// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/task_border.h"

#include <new>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace sheaf::worker {
namespace {

absl::Status OutOfMemory(const std::string& what) {
  return absl::ResourceExhaustedError(
      absl::StrCat(what,
                   ": out of memory; make the scene smaller, or give this worker more memory "
                   "or fewer --threads"));
}

}  // namespace

absl::Status CatchOutOfMemory(const std::string& what, const std::function<void()>& step) {
  try {
    step();
  } catch (const std::bad_alloc&) {
    return OutOfMemory(what);
  } catch (const std::system_error& error) {
    // There was no memory for a thread's stack.
    if (error.code() != std::errc::resource_unavailable_try_again) throw;
    return OutOfMemory(what);
  }
  return absl::OkStatus();
}

}  // namespace sheaf::worker
