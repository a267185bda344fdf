// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Logging: one line of text per event, to standard error. The only file that uses spdlog.
#pragma once

#include <string>
#include <string_view>

namespace sheaf {

enum class LogLevel { kDebug, kInfo, kWarning, kError, kOff };
// Returns false if the name is not one of debug, info, warning, error, off.
bool LogLevelFromName(std::string_view name, LogLevel* level);
void SetLogLevel(LogLevel level);
// Adds the program's name to every line ("sheaf-worker"). Call once at start.
void SetLogName(const std::string& name);
// Writes only "LEVEL TEXT", for a parent process that reads the lines and passes them to RelayLog.
// Call once at start.
void SetLogForRelay();

// Logs a line that a child process wrote. Lines of another form are errors.
void RelayLog(std::string_view line);

// Thread safety: may be called from any thread.
void LogDebug(std::string_view text);
void LogInfo(std::string_view text);
void LogWarning(std::string_view text);
void LogError(std::string_view text);

}  // namespace sheaf
