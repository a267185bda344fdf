// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/progress_line.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/duration.h"
#include "cli/error_text.h"

namespace sheaf::cli {
namespace {

constexpr int kBarColumnsMax = 30;
constexpr int kNarrowColumns = 60;  // Narrower terminals get no bar.

// 0 for pipes, and for terminals without escape sequences: an editor's shell, a build server.
int TerminalColumns() {
  const char* const term = std::getenv("TERM");
  const std::string_view name = term == nullptr ? "" : term;
  if (::isatty(STDERR_FILENO) == 0 || name.empty() || name == "dumb") return 0;
  winsize size{};
  if (::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

void WriteToStandardError(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stderr);
  std::fflush(stderr);
}

}  // namespace

std::string FormatDuration(double seconds) {
  const auto total = static_cast<int64_t>(std::llround(std::clamp(seconds, 0.0, 1e12)));
  if (total >= 3600) {
    return absl::StrFormat("%d:%02d:%02d", total / 3600, total / 60 % 60, total % 60);
  }
  return absl::StrFormat("%d:%02d", total / 60, total % 60);
}

std::string FormatTime(double seconds) {
  if (seconds < 1) return absl::StrFormat("%.0f ms", 1000 * seconds);
  if (seconds < 100) return absl::StrFormat("%.3g s", seconds);
  if (seconds < 6000) return absl::StrFormat("%.3g min", seconds / 60);
  return absl::StrFormat("%.3g h", seconds / 3600);
}

std::string FormatCount(double count) {
  const char* const letters[] = {"", "k", "M", "G", "T", "P"};
  size_t letter = 0;
  while (count >= 999.5 && letter + 1 < std::size(letters)) {
    count /= 1000;
    ++letter;
  }
  if (letter == 0) return absl::StrFormat("%.0f", count);
  return absl::StrFormat("%.3g %s", count, letters[letter]);
}

double FractionDone(const v1::Progress& progress) {
  if (progress.sample_count_total() == 0) return 0;
  return std::min(1.0, static_cast<double>(progress.sample_count_done()) /
                           static_cast<double>(progress.sample_count_total()));
}

namespace {

// The size in bytes of the longest beginning of the text that has at most this many columns.
// Only the plus-minus sign is not ASCII.
size_t BytesOf(const std::string& text, size_t columns) {
  size_t bytes = 0;
  for (size_t column = 0; column < columns && bytes < text.size(); ++column) {
    do {
      ++bytes;
    } while (bytes < text.size() && (static_cast<unsigned char>(text[bytes]) & 0xc0) == 0x80);
  }
  return bytes;
}

// The line, cut before the field that has no room; a line of one field is cut anywhere.
std::string WholeFields(const std::string& line, size_t columns) {
  const size_t size = BytesOf(line, columns);
  if (size == line.size()) return line;
  size_t end = size;
  int depth = 0;
  for (size_t i = 0; i <= size; ++i) {
    depth += line[i] == '(' ? 1 : line[i] == ')' ? -1 : 0;
    if (depth == 0 && (line[i] == ',' || line[i] == ';')) end = i;
  }
  return line.substr(0, end);
}

std::string FormatTimeLeft(const v1::Progress& progress) {
  const double left = Seconds(progress.remaining_duration());
  std::string text = absl::StrCat(FormatDuration(left), " left");
  if (!progress.has_remaining_duration_low()) return text;
  absl::StrAppend(&text, " (", FormatDuration(Seconds(progress.remaining_duration_low())), " to ",
                  FormatDuration(Seconds(progress.remaining_duration_high())));
  // Users may want to know if other jobs make most of the difference.
  constexpr double kMuchLess = 0.7;
  const double alone = Seconds(progress.remaining_duration_alone());
  if (alone < kMuchLess * left) {
    absl::StrAppend(&text, "; ", FormatDuration(alone), " without other jobs");
  }
  return absl::StrCat(text, ")");
}

}  // namespace

std::string FormatProgress(const v1::Job& job) {
  const v1::Progress& progress = job.progress();
  std::string text = absl::StrFormat("%.1f %%", 100 * FractionDone(progress));
  if (progress.relative_mse() > 0) {
    // Pixels without samples have no error yet.
    absl::StrAppend(
        &text, ", error ", FormatPixelError(progress.relative_mse()),
        progress.sample_count_done() < progress.sample_count_total() ? " so far" : "");
  }
  const double wall_seconds = Seconds(progress.wall_duration());
  // Samples from a resumed image were rendered earlier.
  const bool is_rendered = std::ranges::none_of(
      job.frames(), [](const v1::Frame& frame) { return frame.spec().has_resumed_image(); });
  if (is_rendered && wall_seconds > 0 && progress.sample_count_done() > 0) {
    absl::StrAppend(&text, ", ",
                    FormatCount(static_cast<double>(progress.sample_count_done()) / wall_seconds),
                    " samples/s");
  }
  if (progress.has_remaining_duration() &&
      progress.sample_count_done() < progress.sample_count_total()) {
    absl::StrAppend(&text, ", ", FormatTimeLeft(progress));
  }
  if (job.training_frame_count() == 1) absl::StrAppend(&text, "; training");
  if (job.training_frame_count() > 1) {
    absl::StrAppend(&text, "; training ", job.training_frame_count(), " frames");
  }
  if (job.state() == v1::Job::STATE_PAUSED) absl::StrAppend(&text, "; paused");
  if (job.incomplete_frame_count() > 0) {
    absl::StrAppend(&text, "; ", job.incomplete_frame_count(),
                    job.incomplete_frame_count() == 1 ? " frame is" : " frames are", " incomplete");
  }
  if (!job.waiting_reason().empty()) {
    const bool says_so = absl::StartsWith(job.waiting_reason(), "waiting ") ||
                         absl::StartsWith(job.waiting_reason(), "waits ");
    absl::StrAppend(&text, says_so ? "; " : "; waiting: ", job.waiting_reason());
  }
  if (progress.nonfinite_count() > 0) {
    absl::StrAppend(&text, "; ", progress.nonfinite_count(), " samples are not finite");
  }
  return text;
}

ProgressLine::ProgressLine(Clock::duration silence)
    : ProgressLine(TerminalColumns(), Clock::now, WriteToStandardError, silence) {}

ProgressLine::ProgressLine(int width_columns, std::function<Clock::time_point()> now,
                           std::function<void(const std::string&)> write, Clock::duration silence)
    : width_columns_(width_columns),
      now_(std::move(now)),
      write_(std::move(write)),
      silent_until_(now_() + silence) {}

ProgressLine::~ProgressLine() { Finish(); }

void ProgressLine::Show(const std::string& label, double fraction, const std::string& text) {
  if (now_() < silent_until_) return;
  if (width_columns_ == 0) {
    if (drawn_ && now_() - last_plain_ < kPlainInterval) return;
    last_plain_ = now_();
    drawn_ = true;
    write_(absl::StrCat(label, ": ", text, "\n"));
    return;
  }
  std::string line = label;
  if (width_columns_ >= kNarrowColumns) {
    const int filled = static_cast<int>(std::clamp(fraction, 0.0, 1.0) * kBarColumnsMax);
    absl::StrAppend(&line, " [", std::string(static_cast<size_t>(filled), '#'),
                    std::string(static_cast<size_t>(kBarColumnsMax - filled), '.'), "]");
  }
  absl::StrAppend(&line, " ", text);
  // One column stays free: some terminals wrap after the last column is written.
  line = WholeFields(line, static_cast<size_t>(width_columns_ - 1));
  drawn_ = true;
  write_(absl::StrCat("\r", line, "\x1b[K"));
}

void ProgressLine::Finish() {
  if (width_columns_ == 0) return;  // Each line has ended; the next one keeps its interval.
  if (drawn_) write_("\n");
  drawn_ = false;
}

}  // namespace sheaf::cli
