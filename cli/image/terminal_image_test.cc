// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/image/terminal_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace sheaf::cli {
namespace {

using ::testing::StartsWith;

constexpr Rgb8 kRed{255, 0, 0}, kGreen{0, 255, 0}, kBlue{0, 0, 255}, kWhite{255, 255, 255};

TerminalGraphics Detected(std::map<std::string, std::string> variables) {
  return DetectGraphics([&](const char* name) { return variables[name]; });
}

std::string TextOf(TerminalGraphics graphics, const TerminalSize& size, ShownImage image) {
  const absl::StatusOr<std::string> text = TerminalText(graphics, size, std::move(image), {});
  EXPECT_TRUE(text.ok()) << text.status();
  return text.ok() ? *text : "";
}

// An image that does not compress. Source of the numbers: Knuth and Lewis's generator.
ShownImage Noise(int width_px, int height_px) {
  ShownImage image{width_px, height_px, {}};
  uint32_t state = 1;
  for (int i = 0; i < width_px * height_px; ++i) {
    state = state * 1664525u + 1013904223u;
    image.pixels.push_back({static_cast<uint8_t>(state >> 24), static_cast<uint8_t>(state >> 16),
                            static_cast<uint8_t>(state >> 8)});
  }
  return image;
}

TEST(TerminalImageTest, GraphicsAreDetectedFromTheEnvironment) {
  EXPECT_EQ(Detected({}), TerminalGraphics::kNone);
  EXPECT_EQ(Detected({{"TERM", "dumb"}, {"COLORTERM", "truecolor"}}), TerminalGraphics::kNone);
  EXPECT_EQ(Detected({{"TERM", "xterm-256color"}, {"NO_COLOR", "1"}}), TerminalGraphics::kNone);
  EXPECT_EQ(Detected({{"TERM", "xterm-256color"}, {"NO_COLOR", ""}}), TerminalGraphics::kBlocks256);
  EXPECT_EQ(Detected({{"TERM", "xterm-kitty"}}), TerminalGraphics::kKitty);
  EXPECT_EQ(Detected({{"TERM", "xterm-256color"}, {"KITTY_WINDOW_ID", "1"}}),
            TerminalGraphics::kKitty);
  EXPECT_EQ(Detected({{"TERM", "xterm-256color"}, {"TERM_PROGRAM", "iTerm.app"}}),
            TerminalGraphics::kIterm);
  EXPECT_EQ(Detected({{"TERM", "xterm-256color"}, {"COLORTERM", "truecolor"}}),
            TerminalGraphics::kBlocks);
  EXPECT_EQ(Detected({{"TERM", "xterm-256color"}}), TerminalGraphics::kBlocks256);
  EXPECT_EQ(Detected({{"TERM", "tmux-256color"}, {"KITTY_WINDOW_ID", "1"}}),
            TerminalGraphics::kBlocks256);
}

TEST(TerminalImageTest, BlocksShowTwoPixelsPerCell) {
  const ShownImage image{2, 3, {kRed, kRed, kBlue, kGreen, kWhite, kWhite}};
  EXPECT_EQ(TextOf(TerminalGraphics::kBlocks, {}, image),
            "\x1b[38;2;255;0;0m\x1b[48;2;0;0;255m\u2580\x1b[48;2;0;255;0m\u2580\x1b[0m\n"
            "\x1b[38;2;255;255;255m\u2580\u2580\x1b[0m\n");
}

TEST(TerminalImageTest, Blocks256UseTheNearestColor) {
  const ShownImage image{2, 2, {kRed, {128, 128, 128}, {100, 130, 180}, {3, 3, 3}}};
  EXPECT_EQ(TextOf(TerminalGraphics::kBlocks256, {}, image),
            "\x1b[38;5;196m\x1b[48;5;67m\u2580\x1b[38;5;244m\x1b[48;5;16m\u2580\x1b[0m\n");
}

TEST(TerminalImageTest, ShrinkingAveragesLightAndKeepsTheAspectRatio) {
  const ShownImage shrunk = ShrinkTo(80, Noise(200, 113));
  EXPECT_EQ(shrunk.width_px, 80);
  EXPECT_EQ(shrunk.height_px, 45);
  EXPECT_EQ(shrunk.pixels.size(), 80u * 45u);
  EXPECT_EQ(ShrinkTo(80, Noise(60, 40)).width_px, 60);
  EXPECT_EQ(ShrinkTo(10, Noise(200, 2)).height_px, 1);
  // Half the light of white is encoded as 188.
  EXPECT_EQ(ShrinkTo(1, {2, 1, {kWhite, {0, 0, 0}}}).pixels, (std::vector<Rgb8>{{188, 188, 188}}));
  // A constant image stays constant at any ratio.
  const ShownImage flat{97, 3, std::vector<Rgb8>(97 * 3, Rgb8{12, 130, 250})};
  EXPECT_THAT(ShrinkTo(41, flat).pixels, ::testing::Each(Rgb8{12, 130, 250}));
}

TEST(TerminalImageTest, BlocksFillTheTerminalWidth) {
  const std::string text = TextOf(TerminalGraphics::kBlocks, {.columns = 40}, Noise(160, 80));
  const std::vector<std::string> lines = absl::StrSplit(text, '\n', absl::SkipEmpty());
  EXPECT_EQ(lines.size(), 10u);
  const std::vector<std::string> cells = absl::StrSplit(lines[0], "\u2580");
  EXPECT_EQ(cells.size(), 41u);
}

// Reassembles the protocol's commands as kitty does.
TEST(TerminalImageTest, KittyReceivesAPng) {
  const ShownImage image = Noise(100, 60);
  const std::string text = TextOf(TerminalGraphics::kKitty, {}, image);
  EXPECT_THAT(text, StartsWith("\x1b_Ga=T,f=100,q=2,c=13,m=1;"));
  std::string base64;
  const std::vector<std::string> commands = absl::StrSplit(text, "\x1b\\");
  ASSERT_GT(commands.size(), 2u);
  for (size_t i = 0; i + 1 < commands.size(); ++i) {
    const std::pair<std::string, std::string> parts =
        absl::StrSplit(commands[i], absl::MaxSplits(';', 1));
    EXPECT_THAT(parts.first, ::testing::EndsWith(i + 2 < commands.size() ? "m=1" : "m=0"));
    EXPECT_LE(parts.second.size(), 4096u);
    base64 += parts.second;
  }
  EXPECT_EQ(commands.back(), "\n");
  std::string png;
  ASSERT_TRUE(absl::Base64Unescape(base64, &png));
  EXPECT_EQ(png, *EncodePng(100, 60, image.pixels));
}

TEST(TerminalImageTest, ItermReceivesAPngOfTheTerminalWidth) {
  const ShownImage image = Noise(250, 100);
  const TerminalSize size{.columns = 20, .column_width_px = 10};
  const std::string png = *EncodePng(200, 80, ShrinkTo(200, image).pixels);
  EXPECT_EQ(TextOf(TerminalGraphics::kIterm, size, image),
            absl::StrCat("\x1b]1337;File=inline=1;preserveAspectRatio=1;size=", png.size(),
                         ";width=20:", absl::Base64Escape(png), "\a\n"));
}

}  // namespace
}  // namespace sheaf::cli
