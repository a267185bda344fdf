// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/memory_room.h"

#include <sys/resource.h>
#include <unistd.h>

#include <fstream>
#include <optional>
#include <string_view>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace sheaf {
namespace {

// The first number of a file, or of the line that begins with key. None if it is "max" or there is
// no such file.
std::optional<uint64_t> ReadNumber(const std::string& path, std::string_view key = "") {
  std::ifstream file(path);
  std::string word;
  while (file >> word) {
    uint64_t number = 0;
    if (!key.empty() && word != key) {
      file.ignore(1 << 12, '\n');
      continue;
    }
    if (!key.empty() && !(file >> word)) break;
    if (absl::SimpleAtoi(word, &number)) return number;
    break;
  }
  return std::nullopt;
}

void Consider(uint64_t limit, uint64_t used, const std::string& name, MemoryRoom* room) {
  const uint64_t bytes = limit > used ? limit - used : 0;
  if (bytes < room->bytes) *room = {bytes, absl::StrCat(name, ", ", FormatMemory(limit), ")")};
}

// The process's path below the root of control groups: "/a/b"; "/" is the root. mark: the end of
// what precedes it in its line, with its slash.
std::string GroupOf(const std::string& proc, std::string_view mark) {
  std::ifstream file(absl::StrCat(proc, "/self/cgroup"));
  std::string line;
  while (std::getline(file, line)) {
    const size_t at = line.find(mark);
    if (at != std::string::npos) return line.substr(at + mark.size() - 1);
  }
  return "/";
}

// The page cache of files is part of the used memory, and is subtracted, as it can be reclaimed.
void ConsiderGroup(const std::string& folder, const char* max, const char* used,
                   const char* cache_key, MemoryRoom* room) {
  const std::optional<uint64_t> limit = ReadNumber(absl::StrCat(folder, "/", max));
  const std::optional<uint64_t> now = ReadNumber(absl::StrCat(folder, "/", used));
  if (!limit || !now) return;
  const uint64_t cache = ReadNumber(absl::StrCat(folder, "/memory.stat"), cache_key).value_or(0);
  Consider(*limit, *now > cache ? *now - cache : 0,
           absl::StrCat("the control group's limit of memory (", max), room);
}

// The process's group and all that it is in. In a container the files of its own group may be those
// of the root.
template <typename Consideration>
void ForEachGroup(std::string group, const Consideration& consider) {
  for (;; group.resize(group.rfind('/'))) {
    consider(group);
    if (group.empty() || group == "/") break;
  }
}

}  // namespace

std::string FormatMemory(uint64_t bytes) {
  constexpr uint64_t kKiB = uint64_t{1} << 10, kMiB = uint64_t{1} << 20, kGiB = uint64_t{1} << 30;
  if (bytes < kKiB) return absl::StrCat(bytes, " bytes");
  if (bytes < kMiB) return absl::StrCat((bytes + kKiB / 2) / kKiB, " KiB");
  if (bytes >= kGiB) return absl::StrFormat("%.1f GiB", static_cast<double>(bytes) / kGiB);
  return absl::StrCat((bytes + kMiB / 2) / kMiB, " MiB");
}

MemoryRoom FindMemoryRoom(uint64_t address_space_max, const std::string& proc,
                          const std::string& cgroup) {
  MemoryRoom room;
  if (address_space_max != UINT64_MAX) {
    const auto page = static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
    const uint64_t pages = ReadNumber(absl::StrCat(proc, "/self/statm")).value_or(0);
    Consider(address_space_max, pages * page, "the limit of address space (ulimit -v", &room);
  }
  ForEachGroup(GroupOf(proc, "0::/"), [&](const std::string& group) {
    ConsiderGroup(cgroup + group, "memory.max", "memory.current", "inactive_file", &room);
  });
  ForEachGroup(GroupOf(proc, ":memory:/"), [&](const std::string& group) {
    ConsiderGroup(cgroup + "/memory" + group, "memory.limit_in_bytes", "memory.usage_in_bytes",
                  "total_inactive_file", &room);
  });
  const std::string memory = absl::StrCat(proc, "/meminfo");
  constexpr uint64_t kKiB = 1024;
  const std::optional<uint64_t> total = ReadNumber(memory, "MemTotal:");
  const std::optional<uint64_t> available = ReadNumber(memory, "MemAvailable:");
  if (total && available && *available <= *total) {
    Consider(*total * kKiB, (*total - *available) * kKiB, "the machine's memory (in all", &room);
  }
  return room;
}

MemoryRoom FindMemoryRoom() {
  rlimit address_space{};
  const bool limited =
      ::getrlimit(RLIMIT_AS, &address_space) == 0 && address_space.rlim_cur != RLIM_INFINITY;
  return FindMemoryRoom(limited ? uint64_t{address_space.rlim_cur} : UINT64_MAX);
}

}  // namespace sheaf
