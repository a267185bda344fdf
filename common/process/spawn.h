// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SpawnProcess: starts a program with the descriptors and variables that are named. ProcessGroup:
// such a program, which leads a group of processes that ends with an object.
#pragma once

#include <sys/types.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/content/file_descriptor.h"

namespace sheaf {

struct ProcessStart {
  std::string program;                 // A path.
  std::vector<std::string> arguments;  // With the program's name, which comes first.
  // "NAME=value"; none: the variables of this process.
  std::optional<std::vector<std::string>> environment;
  // Open descriptors of this process; -1: /dev/null.
  int input = -1, output = -1, error = -1;
  int socket = -1;  // Becomes descriptor kChildSocket; -1: none.
  // The process leads a group, and takes SIGPIPE, SIGXFSZ, SIGINT and SIGTERM as they are by
  // default, none of them blocked. Otherwise it has the group and the signals of this process.
  bool leads_group = false;
};

// The descriptor of a process by which it talks with the one that started it.
inline constexpr int kChildSocket = 3;

struct Pipe {
  FileDescriptor read, write;
};
// Both ends are closed in programs that are started. Errors: those of StatusFromErrno.
absl::StatusOr<Pipe> MakePipe();

// The variables of this process that libraries need to load: others may hold secrets.
std::vector<std::string> LoaderEnvironment();

// Starts the program; the caller waits for it. Other descriptors than those of `start` stay open in
// it unless they are O_CLOEXEC. Errors: those of StatusFromErrno, with the context given.
absl::StatusOr<pid_t> SpawnProcess(const ProcessStart& start, const std::string& context);

// Thread safety: none.
class ProcessGroup {
 public:
  // Sets leads_group. Errors: as SpawnProcess.
  static absl::StatusOr<std::unique_ptr<ProcessGroup>> Start(ProcessStart start,
                                                             const std::string& context);
  // Kills what remains of the group.
  ~ProcessGroup() { End(); }
  ProcessGroup(const ProcessGroup&) = delete;
  ProcessGroup& operator=(const ProcessGroup&) = delete;

  pid_t pid() const { return pid_; }
  // Whether the leader has ended.
  bool HasEnded() const;
  // Waits for the end of the leader for at most this long, kills what remains of the group, and
  // returns waitpid's status of the leader; the same when called again.
  int End(absl::Duration patience = absl::ZeroDuration());

 private:
  explicit ProcessGroup(pid_t pid) : pid_(pid) {}

  const pid_t pid_;
  std::optional<int> status_;
};

}  // namespace sheaf
