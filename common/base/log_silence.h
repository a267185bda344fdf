// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LogSilence: while one exists, its thread logs nothing. For work that another process repeats, and
// logs about.
#pragma once

namespace sheaf {

class LogSilence {
 public:
  LogSilence();
  ~LogSilence();
  LogSilence(const LogSilence&) = delete;
  LogSilence& operator=(const LogSilence&) = delete;
};

}  // namespace sheaf
