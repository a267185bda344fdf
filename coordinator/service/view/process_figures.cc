// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/view/process_figures.h"

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"

namespace sheaf::coordinator {
namespace {

using Kind = MetricView::Kind;

// Fields of /proc/self/stat after the program's name, from "state" on, which is number 3 in
// proc(5).
constexpr size_t kFirstField = 3;
constexpr size_t kStartTimeField = 22;  // In ticks since the system's start.
constexpr size_t kResidentField = 24;   // In pages.

std::vector<std::string> StatFields() {
  std::string text;
  std::ifstream file("/proc/self/stat");
  std::getline(file, text);
  const size_t name_end = text.rfind(')');  // The name may contain any character.
  if (name_end == std::string::npos) return {};
  return absl::StrSplit(text.substr(name_end + 1), ' ', absl::SkipEmpty());
}

std::optional<double> FieldOf(const std::vector<std::string>& fields, size_t number) {
  double value = 0;
  const size_t index = number - kFirstField;
  if (index >= fields.size() || !absl::SimpleAtod(fields[index], &value)) return std::nullopt;
  return value;
}

// When the system started, in Unix time.
std::optional<double> BootSeconds() {
  std::ifstream file("/proc/stat");
  std::string word;
  double seconds = 0;
  while (file >> word) {
    if (word == "btime" && file >> seconds) return seconds;
  }
  return std::nullopt;
}

std::optional<double> CpuSeconds() {
  rusage use{};
  if (getrusage(RUSAGE_SELF, &use) != 0) return std::nullopt;
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(use.ru_utime) + seconds(use.ru_stime);
}

std::optional<double> OpenFiles() {
  double count = 0;
  std::error_code error;
  for (std::filesystem::directory_iterator it("/proc/self/fd", error), end; !error && it != end;
       it.increment(error)) {
    ++count;
  }
  if (error || count < 1) return std::nullopt;
  return count - 1;  // Without the folder's own.
}

std::optional<double> OpenFilesMax() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return std::nullopt;
  return static_cast<double>(limit.rlim_cur);
}

}  // namespace

void AddProcessFigures(std::vector<MetricView>* metrics) {
  const auto add = [metrics](const char* name, const char* help, Kind kind,
                             std::optional<double> value) {
    if (value) metrics->push_back({name, help, kind, "", "", *value});
  };
  const std::vector<std::string> fields = StatFields();
  std::optional<double> resident = FieldOf(fields, kResidentField);
  if (resident) *resident *= static_cast<double>(sysconf(_SC_PAGESIZE));
  std::optional<double> start = FieldOf(fields, kStartTimeField);
  const std::optional<double> boot = BootSeconds();
  if (start && boot) start = *boot + *start / static_cast<double>(sysconf(_SC_CLK_TCK));
  if (!boot) start.reset();
  add("process_cpu_seconds_total", "CPU time of the coordinator.", Kind::kCounter, CpuSeconds());
  add("process_resident_memory_bytes", "Memory of the coordinator.", Kind::kGauge, resident);
  add("process_open_fds", "Open files and connections.", Kind::kGauge, OpenFiles());
  add("process_max_fds", "Limit of open files.", Kind::kGauge, OpenFilesMax());
  add("process_start_time_seconds", "Start of the coordinator, in Unix time.", Kind::kGauge, start);
}

}  // namespace sheaf::coordinator
