// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/usd/usd_scene.h"

#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/time.h"
#include "common/base/memory_room.h"
#include "common/base/printable.h"
#include "common/base/status.h"
#include "common/content/file_descriptor.h"
#include "common/process/child_process.h"
#include "common/process/module.h"
#include "common/process/spawn.h"

namespace sheaf::cli {
namespace {

constexpr const char* kEndings[] = {".usd", ".usda", ".usdc", ".usdz"};
constexpr size_t kHeadBytesMax = size_t{1} << 20;
constexpr size_t kNotesMax = 64;
constexpr size_t kNoteBytesMax = 1000;
// Between the end of the output and that of the process.
constexpr absl::Duration kEndTimeMax = absl::Seconds(10);
constexpr char kByOthers[] =
    "or export glTF: in Blender by File > Export > glTF 2.0, in Houdini by a ROP GLTF Output";

std::string FindNode() {
  const char* folders = std::getenv("PATH");
  if (folders == nullptr) return "";
  for (const std::string& folder : std::vector<std::string>(absl::StrSplit(folders, ':'))) {
    for (const char* name : {"node", "nodejs"}) {
      std::string program = absl::StrCat(folder, "/", name);
      if (folder.starts_with('/') && ::access(program.c_str(), X_OK) == 0) return program;
    }
  }
  return "";
}

// The script as an open file without a name.
absl::StatusOr<FileDescriptor> OpenScript() {
  FileDescriptor file(::memfd_create("sheaf-usd", MFD_CLOEXEC));
  if (!file.ok()) return StatusFromErrno(errno, "making a file in memory");
  const std::string_view script = UsdScript();
  for (size_t at = 0; at < script.size();) {
    const ssize_t written = ::write(file.get(), script.data() + at, script.size() - at);
    if (written < 0) return StatusFromErrno(errno, "writing a file in memory");
    at += static_cast<size_t>(written);
  }
  ::lseek(file.get(), 0, SEEK_SET);
  return file;
}

// All of the output, up to a limit.
absl::StatusOr<std::string> ReadAll(int descriptor, size_t bytes_max) {
  std::string bytes;
  std::string block(size_t{1} << 20, '\0');
  for (;;) {
    const ssize_t count = ::read(descriptor, block.data(), block.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return StatusFromErrno(errno, "reading what was converted");
    if (count == 0) return bytes;
    bytes.append(block, 0, static_cast<size_t>(count));
    if (bytes.size() > bytes_max) return absl::ResourceExhaustedError("it is too large as glTF");
  }
}

absl::Status DescribeEnd(int status, uint64_t memory_bytes) {
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 0;
  const int signal = WIFSIGNALED(status) ? WTERMSIG(status) : std::max(0, code - kExitBySignal);
  if (signal == SIGXCPU || signal == SIGKILL) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "converting it took more than ", kUsdCpuSecondsMax, " s of processor time, or was killed"));
  }
  if (signal == SIGABRT || signal == SIGTRAP || signal == SIGILL || signal == SIGSEGV) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "Node.js ended by a signal (", ::strsignal(signal), "): it needs more than the ",
        memory_bytes >> 20, " MiB of memory that it may use, or is broken"));
  }
  return absl::DataLossError(
      absl::StrCat("Node.js ended with exit code ", code, "; it must be version 18 or newer"));
}

// Numbers of an array of this size; false if it is none.
template <size_t kSize>
bool DecodeNumbers(const nlohmann::json& json, std::array<double, kSize>* numbers) {
  if (!json.is_array() || json.size() != kSize) return false;
  for (size_t i = 0; i < kSize; ++i) {
    if (!json[i].is_number()) return false;
    (*numbers)[i] = json[i].get<double>();
  }
  return true;
}

// The number of its image's bytes, which follow those of the scene; 0: it is malformed.
uint64_t DecodeEnvironment(const nlohmann::json& json, UsdEnvironment* environment) {
  if (!json.is_object() || !json.contains("image") || !json["image"].is_number_unsigned() ||
      !DecodeNumbers(json.value("rotation", nlohmann::json()), &environment->rotation) ||
      !DecodeNumbers(json.value("scale", nlohmann::json()), &environment->scale)) {
    return 0;
  }
  environment->ending = json.value("ending", nlohmann::json()) == ".exr" ? ".exr" : ".hdr";
  return json["image"].get<uint64_t>();
}

