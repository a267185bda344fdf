// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/command_line/completion_script.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace sheaf {
namespace {

using ::testing::HasSubstr;

CompletionProgram Sheaf() {
  return {"sheaf",
          {{"--version", "Version", false}},
          {{"submit",
            "Render on a farm",
            {{"--samples", "Samples per pixel", true},
             {"--wait", "It's [fast]: wait", false},
             {"--color", "Colors of a path", true, {"auto", "rgb"}},
             {"--aov", "Quantities", true, {}, {"position", "motion", "uv"}}}},
           {"watch", "Watch a job", {{"--json", "JSON", false}}, {}, true},
           {"completion", "For a shell", {}, {"bash", "zsh"}}},
          "sheaf completion jobs 2>/dev/null"};
}

std::string OutputOf(const std::string& command) {
  std::string output;
  FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return output;
  char buffer[256];
  while (std::fgets(buffer, sizeof buffer, pipe) != nullptr) output += buffer;
  ::pclose(pipe);
  return output;
}

TEST(CompletionScriptTest, BashCompletesCommandsAndTheirOptions) {
  const std::string path = ::testing::TempDir() + "/sheaf_completion.bash";
  std::ofstream(path) << CompletionScript(Shell::kBash, Sheaf());
  const auto complete = [&](const std::string& words, int index) {
    return OutputOf("bash -c 'source " + path + "; COMP_WORDS=(" + words +
                    "); COMP_CWORD=" + std::to_string(index) + "; _sheaf; echo ${COMPREPLY[@]}'");
  };
  EXPECT_EQ(complete("sheaf s", 1), "submit\n");
  EXPECT_EQ(complete("sheaf \"\"", 1), "submit watch completion\n");
  EXPECT_EQ(complete("sheaf submit --color \"\"", 3), "auto rgb\n");
  EXPECT_EQ(complete("sheaf submit --color r", 3), "rgb\n");
  EXPECT_EQ(complete("sheaf submit --color = \"\"", 4), "auto rgb\n");  // --color=
  EXPECT_EQ(complete("sheaf submit --color =", 3), "auto rgb\n");
  EXPECT_EQ(complete("sheaf submit --color = r", 4), "rgb\n");
  EXPECT_EQ(complete("sheaf submit --aov po", 3), "position\n");
  EXPECT_EQ(complete("sheaf submit --aov position,mo", 3), "position,motion\n");
  EXPECT_EQ(complete("sheaf submit --aov uv,position,", 3),
            "uv,position,position uv,position,motion uv,position,uv\n");
  EXPECT_EQ(complete("sheaf submit --aov = uv,m", 4), "uv,motion\n");
  EXPECT_EQ(complete("sheaf completion z", 2), "zsh\n");
  EXPECT_EQ(complete("sheaf --", 1), "--version\n");
  EXPECT_EQ(complete("sheaf submit --sa", 2), "--samples\n");
  EXPECT_EQ(complete("sheaf submit roo", 2), "\n");  // The shell completes files itself.
}

TEST(CompletionScriptTest, HelpTextIsQuoted) {
  for (const Shell shell : {Shell::kZsh, Shell::kFish}) {
    const std::string script = CompletionScript(shell, Sheaf());
    EXPECT_THAT(script, HasSubstr("Its (fast), wait"));
    EXPECT_THAT(script, HasSubstr("samples"));
    EXPECT_THAT(script, HasSubstr("watch"));
    EXPECT_THAT(script, HasSubstr("auto rgb"));
    EXPECT_THAT(script, HasSubstr(", " + std::string(shell == Shell::kZsh ? "value " : "") +
                                  "position motion uv"));
    EXPECT_THAT(script, HasSubstr("sheaf completion jobs"));
  }
}

TEST(CompletionScriptTest, BashCompletesJobNames) {
  const std::string folder = ::testing::TempDir() + "/sheaf_completion_jobs";
  std::filesystem::create_directories(folder);
  std::ofstream(folder + "/sheaf") << "#!/bin/sh\n[ \"$*\" = 'completion jobs' ] && "
                                      "printf 'jobs/12\\njobs/7\\n'\n";
  std::filesystem::permissions(folder + "/sheaf", std::filesystem::perms::owner_all);
  const std::string path = folder + "/script.bash";
  std::ofstream(path) << CompletionScript(Shell::kBash, Sheaf());
  EXPECT_EQ(OutputOf("PATH='" + folder + "':$PATH bash -c 'source " + path +
                     "; COMP_WORDS=(sheaf watch jobs/); COMP_CWORD=2; _sheaf; "
                     "echo ${COMPREPLY[@]}'"),
            "jobs/12 jobs/7\n");
}

// Options of a program without commands, also after values of others.
TEST(CompletionScriptTest, BashCompletesAProgramWithoutCommands) {
  const CompletionProgram worker{
      "sheaf-worker",
      {{"--threads", "Threads", true}, {"--sandbox", "Protection", true, {"best", "none"}}},
      {},
      ""};
  const std::string path = ::testing::TempDir() + "/sheaf_worker_completion.bash";
  std::ofstream(path) << CompletionScript(Shell::kBash, worker);
  const auto complete = [&](const std::string& words, int index) {
    return OutputOf("bash -c 'source " + path + "; COMP_WORDS=(" + words + "); COMP_CWORD=" +
                    std::to_string(index) + "; _sheaf_worker; echo ${COMPREPLY[@]}'");
  };
  EXPECT_EQ(complete("sheaf-worker --", 1), "--threads --sandbox\n");
  EXPECT_EQ(complete("sheaf-worker --threads 4 --s", 3), "--sandbox\n");
  EXPECT_EQ(complete("sheaf-worker --sandbox \"\"", 2), "best none\n");
  EXPECT_EQ(complete("sheaf-worker \"\"", 1), "\n");
  const std::string zsh = CompletionScript(Shell::kZsh, worker);
  EXPECT_THAT(zsh, HasSubstr("#compdef sheaf-worker"));
  EXPECT_THAT(zsh, HasSubstr("(best none)"));
  EXPECT_THAT(CompletionScript(Shell::kFish, worker),
              HasSubstr("complete -c sheaf-worker -l threads -r -d"));
}

}  // namespace
}  // namespace sheaf
