// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Runs all fuzz targets without libFuzzer, as a test: over the files of a corpus, and over changed
// versions of them. The changes are the same in every run.
//
//   fuzz_replay [--target NAME] [--changes N] FOLDER ...
//
// A folder holds one folder of files per target. If a target crashes, the input is left in
// crash-TARGET in the working directory; it becomes a file of tests/fuzz/regressions/TARGET.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "tests/fuzz/fuzz_target.h"

namespace sheaf::testing {
namespace {

// Longer files are not changed, since a copy per change would take the time of the test.
constexpr size_t kChangedBytesMax = 1 << 20;

std::map<std::string, FuzzFunction>& Targets() {
  static auto* const targets = new std::map<std::string, FuzzFunction>;
  return *targets;
}

// The input under way, for the handler of crashes.
std::string crash_path;
const std::string* input = nullptr;

extern "C" void SaveInput(int signal) {
  if (input != nullptr) {
    const int file = ::open(crash_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    if (::write(file, input->data(), input->size()) >= 0) {
      [[maybe_unused]] const ssize_t told =
          ::write(STDERR_FILENO, crash_path.data(), crash_path.size());
    }
  }
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void Run(FuzzFunction target, const std::string& bytes) {
  input = &bytes;
  target(bytes);
  input = nullptr;
}

// SplitMix64, Steele et al. 2014.
uint64_t Next(uint64_t* state) {
  uint64_t v = *state += 0x9e3779b97f4a7c15u;
  v = (v ^ (v >> 30)) * 0xbf58476d1ce4e5b9u;
  v = (v ^ (v >> 27)) * 0x94d049bb133111ebu;
  return v ^ (v >> 31);
}

// Overwrites a word or a byte, or cuts the end off. Sizes and offsets of binary files are at
// multiples of 4, most of them near the beginning.
void Change(std::string* bytes, uint64_t* state) {
  const uint64_t kind = Next(state) % 8;
  const uint64_t range = Next(state) % 2 == 0 ? std::min<uint64_t>(bytes->size(), 2048)
                                              : static_cast<uint64_t>(bytes->size());
  if (range < 16) return;
  uint64_t at = Next(state) % (range - 8);
  if (kind < 6) at &= ~uint64_t{3};
  const uint64_t word = kind == 0   ? ~uint64_t{0}
                        : kind == 1 ? 0
                                    : Next(state) >> (Next(state) % 64);
  if (kind == 7) {
    bytes->resize(at);
    return;
  }
  const uint64_t count = kind == 6 ? 1 : 4 + 4 * (Next(state) % 2);
  for (uint64_t i = 0; i < count; ++i) (*bytes)[at + i] = static_cast<char>(word >> (8 * i));
}

std::vector<std::string> ReadFolder(const std::string& folder) {
  std::vector<std::string> paths, files;
  std::error_code absent;
  for (const auto& entry : std::filesystem::directory_iterator(folder, absent)) {
    paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end());
  for (const std::string& path : paths) {
    std::ifstream file(path, std::ios::binary);
    files.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  return files;
}

// Returns the number of inputs.
int64_t Replay(const std::string& name, FuzzFunction target, int64_t change_count,
               const std::vector<std::string>& folders) {
  crash_path = "crash-" + name;
  int64_t inputs = 0;
  uint64_t state = 1;
  for (const std::string& folder : folders) {
    for (const std::string& file : ReadFolder(folder + "/" + name)) {
      Run(target, file);
      ++inputs;
      if (file.size() > kChangedBytesMax) continue;
      for (int64_t i = 0; i < change_count; ++i, ++inputs) {
        std::string bytes = file;
        for (uint64_t change = 0; change <= Next(&state) % 4; ++change) Change(&bytes, &state);
        Run(target, bytes);
      }
    }
  }
  return inputs;
}

int Main(const std::vector<std::string>& arguments) {
  std::vector<std::string> folders;
  std::string only;
  int64_t change_count = 0;
  for (size_t i = 0; i < arguments.size(); ++i) {
    if (arguments[i] == "--target" && i + 1 < arguments.size()) {
      only = arguments[++i];
    } else if (arguments[i] == "--changes" && i + 1 < arguments.size()) {
      change_count = std::strtoll(arguments[++i].c_str(), nullptr, 10);
    } else {
      folders.push_back(arguments[i]);
    }
  }
  for (const int signal : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL}) {
    std::signal(signal, &SaveInput);
  }
  int untested = 0;
  for (const auto& [name, target] : Targets()) {
    if (!only.empty() && name != only) continue;
    const std::clock_t start = std::clock();
    const int64_t inputs = Replay(name, target, change_count, folders);
    const double cpu_seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    std::printf("%-16s %lld inputs in %.2f CPU seconds\n", name.c_str(),
                static_cast<long long>(inputs), cpu_seconds);
    std::fflush(stdout);
    // Their corpora, by volume_seeds.
    const bool is_built = name == "volume" || name == "vdb" || name == "pages";
    if (inputs == 0 && (name == only || !is_built)) ++untested;
  }
  if (untested > 0) std::fprintf(stderr, "%d targets have no corpus\n", untested);
  return untested == 0 ? 0 : 1;
}

}  // namespace

bool AddFuzzTarget(const char* name, FuzzFunction function) {
  return Targets().emplace(name, function).second;
}

}  // namespace sheaf::testing

int main(int count, char** arguments) {
  return sheaf::testing::Main({arguments + 1, arguments + count});
}
