// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf-usd-reader: confines itself and becomes Node.js, which runs the script on its standard
// input and may read one folder. It gets as many protections as the system permits; the limits of
// memory and time always hold.
//
//   sheaf-usd-reader NODE FILE MEMORY_BYTES CPU_SECONDS
#include <sched.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "worker/sandbox/confinement.h"
#include "worker/sandbox/file_access_rules.h"
#include "worker/sandbox/readable_paths.h"
#include "worker/sandbox/system_call_filter.h"

namespace sheaf::worker {
namespace {

constexpr int kCannotConfine = 125, kCannotStart = 127;
// The heap of JavaScript has this part; buffers, which hold most of a scene, the rest.
constexpr uint64_t kHeapPart = 2;
// They start programs with shared libraries.
constexpr const char* kLoaders[] = {"/lib64/ld-linux-x86-64.so.2", "/lib/ld-linux-aarch64.so.1"};

bool Limit(__rlimit_resource resource, uint64_t value) {
  rlimit limit{};
  if (::getrlimit(resource, &limit) != 0) return false;
  limit.rlim_max = std::min<rlim_t>(limit.rlim_max, value);
  limit.rlim_cur = limit.rlim_max;
  return ::setrlimit(resource, &limit) == 0;
}

// The process gives this up for certain.
bool SetLimits(uint64_t memory_bytes, uint64_t cpu_seconds) {
  return Limit(RLIMIT_CORE, 0) && Limit(RLIMIT_FSIZE, 0) &&
         Limit(RLIMIT_NOFILE, kConfinedOpenFilesMax) && Limit(RLIMIT_CPU, cpu_seconds) &&
         Limit(RLIMIT_DATA, memory_bytes) && ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0;
}

// The system may not permit this.
void GiveUpMore(const std::string& node, const std::string& file) {
  (void)::unshare(CLONE_NEWUSER | CLONE_NEWNET | CLONE_NEWIPC);
  std::vector<std::string> readable = LibraryPaths();
  readable.push_back(std::filesystem::path(file).parent_path().string());
  readable.emplace_back("/dev/null");
  std::vector<std::string> programs = {node};
  std::error_code error;
  for (const char* loader : kLoaders) {
    if (std::filesystem::exists(loader, error)) programs.emplace_back(loader);
  }
  (void)AllowReadingOnly(readable, "", programs);
  (void)ForbidNetworkAndTracing();
}

int Become(const std::string& node, const std::string& file, uint64_t memory_bytes) {
  std::vector<std::string> arguments = {
      "node", absl::StrCat("--max-old-space-size=", (memory_bytes / kHeapPart) >> 20), "-", file};
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  // Its settings would be other files.
  std::string openssl = "OPENSSL_CONF=/dev/null";
  char* environment[] = {openssl.data(), nullptr};
  ::execve(node.c_str(), pointers.data(), environment);
  return kCannotStart;
}

int Main(int count, char** arguments) {
  uint64_t memory_bytes = 0, cpu_seconds = 0;
  if (count != 5 || !absl::SimpleAtoi(arguments[3], &memory_bytes) ||
      !absl::SimpleAtoi(arguments[4], &cpu_seconds)) {
    return kCannotConfine;
  }
  EndWithParent();
  ::close_range(STDERR_FILENO + 1, ~0U, 0);
  std::error_code error;
  const std::string node = std::filesystem::canonical(arguments[1], error).string();
  if (error || !SetLimits(memory_bytes, cpu_seconds)) return kCannotConfine;
  GiveUpMore(node, arguments[2]);
  return Become(node, arguments[2], memory_bytes);
}

}  // namespace
}  // namespace sheaf::worker

int main(int count, char** arguments) { return sheaf::worker::Main(count, arguments); }
