// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// OwnCommand: the command line of this process as text that a shell takes, which a submission
// stores with its job.
#pragma once

#include <string>
#include <vector>

namespace sheaf::cli {

// "sheaf submit 'a room.pbrt' --samples 64". Leaves out --denoise-with: its command runs on the
// user's machine and may hold secrets. words: without the program's name.
std::string CommandText(const std::vector<std::string>& words);

// Keeps CommandText of this process. Called once, before any thread starts.
void NoteOwnCommand(int argc, char** argv);
// Empty before NoteOwnCommand.
const std::string& OwnCommand();

}  // namespace sheaf::cli
