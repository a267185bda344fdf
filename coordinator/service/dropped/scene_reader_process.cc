// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/dropped/scene_reader_process.h"

#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <memory>
#include <string_view>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/memory_room.h"
#include "common/base/status.h"
#include "common/base/steady_time.h"
#include "common/content/file_descriptor.h"
#include "common/process/child_process.h"
#include "common/process/spawn.h"

namespace sheaf::coordinator {
namespace {

namespace fs = std::filesystem;

// As in the program (kDroppedSceneFlag of cli/dropped).
constexpr char kReaderFlag[] = "--dropped-scene";
// A process that has closed its output is about to end.
constexpr absl::Duration kEndPatience = absl::Seconds(5);

// The process, its input and its output.
class ReaderProcess {
 public:
  static absl::StatusOr<ReaderProcess> Start(const std::string& program) {
    absl::StatusOr<Pipe> input = MakePipe();
    if (!input.ok()) return input.status();
    absl::StatusOr<Pipe> output = MakePipe();
    if (!output.ok()) return output.status();
    absl::StatusOr<std::unique_ptr<ProcessGroup>> group =
        ProcessGroup::Start({program,
                             {program, kReaderFlag},
                             LoaderEnvironment(),
                             input->read.get(),
                             output->write.get()},
                            absl::StrCat("starting ", program));
    if (!group.ok()) return group.status();
    return ReaderProcess(*std::move(group), std::move(input->write), std::move(output->read));
  }

  pid_t pid() const { return group_->pid(); }
  int output() const { return output_.get(); }

  // Requires: less than a pipe's capacity, so that it does not block.
  absl::Status Give(std::string_view request) {
    const ssize_t written = ::write(input_.get(), request.data(), request.size());
    input_.Close();
    if (written == static_cast<ssize_t>(request.size())) return absl::OkStatus();
    return absl::UnavailableError("the process that reads scenes took no request");
  }

  // As ProcessGroup::End.
  int End(absl::Duration patience) { return group_->End(patience); }

 private:
  ReaderProcess(std::unique_ptr<ProcessGroup> group, FileDescriptor input, FileDescriptor output)
      : group_(std::move(group)), input_(std::move(input)), output_(std::move(output)) {}

