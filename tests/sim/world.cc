// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/world.h"

#include <cstdio>
#include <utility>

#include "absl/strings/str_format.h"

namespace sheaf::sim {

void World::After(absl::Duration delay, std::function<void()> run) {
  events_.push({now() + delay, event_count_++, std::move(run)});
}

bool World::RunNext() {
  if (events_.empty()) return false;
  // Moved, for it may hold much; what the queue orders by stays.
  const Event event = std::move(const_cast<Event&>(events_.top()));
  events_.pop();
  if (event.time > now()) machine.Advance(event.time - now());
  ++step_count_;
  event.run();
  return true;
}

void World::Print(const std::string& line) const {
  const std::string text = absl::StrFormat("%6d %10.3f  %s\n", step_count_,
                                           absl::ToDoubleSeconds(now() - absl::Hours(1)), line);
  std::fputs(text.c_str(), stderr);
}

void World::Broken(const std::string& what) {
  Trace("BROKEN: ", what);
  if (broken_.empty()) broken_ = what;
}

}  // namespace sheaf::sim
