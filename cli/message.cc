// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/message.h"

#include <atomic>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/base/printable.h"

namespace sheaf::cli {
namespace {

using Json = nlohmann::ordered_json;

std::atomic<bool> as_json{false};

void Print(const char* severity, const char* prefix, const std::string& text,
           std::optional<ExitCode> code = std::nullopt) {
  std::string line = prefix + PrintableLines(text);
  if (as_json) {
    Json json = {{"severity", severity}, {"message", text}};
    if (code) json["exit_code"] = static_cast<int>(*code);
    line = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  std::fprintf(stderr, "%s\n", line.c_str());
}

}  // namespace

void UseJsonMessages() { as_json = true; }

void PrintInfo(const std::string& text) { Print("info", "sheaf: ", text); }
void PrintNote(const std::string& text) { Print("note", "sheaf: note: ", text); }
void PrintSceneNote(const std::string& text) { Print("note", "", text); }
void PrintError(ExitCode code, const std::string& text) { Print("error", "sheaf: ", text, code); }

}  // namespace sheaf::cli