  std::unique_ptr<ProcessGroup> group_;
  FileDescriptor input_, output_;
};

absl::Status LimitCpu(pid_t pid, absl::Duration cpu_max) {
  const auto seconds = static_cast<rlim_t>(absl::ToInt64Seconds(cpu_max));
  const rlimit limit{seconds, seconds};
  if (::prlimit(pid, RLIMIT_CPU, &limit, nullptr) != 0) {
    return StatusFromErrno(errno, "limiting the processor time of the process that reads scenes");
  }
  return absl::OkStatus();
}

// Whether the written files are within the limits. A folder that is being changed may be counted
// partly.
absl::Status CheckWritten(const std::string& folder, const ReaderProcessLimits& limits) {
  uint64_t bytes = 0, files = 0;
  std::error_code error;
  fs::recursive_directory_iterator it(folder, fs::directory_options::skip_permission_denied, error);
  for (; !error && it != fs::recursive_directory_iterator(); it.increment(error)) {
    std::error_code gone;
    ++files;
    if (fs::is_regular_file(it->symlink_status(gone))) {
      const uint64_t size = it->file_size(gone);
      if (!gone) bytes += size;
    }
  }
  // Folders count, too: at most one per file is needed.
  if (files <= uint64_t{2} * limits.written_files_max && bytes <= limits.written_bytes_max) {
    return absl::OkStatus();
  }
  return absl::ResourceExhaustedError(absl::StrCat(
      "the files within the dropped ones are larger than ", FormatMemory(limits.written_bytes_max),
      " or more than ", limits.written_files_max, "; use sheaf submit"));
}

// Appends received data to *reply. Returns whether more may come.
absl::StatusOr<bool> ReadSome(int output, size_t bytes_max, std::string* reply) {
  char piece[64 << 10];
  const ssize_t size = ::read(output, piece, sizeof piece);
  if (size < 0 && errno == EINTR) return true;
  if (size < 0) return StatusFromErrno(errno, "reading from the process that reads scenes");
  if (size == 0) return false;
  reply->append(piece, static_cast<size_t>(size));
  if (reply->size() <= bytes_max) return true;
  return absl::ResourceExhaustedError(
      "the scene has too many frames or messages; use sheaf submit");
}

absl::StatusOr<std::string> AwaitReply(const ReaderProcess& process, const std::string& folder,
                                       const ReaderProcessLimits& limits,
                                       const std::stop_token& stop) {
  std::string reply;
  const SteadyTime begin = SteadyTime::Now();
  SteadyTime next_look = begin + kWrittenInterval;
  while (true) {
    if (stop.stop_requested()) return absl::CancelledError("the coordinator stops");
    const SteadyTime now = SteadyTime::Now();
    if (now - begin > limits.wall_max) {
      return absl::DeadlineExceededError(absl::StrCat("reading the scene takes longer than ",
                                                      absl::FormatDuration(limits.wall_max),
                                                      "; use sheaf submit"));
    }
    if (now > next_look) {
      absl::Status written = CheckWritten(folder + "/scratch", limits);
      if (!written.ok()) return written;
      next_look = SteadyTime::Now() + kWrittenInterval;
    }
    pollfd ready{process.output(), POLLIN, 0};
    const int milliseconds = static_cast<int>(absl::ToInt64Milliseconds(kWrittenInterval));
    if (::poll(&ready, 1, milliseconds) <= 0) continue;
    const absl::StatusOr<bool> more = ReadSome(process.output(), limits.reply_bytes_max, &reply);
    if (!more.ok()) return more.status();
    if (!*more) return reply;
  }
}

// Why a process that gave no answer ended.
absl::Status EndedError(int status, const ReaderProcessLimits& limits) {
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 0;
  const int number = WIFSIGNALED(status) ? WTERMSIG(status) : code - kExitBySignal;
  if (number == SIGXCPU) {
    return absl::DeadlineExceededError(absl::StrCat("reading the scene takes more than ",
                                                    absl::FormatDuration(limits.cpu_max),
                                                    " of processor time; use sheaf submit"));
  }
  const std::string how =
      number > 0 ? absl::StrCat("by signal ", number) : absl::StrCat("with code ", code);
  return absl::InvalidArgumentError(absl::StrCat(
      "the process that read the scene ended ", how, ": the scene is damaged, or needs more than ",
      FormatMemory(limits.memory_bytes_max), " of memory; sheaf plan SCENE tells more"));
}

}  // namespace

absl::StatusOr<v1::PrepareReply> ReadDroppedScene(const std::string& program,
                                                  const std::string& folder,
                                                  v1::PrepareRequest request,
                                                  const ReaderProcessLimits& limits,
                                                  const std::stop_token& stop) {
  request.set_folder(folder);
  request.set_memory_bytes_max(limits.memory_bytes_max);
  request.set_written_bytes_max(limits.written_bytes_max);
  request.set_written_files_max(limits.written_files_max);
  absl::StatusOr<ReaderProcess> process = ReaderProcess::Start(program);
  if (!process.ok()) return process.status();
  absl::Status status = LimitCpu(process->pid(), limits.cpu_max);
  if (status.ok()) status = process->Give(request.SerializeAsString());
  if (!status.ok()) return status;
  const absl::StatusOr<std::string> bytes = AwaitReply(*process, folder, limits, stop);
  if (!bytes.ok()) return bytes.status();
  v1::PrepareReply reply;
  if (bytes->empty() || !reply.ParseFromString(*bytes)) {
    return EndedError(process->End(kEndPatience), limits);
  }
  return reply;
}

}  // namespace sheaf::coordinator
