// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/command_line/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace sheaf {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class CommandLineTest : public ::testing::Test {
 protected:
  CommandLineTest() {
    app_.require_subcommand(1);
    command_ = app_.add_subcommand("render", "Render a scene");
    app_.add_subcommand("refine", "Go on");
    command_->add_option("SCENE", scene_, "The scene")->required();
    const OptionGroup group(command_, "How it looks");
    AddChoice<int, int>(command_, "--color", &color_, {{"auto", 0}, {"rgb", 1}}, "The color");
    command_->add_option("--tile-size", size_, "Edge of a tile")->check(InRange(8, 1024));
    command_->add_option("--samples", size_, "How many")->check(InRange(int64_t{1}));
    command_->add_option("--tolerance", tolerance_, "How far")->check(InRange(0.0));
    command_->add_option("--error", tolerance_, "How wrong")->check(InRange(1e-9, 1e3));
    command_->add_option("--memory", memory_, "Limit")->transform(AsBytes())->capture_default_str();
    command_->add_option("--address", scene_, "Where")->envname("SHEAF_ADDRESS");
    command_->add_option("--seed", memory_, "Seed");
    command_->add_option("--exposure", tolerance_, "Stops");
    command_->add_flag("--json", json_, "As JSON");
    command_->add_option("--from", scene_, "Image")->check(IsFile());
    command_->add_option("--layer", scene_, "What")->check(IsOneOf({"error", "samples"}));
  }
  // The error; empty if there is none.
  std::string Parse(std::vector<std::string> words) {
    words.insert(words.begin(), "sheaf");
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    std::string error;
    const std::optional<int> code =
        ParseCommandLine(&app_, static_cast<int>(argv.size()), argv.data(),
                         [&error](const std::string& text) { error = text; });
    EXPECT_EQ(code.has_value(), !error.empty());
    return error;
  }
  std::string Help() {
    ::testing::internal::CaptureStdout();
    std::vector<std::string> words = {"sheaf", "render", "--help"};
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    EXPECT_EQ(ParseCommandLine(&app_, 3, argv.data(), [](const std::string&) {}), 0);
    return ::testing::internal::GetCapturedStdout();
  }

  CLI::App app_{"Renders.", "sheaf"};
  CLI::App* command_ = nullptr;
  std::string scene_;
  int color_ = -1, size_ = 0;
  uint64_t memory_ = 64;
  double tolerance_ = 0;
  bool json_ = false;
};

TEST_F(CommandLineTest, ListsNameTheirWords) {
  std::string taken;
  const CLI::Option* list = AddList(
      command_, "--aov", {"uv", "motion"}, [&](const std::string& text) { taken = text; },
      "Quantities", " (see the documents)");
  EXPECT_EQ(list->get_description(),
            "Quantities, separated by commas: uv, motion (see the documents)");
  EXPECT_EQ(ListedWordsOf(*list), (std::vector<std::string>{"uv", "motion"}));
  EXPECT_TRUE(ListedWordsOf(*command_->get_option("--color")).empty());
  EXPECT_EQ(Parse({"render", "a.pbrt", "--aov", "uv,motion"}), "");
  EXPECT_EQ(taken, "uv,motion");
}

