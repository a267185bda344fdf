// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Describes a program's command line to the generator of completion scripts.
#pragma once

#include <string>

#include "common/command_line/command_line.h"
#include "common/command_line/completion_script.h"

namespace sheaf {

// All options and commands of the program. job_names_command: as in CompletionProgram; an argument
// of the name JOB is a job.
CompletionProgram DescribeProgram(const CLI::App& app, const std::string& job_names_command);

// Adds --completion SHELL, which prints the script for a shell and ends the program. Requires: app
// outlives the parsing. Call after all other options were added.
void AddCompletionOption(CLI::App* app);

}  // namespace sheaf
