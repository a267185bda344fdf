// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>

#include "common/base/log_silence.h"
#include "common/base/printable.h"

namespace sheaf {
namespace {

spdlog::logger& Logger() {
  static const std::shared_ptr<spdlog::logger> logger = [] {
    auto made = std::make_shared<spdlog::logger>(
        "sheaf", std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
    made->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %v");
    made->flush_on(spdlog::level::info);
    return made;
  }();
  return *logger;
}

thread_local int silence_count = 0;

void Log(spdlog::level::level_enum level, std::string_view text) {
  if (silence_count == 0) Logger().log(level, "{}", Printable(text));
}

}  // namespace

bool LogLevelFromName(std::string_view name, LogLevel* level) {
  if (name == "debug")
    *level = LogLevel::kDebug;
  else if (name == "info")
    *level = LogLevel::kInfo;
  else if (name == "warning")
    *level = LogLevel::kWarning;
  else if (name == "error")
    *level = LogLevel::kError;
  else if (name == "off")
    *level = LogLevel::kOff;
  else
    return false;
  return true;
}

void SetLogLevel(LogLevel level) {
  constexpr spdlog::level::level_enum kLevels[] = {spdlog::level::debug, spdlog::level::info,
                                                   spdlog::level::warn, spdlog::level::err,
                                                   spdlog::level::off};
  Logger().set_level(kLevels[static_cast<int>(level)]);
}

void SetLogName(const std::string& name) {
  Logger().set_pattern("%Y-%m-%dT%H:%M:%S.%e%z " + name + " %^%l%$ %v");
}

void SetLogForRelay() { Logger().set_pattern("%l %v"); }

void RelayLog(std::string_view line) {
  const size_t space = line.find(' ');
  const std::string_view text =
      space == std::string_view::npos ? std::string_view() : line.substr(space + 1);
  const std::string_view level = line.substr(0, space);
  if (level == "debug") return LogDebug(text);
  if (level == "info") return LogInfo(text);
  if (level == "warning") return LogWarning(text);
  LogError(level == "error" ? text : line);
}

LogSilence::LogSilence() { ++silence_count; }
LogSilence::~LogSilence() { --silence_count; }

void LogDebug(std::string_view text) { Log(spdlog::level::debug, text); }
void LogInfo(std::string_view text) { Log(spdlog::level::info, text); }
void LogWarning(std::string_view text) { Log(spdlog::level::warn, text); }
void LogError(std::string_view text) { Log(spdlog::level::err, text); }

}  // namespace sheaf