TEST_F(CommandLineTest, RefusedNumbersAreToldTheRangeInWords) {
  for (const char* text : {"0", "-1", "abc", "1.5", "99999999999999999999"}) {
    EXPECT_THAT(
        Parse({"render", "a.pbrt", "--samples", text}),
        HasSubstr(absl::StrCat("--samples: \"", text, "\" is not a whole number of at least 1")));
  }
  EXPECT_THAT(Parse({"render", "a.pbrt", "--tile-size", "4"}),
              HasSubstr("\"4\" is not a whole number from 8 to 1024"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--tolerance", "nan"}),
              HasSubstr("\"nan\" is not a number of at least 0"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--error", "0"}),
              HasSubstr("\"0\" is not a number from 1e-09 to 1000"));
  EXPECT_EQ(Parse({"render", "a.pbrt", "--samples", "1", "--tolerance", "0.5"}), "");
}

// The argument library alone reads 010 as 8, 0x10 as 16 and -1 as 2^64 - 1.
TEST_F(CommandLineTest, NumbersAreDecimal) {
  for (const auto& [text, samples] : {std::pair{"010", 10}, {"0", 0}, {"+7", 7}, {"64", 64}}) {
    EXPECT_EQ(Parse({"render", "x", "--seed", text}), "");
    EXPECT_EQ(memory_, static_cast<uint64_t>(samples)) << text;
  }
  EXPECT_EQ(Parse({"render", "x", "--samples", "0100"}), "");
  EXPECT_EQ(size_, 100);
  for (const char* text : {"-1", "0x10", "1e3", "8.0", "", "18446744073709551616"}) {
    EXPECT_THAT(Parse({"render", "x", "--seed", text}), HasSubstr("whole number")) << text;
  }
  for (const char* text : {"nan", "inf", "-inf", "1e999", "0,5", ""}) {
    EXPECT_THAT(Parse({"render", "x", "--exposure", text}), HasSubstr("is not a number")) << text;
  }
  EXPECT_EQ(Parse({"render", "x", "--exposure", "-1.5"}), "");
  EXPECT_EQ(tolerance_, -1.5);
}

TEST_F(CommandLineTest, RefusedWordsAreToldTheKnownOnes) {
  EXPECT_THAT(Parse({"render", "a.pbrt", "--layer", "eror"}),
              HasSubstr("--layer: \"eror\" is not one of error, samples; did you mean \"error\"?"));
}

TEST_F(CommandLineTest, SizesHaveUnits) {
  for (const auto& [text, bytes] : std::vector<std::pair<std::string, uint64_t>>{
           {"0", 0}, {"7b", 7}, {"2k", 2048}, {"3 MB", 3 << 20}, {"1GiB", 1 << 30}}) {
    EXPECT_EQ(Parse({"render", "a.pbrt", "--memory", text}), "") << text;
    EXPECT_EQ(memory_, bytes) << text;
  }
  // Regression: -5 was taken as 2^64 - 5.
  for (const char* text : {"-5", "5Q", "1.5G", "G", "", "16E", "99999999999999999999", "5 bb"}) {
    EXPECT_THAT(Parse({"render", "a.pbrt", "--memory", text}),
                HasSubstr(absl::StrCat("--memory: \"", text,
                                       "\" is not a size below 16E; write "
                                       "bytes, or a whole number with its unit")));
  }
}

TEST_F(CommandLineTest, FilesThatCannotBeReadAreNamedWithTheReason) {
  EXPECT_THAT(Parse({"render", "a.pbrt", "--from", "no-such.exr"}),
              HasSubstr("--from: file \"no-such.exr\" cannot be read: No such file"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--from", "/"}),
              HasSubstr("--from: \"/\" is a directory; name a file in it"));
}

// The library says "1 required UINT:INT in [8 - 1024] missing".
TEST_F(CommandLineTest, MistakesInUsageAreToldInWords) {
  EXPECT_THAT(Parse({"render"}), HasSubstr("SCENE is missing (The scene)"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--tile-size"}),
              HasSubstr("--tile-size: the value is missing; write --tile-size N"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--tile-size", "8", "--tile-size", "9"}),
              HasSubstr("--tile-size is given 2 times; give it once"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--seed", "x"}),
              HasSubstr("--seed: \"x\" is not a whole number, or too large"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--exposure", "x"}),
              HasSubstr("--exposure: \"x\" is not a number"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--json=x"}),
              HasSubstr("--json takes no value; write it alone"));
}

// Regression: of a program whose commands are optional, each wrong option was a missing command.
TEST_F(CommandLineTest, AProgramMayHaveOptionsAndCommands) {
  app_.require_subcommand(0, 1);
  app_.add_option("--lease-seconds", tolerance_, "Time")->check(InRange(0.5, 3600.0));
  EXPECT_THAT(Parse({"--lease-seconds", "0"}),
              HasSubstr("--lease-seconds: \"0\" is not a number from 0.5 to 3600"));
  EXPECT_THAT(Parse({"--lease-seconds"}), HasSubstr("--lease-seconds: the value is missing"));
  EXPECT_THAT(Parse({"rendr"}), HasSubstr("did you mean \"render\"?"));
}

TEST_F(CommandLineTest, SuggestsNearestNames) {
  EXPECT_THAT(Parse({"rendr"}), HasSubstr("unknown command \"rendr\"; did you mean \"render\"?"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--tile-sise", "4"}),
              HasSubstr("unknown option --tile-sise; did you mean \"--tile-size\"?"));
  EXPECT_THAT(Parse({"render", "--tile-sise=4", "a.pbrt"}), HasSubstr("\"--tile-size\""));
  EXPECT_THAT(Parse({"render", "--expo", "4", "a.pbrt"}), HasSubstr("\"--exposure\""));
  EXPECT_THAT(Parse({}), HasSubstr("a command is missing; the commands are render, refine"));
  EXPECT_THAT(Parse({"render"}), HasSubstr("SCENE"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "b.pbrt"}),
              HasSubstr("\"b.pbrt\" is an unexpected argument"));
  EXPECT_THAT(Parse({"\x1b[31m"}), HasSubstr("\\x1b[31m"));
}

// Regression: eight choices of `--techniques` made a line of 137 columns.
TEST_F(CommandLineTest, ChoicesGoOnInFurtherLines) {
  std::vector<std::pair<std::string, int>> choices;
  for (int i = 0; i < 20; ++i) choices.emplace_back(absl::StrCat("choice-", i), i);
  AddChoice<int, int>(command_, "--long", &color_, choices, "The choice");
  const std::vector<std::string> lines = absl::StrSplit(Help(), '\n');
  for (const std::string& line : lines) EXPECT_LE(line.size(), 100u) << line;
  EXPECT_THAT(lines, ::testing::Contains(::testing::StartsWith("      choice-")));
  EXPECT_THAT(Help(), HasSubstr("choice-19"));
}

TEST_F(CommandLineTest, ChoicesAreDescribed) {
  EXPECT_EQ(Parse({"render", "a.pbrt", "--color", "RGB"}), "");
  EXPECT_EQ(color_, 1);
  const std::string error = Parse({"render", "a.pbrt", "--color", "rbg"});
  EXPECT_THAT(error, HasSubstr("\"rbg\" is not one of auto, rgb; did you mean \"rgb\"?"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--color", "1"}), HasSubstr("not one of auto, rgb"));
  EXPECT_THAT(ChoicesOf(*command_->get_option("--color")), ElementsAre("auto", "rgb"));
  EXPECT_THAT(ChoicesOf(*command_->get_option("--layer")), ElementsAre("error", "samples"));
  EXPECT_THAT(ChoicesOf(*command_->get_option("--tile-size")), ElementsAre());
}

TEST_F(CommandLineTest, TextsArePrintableUtf8) {
  command_->add_option("--title", scene_, "The title")->check(IsText(8));
  EXPECT_EQ(Parse({"render", "a.pbrt", "--title",
                   "Gr\xc3\xbc\xc3\x9f"
                   "e"}),
            "");
  EXPECT_THAT(Parse({"render", "a.pbrt", "--title", "caf\xe9"}),
              HasSubstr("--title: \"caf\\xe9\": byte 4 is not printable UTF-8"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--title", "a\nb"}), HasSubstr("byte 2"));
  EXPECT_THAT(Parse({"render", "a.pbrt", "--title", "123456789"}), HasSubstr("over 8 bytes"));
}

TEST_F(CommandLineTest, HelpIsPlainText) {
  const std::string help = Help();
  for (const char* words : {"How it looks:", "--color auto|rgb ", "--tile-size N ",
                            "Edge of a tile (8 to 1024)", "--memory SIZE ", "Limit (default 64)",
                            "Where (also from SHEAF_ADDRESS)", "--layer error|samples", "SCENE"}) {
    EXPECT_THAT(help, HasSubstr(words));
  }
  for (const char* notation : {"UINT", "INT:", "->", "[b, kb", "REQUIRED", "TEXT:", "ENUM"}) {
    EXPECT_THAT(help, Not(HasSubstr(notation)));
  }
}

}  // namespace
}  // namespace sheaf
