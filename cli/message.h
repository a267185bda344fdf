// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Messages that commands print beside their results, on standard error: a printable line of text
// or, with --json, one JSON object per line.
#pragma once

#include <string>

#include "cli/exit_code.h"

namespace sheaf::cli {

// Switches to JSON: {"severity": "error", "message": ..., "exit_code": 4} and the like. Requires:
// no thread has been started yet.
void UseJsonMessages();

// Prints "sheaf: TEXT": what happened.
void PrintInfo(const std::string& text);
// Prints "sheaf: note: TEXT".
void PrintNote(const std::string& text);
// Prints "TEXT", which begins with its place in a scene.
void PrintSceneNote(const std::string& text);
// Prints "sheaf: TEXT": why the command ends with `code`.
void PrintError(ExitCode code, const std::string& text);

}  // namespace sheaf::cli
