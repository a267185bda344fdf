// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Messages of commands beside their results, on standard error: a printable line for people or,
// with --json, one JSON object a line.
#pragma once

#include <string>

#include "cli/exit_code.h"

namespace sheaf::cli {

// From now on {"severity": "error", "message": ..., "exit_code": 4} and the like. Called before any
// thread begins.
void UseJsonMessages();

// "sheaf: TEXT": what happened.
void Tell(const std::string& text);
// "sheaf: note: TEXT".
void TellNote(const std::string& text);
// "TEXT", which begins with its place in a scene.
void TellOfScene(const std::string& text);
// "sheaf: TEXT", the reason to end with code.
void TellError(ExitCode code, const std::string& text);

}  // namespace sheaf::cli