absl::StatusOr<UsdScene> Decode(std::string bytes, int status, uint64_t memory_bytes) {
  const size_t end = bytes.find('\n');
  if (end == std::string::npos || end > kHeadBytesMax) return DescribeEnd(status, memory_bytes);
  const auto head = nlohmann::json::parse(bytes.begin(), bytes.begin() + static_cast<long>(end),
                                          nullptr, /*allow_exceptions=*/false);
  if (!head.is_object()) return DescribeEnd(status, memory_bytes);
  if (const auto error = head.find("error"); error != head.end() && error->is_string()) {
    return absl::InvalidArgumentError(
        Printable(error->get<std::string>().substr(0, kNoteBytesMax)));
  }
  UsdScene scene;
  const uint64_t rest = bytes.size() - end - 1;
  uint64_t image_bytes = 0;
  if (const auto found = head.find("environment"); found != head.end()) {
    image_bytes = DecodeEnvironment(*found, &scene.environment.emplace());
    if (image_bytes == 0 || image_bytes > rest) return DescribeEnd(status, memory_bytes);
    scene.environment->image = bytes.substr(bytes.size() - image_bytes);
  }
  const auto size = head.find("glb");
  if (size == head.end() || !size->is_number_unsigned() ||
      size->get<uint64_t>() != rest - image_bytes) {
    return DescribeEnd(status, memory_bytes);
  }
  bytes.resize(bytes.size() - image_bytes);
  if (const auto notes = head.find("notes"); notes != head.end() && notes->is_array()) {
    for (const auto& note : *notes) {
      if (!note.is_string() || scene.notes.size() == kNotesMax) break;
      scene.notes.push_back(Printable(note.get<std::string>().substr(0, kNoteBytesMax)));
    }
  }
  bytes.erase(0, end + 1);
  scene.glb = std::move(bytes);
  return scene;
}

absl::StatusOr<UsdScene> Run(const std::string& path, const std::string& node) {
  const std::string program = FindInFolders(ModuleFolders(), kUsdReaderProgram);
  if (program.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat(kUsdReaderProgram,
                     " is missing beside this program; install all of Sheaf (see "
                     "its README)"));
  }
  const absl::StatusOr<FileDescriptor> script = OpenScript();
  if (!script.ok()) return script.status();
  absl::StatusOr<Pipe> pipe = MakePipe();
  if (!pipe.ok()) return pipe.status();
  const uint64_t memory_bytes = std::min(kUsdMemoryBytesMax, FindMemoryRoom().bytes);
  ProcessStart start{.program = program,
                     .arguments = {kUsdReaderProgram, node, path, absl::StrCat(memory_bytes),
                                   absl::StrCat(kUsdCpuSecondsMax)},
                     .environment = LoaderEnvironment(),
                     .input = script->get(),
                     .output = pipe->write.get()};
  absl::StatusOr<std::unique_ptr<ProcessGroup>> process =
      ProcessGroup::Start(std::move(start), "starting sheaf-usd-reader");
  if (!process.ok()) return process.status();
  pipe->write = FileDescriptor();
  absl::StatusOr<std::string> bytes = ReadAll(pipe->read.get(), UINT32_MAX);
  const int status = (*process)->End(bytes.ok() ? kEndTimeMax : absl::ZeroDuration());
  if (!bytes.ok()) return bytes.status();
  return Decode(*std::move(bytes), status, memory_bytes);
}

}  // namespace

bool IsUsdName(const std::string& name) {
  const std::string lower = absl::AsciiStrToLower(name);
  return std::ranges::any_of(kEndings,
                             [&lower](const char* ending) { return lower.ends_with(ending); });
}

std::string NameAsRead(const std::string& name) {
  return IsUsdName(name) ? absl::StrCat(name, ".glb") : name;
}

absl::StatusOr<UsdScene> ConvertUsd(const std::string& path) {
  std::error_code error;
  const std::filesystem::path real = std::filesystem::canonical(path, error);
  if (error) return StatusFromErrno(error.value(), path);
  const std::string node = FindNode();
  if (node.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        path,
        ": USD is read by Node.js, which is not installed: install it (on Debian: apt-get "
        "install nodejs), ",
        kByOthers));
  }
  absl::StatusOr<UsdScene> scene = Run(real.string(), node);
  if (!scene.ok()) return Annotate(scene.status(), path);
  return scene;
}

}  // namespace sheaf::cli
