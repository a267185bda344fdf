// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/denoiser/user_command.h"

#include <fcntl.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <wordexp.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string_view>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "common/base/printable.h"
#include "common/base/status.h"
#include "common/base/steady_time.h"
#include "common/content/file_descriptor.h"
#include "common/process/spawn.h"

namespace sheaf::cli {
namespace {

namespace fs = std::filesystem;

constexpr absl::Duration kLookInterval = absl::Milliseconds(20);
// The end of a log that is read for its last line.
constexpr std::streamoff kLogBytesMax = 400;

bool IsProgram(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(path, error) && ::access(path.c_str(), X_OK) == 0;
}

std::optional<std::string> FindProgram(const std::string& name) {
  if (name.find('/') != std::string::npos) {
    return IsProgram(name) ? std::optional(name) : std::nullopt;
  }
  const char* const path = std::getenv("PATH");
  const std::vector<std::string> folders = absl::StrSplit(path == nullptr ? "" : path, ':');
  for (const std::string& folder : folders) {
    std::string file = absl::StrCat(folder.empty() ? "." : folder, "/", name);
    if (IsProgram(file)) return file;
  }
  return std::nullopt;
}

// Why wordexp refused a command.
const char* WhyNoWords(int code) {
  switch (code) {
    case WRDE_BADCHAR:
      return "it has one of | & ; < > ( ) { } or a line break outside of quotes, but no shell runs "
             "it; quote the character, or put the command into a script";
    case WRDE_BADVAL:
      return "it names a variable that is not set; set it, or put single quotes around the word";
    case WRDE_CMDSUB:
      return "it has $(...) or `...`, but no shell runs it; put the command into a script";
    case WRDE_NOSPACE:
      return "there is not enough memory";
    default:
      return "a quote or a brace has no end";
  }
}

// `; it says "..."`, by the last line of the log; empty if the log is.
std::string LastWords(const std::string& log) {
  std::ifstream file(log, std::ios::binary | std::ios::ate);
  if (!file) return "";
  const std::streamoff size = file.tellg();
  file.seekg(std::max<std::streamoff>(0, size - kLogBytesMax));
  std::string text(static_cast<size_t>(std::min(size, kLogBytesMax)), '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  std::string_view last = text;
  while (!last.empty() && absl::ascii_isspace(static_cast<unsigned char>(last.back()))) {
    last.remove_suffix(1);
  }
  last = last.substr(last.rfind('\n') + 1);
  return last.empty() ? "" : absl::StrCat("; it says \"", Printable(last), "\"");
}

// Explains a failure from waitpid's status; empty if the command succeeded.
std::string WhyFailed(int status) {
  if (WIFSIGNALED(status)) {
    const char* const name = ::sigdescr_np(WTERMSIG(status));
    return absl::StrCat("ended by signal ", WTERMSIG(status), " (",
                        name == nullptr ? "unknown" : name, ")");
  }
  const int code = WEXITSTATUS(status);
  return code == 0 ? "" : absl::StrCat("ended with exit status ", code);
}

}  // namespace

absl::StatusOr<std::vector<std::string>> ParseCommand(const std::string& command) {
  if (command.find('/') != std::string::npos && IsProgram(command)) {
    return std::vector<std::string>{command};
  }
  wordexp_t expanded{};
  const int code = ::wordexp(command.c_str(), &expanded, WRDE_NOCMD | WRDE_UNDEF);
  if (code != 0) {
    if (code == WRDE_NOSPACE) ::wordfree(&expanded);
    return absl::InvalidArgumentError(absl::StrCat(command, ": ", WhyNoWords(code)));
  }
  std::vector<std::string> words(expanded.we_wordv, expanded.we_wordv + expanded.we_wordc);
  ::wordfree(&expanded);
  if (words.empty()) return absl::InvalidArgumentError("the command is empty; name a program");
  const std::optional<std::string> program = FindProgram(words[0]);
  if (!program) {
    return absl::InvalidArgumentError(
        absl::StrCat(words[0], ": there is no such program",
                     words[0].find('/') == std::string::npos ? " in the folders of PATH" : "",
                     ", or it may not be executed; install it, or name it by its path"));
  }
  words[0] = *program;
  return words;
}

absl::Status RunCommand(const std::vector<std::string>& words, const std::string& log,
                        absl::Duration time_max, const std::stop_token& stop) {
  const FileDescriptor output(
      ::open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0600));
  if (!output.ok()) {
    const absl::Status status = StatusFromErrno(errno, absl::StrCat("cannot write ", log));
    return absl::FailedPreconditionError(status.message());
  }
  const absl::StatusOr<std::unique_ptr<ProcessGroup>> process = ProcessGroup::Start(
      {words[0], words, std::nullopt, -1, output.get(), output.get()}, "cannot be started");
  if (!process.ok()) return absl::FailedPreconditionError(process.status().message());
  const SteadyTime end = SteadyTime::Now() + time_max;
  bool ended = (*process)->HasEnded();
  while (!ended && !stop.stop_requested() && SteadyTime::Now() < end) {
    absl::SleepFor(kLookInterval);
    ended = (*process)->HasEnded();
  }
  const int status = (*process)->End();
  if (!ended && stop.stop_requested()) return absl::CancelledError("was interrupted");
  const std::string why = ended ? WhyFailed(status)
                                : absl::StrCat("did not end within ",
                                               absl::FormatDuration(time_max), " and was killed");
  if (why.empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(why, LastWords(log)));
}

}  // namespace sheaf::cli
