// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/yield/machine_use.h"

#include <unistd.h>

#include <fstream>
#include <limits>

#include "absl/strings/str_cat.h"

namespace sheaf::worker {
namespace {

// Readings closer together than this part of the window replace each other: the queue stays short.
constexpr int kReadingsPerWindow = 20;

}  // namespace

MachineReading ReadMachine(const std::string& proc) {
  MachineReading reading;
  std::ifstream stat(absl::StrCat(proc, "/stat"));
  std::string name;
  uint64_t ticks = 0;
  if (stat >> name >> ticks && name == "cpu") {
    reading.processor_seconds =
        static_cast<double>(ticks) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  }
  std::ifstream memory(absl::StrCat(proc, "/meminfo"));
  uint64_t kibibytes = 0;
  while (memory >> name) {
    if (name == "MemAvailable:" && memory >> kibibytes) {
      reading.memory_available = kibibytes << 10;
      break;
    }
    memory.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return reading;
}

std::optional<double> ProcessorUse::Add(SteadyTime now, double processor_seconds) {
  // The second one, too, is a window old: the first is no longer needed.
  while (readings_.size() >= 2 && now - readings_[1].first >= window_) readings_.pop_front();
  std::optional<double> mean;
  if (!readings_.empty() && now - readings_.front().first >= window_) {
    const auto& [since, before] = readings_.front();
    mean = (processor_seconds - before) / absl::ToDoubleSeconds(now - since);
  }
  const absl::Duration spacing = window_ / kReadingsPerWindow;
  if (readings_.empty() || now - readings_.back().first >= spacing) {
    readings_.emplace_back(now, processor_seconds);
  }
  return mean;
}

}  // namespace sheaf::worker
