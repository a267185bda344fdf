// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ProgressLine: shows progress as a bar on a fixed line of a terminal, and as a plain line every
// few seconds in a pipe.
#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "sheaf/v1/job.pb.h"

namespace sheaf::cli {

// "1:02:03", "4:05" or "0:07".
std::string FormatDuration(double seconds);
// An estimated time: "850 ms", "12.3 s", "4.5 min", "1.2 h".
std::string FormatTime(double seconds);
// "1.23 k", "4.56 M", "7.89 G" and so on; below 1000 without a suffix.
std::string FormatCount(double count);
// "12.3 %, error (relMSE) 1.2e-03, 4.56 M samples/s, 0:42 left (0:35 to 0:50)": the items that are
// known.
std::string FormatProgress(const v1::Job& job);
// Merged pixel samples over the total, in [0, 1].
double FractionDone(const v1::Progress& progress);

class ProgressLine {
 public:
  using Clock = std::chrono::steady_clock;
  // Time between two plain lines in a pipe.
  static constexpr std::chrono::seconds kPlainInterval{3};

  // Writes to standard error, but nothing before `silence` has passed.
  explicit ProgressLine(Clock::duration silence = Clock::duration::zero());
  // For tests: writes through `write`, as to a terminal of width_columns, or as to a pipe if that
  // is 0.
  ProgressLine(int width_columns, std::function<Clock::time_point()> now,
               std::function<void(const std::string&)> write,
               Clock::duration silence = Clock::duration::zero());
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // fraction in [0, 1].
  void Show(const std::string& label, double fraction, const std::string& text);
  // Ends the line, so that other output begins on a new one. May be called at any time.
  void Finish();

 private:
  const int width_columns_;
  const std::function<Clock::time_point()> now_;
  const std::function<void(const std::string&)> write_;
  const Clock::time_point silent_until_;
  Clock::time_point last_plain_{};
  bool drawn_ = false;
};

}  // namespace sheaf::cli
