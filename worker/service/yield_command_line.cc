// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/yield_command_line.h"

#include <sys/resource.h>

#include <cerrno>
#include <cstring>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/surroundings/local_time.h"
#include "worker/yield/machine_use.h"

namespace sheaf::worker {
namespace {

constexpr double kProcessorsMax = 4096;
constexpr double kCalmSecondsMax = 86400;

}  // namespace

void AddYieldOptions(CLI::App* app, YieldArguments* arguments) {
  const OptionGroup group(app, "Yielding to the user of this machine");
  YieldOptions& limits = arguments->limits;
  app->add_option(
         "--nice", arguments->nice,
         absl::StrCat("Priority at which it renders: 0 (ordinary) to 19 (lowest) (default: "
                      "that of its parent; with --yield-load ",
                      kNiceWithYieldLoad, ")"))
      ->check(InRange(0, 19));
  app->add_option_function<std::string>(
         "--hours",
         [arguments](const std::string& text) {
           const absl::StatusOr<WorkingHours> hours = WorkingHours::Parse(text);
           if (!hours.ok()) {
             throw CLI::ValidationError("--hours", std::string(hours.status().message()));
           }
           arguments->limits.hours = *hours;
           arguments->by_hours = true;
         },
         "Take work in these hours only, by this machine's clock, e.g. 19:00-07:00 or "
         "Mon-Fri/20:00-06:30,Sat-Sun; outside them running tasks are finished within "
         "--grace-seconds or returned")
      ->type_name("HOURS");
  app->add_option("--yield-load", limits.processors_max,
                  "Take no work while other programs use more processors than this, as a mean over "
                  "ten seconds. Programs of a lower priority (nice) do not count, other workers so "
                  "neither")
      ->check(InRange(0.0, kProcessorsMax));
  app->add_option("--yield-memory", limits.memory_available_min,
                  "Take no work while less memory than this is available on this machine, e.g. 4G")
      ->transform(AsBytes());
  app->add_option_function<double>(
         "--yield-seconds", [&limits](double seconds) { limits.calm = absl::Seconds(seconds); },
         "Time without too much load and with enough memory after which it takes work again "
         "(default 120)")
      ->check(InRange(0.0, kCalmSecondsMax));
}

absl::Status ApplyNice(const YieldArguments& arguments) {
  const bool watches_load = arguments.limits.processors_max.has_value();
  if (watches_load && arguments.nice == 0) {
    return absl::InvalidArgumentError(
        "--yield-load counts programs of ordinary priority, and with --nice 0 this worker were one "
        "of them; give a --nice from 1 to 19, or none");
  }
  errno = 0;
  const int now = ::getpriority(PRIO_PROCESS, 0);
  int wanted = arguments.nice.value_or(now);
  if (!arguments.nice && watches_load && now <= 0) wanted = kNiceWithYieldLoad;
  if (wanted == now || ::setpriority(PRIO_PROCESS, 0, wanted) == 0) return absl::OkStatus();
  return absl::PermissionDeniedError(absl::StrCat("--nice ", wanted, ": ", std::strerror(errno),
                                                  "; this process was started with nice ", now));
}

std::function<std::string(uint64_t scene_bytes)> WhyAwayBy(const YieldArguments& arguments) {
  const YieldOptions& limits = arguments.limits;
  const bool reads_machine = limits.processors_max || limits.memory_available_min > 0;
  if (!arguments.by_hours && !reads_machine) return nullptr;
  return [yielding = std::make_shared<Yielding>(limits), reads_machine](uint64_t scene_bytes) {
    const MachineReading reading = reads_machine ? ReadMachine() : MachineReading();
    const absl::CivilMinute local = absl::ToCivilMinute(absl::Now(), LocalZone());
    return yielding->WhyAway(SteadyTime::Now(), local, reading, scene_bytes);
  };
}

}  // namespace sheaf::worker
