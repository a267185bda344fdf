// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ActingScenes: a renderer for tests that does what the name of the main file says, such as
// crashing.
#pragma once

#include <fcntl.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/check.h"
#include "common/base/log.h"
#include "common/volume/volume_file.h"
#include "worker/sandbox/scene_messages.h"
#include "worker/sandbox/scene_opener.h"
#include "worker/sandbox/scene_process.h"

namespace sheaf::worker {

inline constexpr char kSceneProcess[] = "--scene-process";

inline std::string TakeMemory() {
  std::vector<std::unique_ptr<char[]>> taken;
  while (true) {
    taken.push_back(std::make_unique<char[]>(size_t{16} << 20));
    for (size_t i = 0; i < size_t{16} << 20; i += 4'096) taken.back()[i] = 1;
  }
}

inline void WriteNowhere() {
  volatile int* volatile nowhere = nullptr;
  *nowhere = 1;
}

// The processes that this one has started, and those that they have.
inline std::vector<pid_t> Descendants() {
  std::vector<pid_t> found = {::getpid()};
  for (size_t i = 0; i < found.size(); ++i) {
    for (const auto& task :
         std::filesystem::directory_iterator(absl::StrCat("/proc/", found[i], "/task"))) {
      std::ifstream children(task.path() / "children");
      for (pid_t child = 0; children >> child;) found.push_back(child);
    }
  }
  found.erase(found.begin());
  return found;
}

[[noreturn]] inline void Loop() {
  std::atomic<uint64_t> turns{0};
  while (true) ++turns;
}

inline std::string Open(const std::string& path, int flags) {
  const int file = ::open(path.c_str(), flags, 0600);
  const std::string result = file < 0 ? ::strerrorname_np(errno) : "opened";
  if (file >= 0) ::close(file);
  return result;
}

inline std::string Waits(const std::stop_token& stop) {
  while (!stop.stop_requested()) ::usleep(1'000);
  return "stopped";
}

// Does what the name says, and returns what it sees.
inline std::string Act(const std::string& what, const std::stop_token& stop) {
  if (what == "crash") WriteNowhere();
  if (what == "check") SHEAF_CHECK(what.empty());
  if (what == "memory") return TakeMemory();
  if (what == "loop") Loop();
  if (what == "wait") return Waits(stop);
  if (what == "socket") return absl::StrCat(::socket(AF_INET, SOCK_STREAM, 0));
  if (what == "fork") return absl::StrCat(::fork());
  if (what == "exec") return absl::StrCat(::execl("/bin/true", "true", nullptr));
  if (what == "trace") return absl::StrCat(::ptrace(PTRACE_ATTACH, ::getppid(), 0, 0));
  if (what == "exit") ::_exit(7);
  if (what == "pid") return absl::StrCat(::getpid());
  if (what == "write") return Open("/tmp/written-by-a-scene", O_WRONLY | O_CREAT);
  if (what == "environment") return std::getenv("SHEAF_SECRET") == nullptr ? "none" : "leaked";
  if (what == "garbage") return absl::StrCat(::write(kSceneSocket, "\xff\xff\xff\xff\0\0\0\0", 8));
  if (what == "noise") {
    for (int i = 0; i < 3 * kOutputLinesMax; ++i) LogWarning("noise");
  }
  if (absl::StartsWith(what, "open ")) return Open(what.substr(5), O_RDONLY);
  return "rendered " + what;
}

class ActingScene : public OpenScene {
 public:
  explicit ActingScene(std::string what) : what_(std::move(what)) {}
  uint64_t memory_bytes() const override { return 1'000; }
  absl::Status SetField(std::string_view field, std::stop_token /*stop*/) const override {
    if (field == "none") return absl::DataLossError("other bytes");
    if (field == "broken") return absl::NotFoundError("broken");
    field_ = field;
    return absl::OkStatus();
  }
  absl::StatusOr<RenderedPart> Render(const Lease& lease, std::stop_token stop) const override {
    if (what_ == "field") return RenderedPart{field_, 5, 1e9};
    if (lease.kind == TaskKind::kTraining) return RenderedPart{"a field", 5, 1e9};
    if (what_ == "pretend to be cancelled") return absl::CancelledError("stopped");
    RenderedPart part{Act(what_, stop), 5, 1e9};
    if (stop.stop_requested()) return absl::CancelledError("stopped");
    return part;
  }

 private:
  const std::string what_;
  mutable std::string field_;
};

// The bytes of files that a worker fetches, one for each letter of `names`, asked for at once.
inline std::string ReadOnDemand(const SceneInputs& inputs, const std::string& names) {
  std::vector<std::string> bytes(names.size());
  {
    std::vector<std::jthread> readers;
    for (size_t i = 0; i < names.size(); ++i) {
      readers.emplace_back([&, i] {
        const auto file = inputs.open_on_demand(names[i] == '?' ? "none" : names.substr(i, 1), {});
        bytes[i].resize(file.ok() ? file->size() : 0);
        if (!file.ok() || !file->Read(0, bytes[i].size(), bytes[i].data())) {
          bytes[i] = std::string(file.status().message());
        }
      });
    }
  }
  return absl::StrJoin(bytes, " ");
}

// "crash" acts while it loads, "render crash" while it renders; "read NAME" opens a file of the
// scene; "volume NAME" reads a grid of one.
class ActingScenes : public SceneOpener {
 public:
  OpenResult Open(const SceneInputs& inputs, std::stop_token stop) override {
    const std::string& what = inputs.main_file;
    if (absl::StartsWith(what, "render ")) {
      return {std::make_unique<ActingScene>(what.substr(7)), absl::OkStatus(), {}};
    }
    if (absl::StartsWith(what, "fetch ")) {
      return {nullptr, absl::InvalidArgumentError(ReadOnDemand(inputs, what.substr(6))),
              FailureKind::kScene};
    }
    if (absl::StartsWith(what, "volume ")) {
      const std::string& path = inputs.local_paths.at(what.substr(7));
      const auto grid = ReadVolumeGrid("smoke.vdb", path, "density");
      return {nullptr,
              grid.ok() ? absl::InvalidArgumentError(absl::StrCat(grid->info().values.max))
                        : grid.status(),
              FailureKind::kScene};
    }
    if (absl::StartsWith(what, "read ")) {
      std::ifstream file(inputs.local_paths.at(what.substr(5)));
      std::string text;
      std::getline(file, text);
      return {nullptr, absl::InvalidArgumentError(text), FailureKind::kScene};
    }
    return {nullptr, absl::InvalidArgumentError(Act(what, stop)), FailureKind::kScene};
  }
};

}  // namespace sheaf::worker
