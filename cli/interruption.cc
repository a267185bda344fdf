// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/interruption.h"

#include <signal.h>
#include <unistd.h>

#include "absl/time/time.h"
#include "cli/exit_code.h"
#include "cli/message.h"
#include "common/base/mutex.h"

namespace sheaf::cli {
namespace {

[[noreturn]] void EndNow(const char* why) {
  PrintError(ExitCode::kInterrupted, why);
  ::_exit(static_cast<int>(ExitCode::kInterrupted));
}

void EndAfter(std::chrono::milliseconds grace, const std::stop_token& ended) {
  if (SleepUnlessStopped(absl::FromChrono(grace), ended)) {
    EndNow("interrupted; work in progress did not end in time");
  }
}

}  // namespace

Interruption::Interruption(std::chrono::milliseconds grace)
    : grace_(grace), signals_([this](int, int count) { OnSignal(count); }) {}

Interruption::~Interruption() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&signals, number);
  ::pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
}

std::stop_token Interruption::token() const {
  is_heeded_ = true;
  return stop_.get_token();
}

void Interruption::OnSignal(int count) {
  if (!is_heeded_) EndNow("interrupted");
  if (count > 1) ::_exit(static_cast<int>(ExitCode::kInterrupted));
  deadline_ = std::jthread([this](const std::stop_token& ended) { EndAfter(grace_, ended); });
  stop_.request_stop();
}

}  // namespace sheaf::cli
