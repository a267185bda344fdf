// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sources: Goyal, "Terminal graphics protocol" (kitty's documentation); iTerm2's documentation,
// "Inline Images Protocol"; ECMA-48 and ISO 8613-6 for colors of cells; xterm's 256colres.h for the
// 256 colors.
#include "cli/image/terminal_image.h"

#include <sys/ioctl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace sheaf::cli {
namespace {

constexpr int kColumnsMax = 1000;
// Bytes of base64 in one command; kitty's protocol sets this limit.
constexpr size_t kKittyChunkMax = 4096;
constexpr const char* kUpperHalf = "\u2580";
constexpr const char* kReset = "\x1b[0m";

constexpr std::array<std::pair<const char*, TerminalGraphics>, 5> kNames{
    {{"none", TerminalGraphics::kNone},
     {"kitty", TerminalGraphics::kKitty},
     {"iterm", TerminalGraphics::kIterm},
     {"blocks", TerminalGraphics::kBlocks},
     {"blocks256", TerminalGraphics::kBlocks256}}};

int SquareDistance(Rgb8 a, Rgb8 b) {
  const int r = a.r - b.r, g = a.g - b.g, blue = a.b - b.b;
  return r * r + g * g + blue * blue;
}

// The nearest of xterm's colors 16 to 255: a cube of six levels per channel, and 24 grays. The user
// defines colors 0 to 15.
int Nearest256(Rgb8 color) {
  constexpr std::array<uint8_t, 6> kLevels{0, 95, 135, 175, 215, 255};
  const auto step = [&](uint8_t value) {
    const auto nearer = [value](uint8_t a, uint8_t b) {
      return std::abs(a - value) < std::abs(b - value);
    };
    return std::min_element(kLevels.begin(), kLevels.end(), nearer) - kLevels.begin();
  };
  const auto r = step(color.r), g = step(color.g), b = step(color.b);
  const Rgb8 of_cube{kLevels[static_cast<size_t>(r)], kLevels[static_cast<size_t>(g)],
                     kLevels[static_cast<size_t>(b)]};
  const int mean = (color.r + color.g + color.b) / 3;
  const int gray_index = std::clamp((mean - 3) / 10, 0, 23);
  const auto gray = static_cast<uint8_t>(8 + 10 * gray_index);
  if (SquareDistance(color, {gray, gray, gray}) < SquareDistance(color, of_cube)) {
    return 232 + gray_index;
  }
  return static_cast<int>(16 + 36 * r + 6 * g + b);
}

// Selects a color: kind 38 sets the foreground, 48 the background.
std::string ColorCode(int kind, Rgb8 color, bool is_256) {
  if (is_256) return absl::StrCat("\x1b[", kind, ";5;", Nearest256(color), "m");
  return absl::StrCat("\x1b[", kind, ";2;", color.r, ";", color.g, ";", color.b, "m");
}

// Two pixels per cell, one above the other; a cell is about twice as high as wide. A color code is
// written only where the color changes.
std::string BlocksText(const ShownImage& image, bool is_256) {
  std::string text;
  const auto width = static_cast<size_t>(image.width_px);
  const auto height = static_cast<size_t>(image.height_px);
  for (size_t y = 0; y < height; y += 2) {
    std::string upper_before, lower_before;
    for (size_t x = 0; x < width; ++x) {
      const std::string upper = ColorCode(38, image.pixels[y * width + x], is_256);
      const std::string lower =
          y + 1 < height ? ColorCode(48, image.pixels[(y + 1) * width + x], is_256) : "";
      absl::StrAppend(&text, upper == upper_before ? "" : upper, lower == lower_before ? "" : lower,
                      kUpperHalf);
      upper_before = upper;
      lower_before = lower;
    }
    absl::StrAppend(&text, kReset, "\n");
  }
  return text;
}

// a=T: display at once; f=100: a PNG; q=2: send no reply; c: columns; rows follow from the aspect
// ratio.
std::string KittyText(const std::string& png, int columns) {
  const std::string base64 = absl::Base64Escape(png);
  std::string text;
  for (size_t at = 0; at < base64.size(); at += kKittyChunkMax) {
    const std::string chunk = base64.substr(at, kKittyChunkMax);
    const bool has_more = at + chunk.size() < base64.size();
    absl::StrAppend(&text, "\x1b_G", at == 0 ? absl::StrCat("a=T,f=100,q=2,c=", columns, ",") : "",
                    "m=", has_more ? 1 : 0, ";", chunk, "\x1b\\");
  }
  return text + "\n";
}

std::string ItermText(const std::string& png, int columns) {
  return absl::StrCat("\x1b]1337;File=inline=1;preserveAspectRatio=1;size=", png.size(),
                      ";width=", columns, ":", absl::Base64Escape(png), "\a\n");
}

// The rows or columns that a reduced pixel covers: whole ones, and fractions of the outer two.
struct Cover {
  int first = 0;
  std::vector<float> weights;
};
std::vector<Cover> CoversOf(int from, int to) {
  std::vector<Cover> covers(static_cast<size_t>(to));
  const double scale = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    const double begin = i * scale, end = std::min<double>(from, (i + 1) * scale);
    Cover& cover = covers[static_cast<size_t>(i)];
    cover.first = static_cast<int>(begin);
    for (int j = cover.first; j < end && j < from; ++j) {
      const double weight = std::min(end, j + 1.0) - std::max<double>(begin, j);
      cover.weights.push_back(static_cast<float>(weight / (end - begin)));
    }
  }
  return covers;
}

Rgb8 MeanLight(const ShownImage& image, const Cover& rows, const Cover& columns) {
  static const std::array<float, 256> kLight = [] {
    std::array<float, 256> light{};
    for (size_t i = 0; i < light.size(); ++i) light[i] = DecodeSrgb(static_cast<float>(i) / 255);
    return light;
  }();
  std::array<float, 3> sum{};
  for (size_t y = 0; y < rows.weights.size(); ++y) {
    const size_t row = (static_cast<size_t>(rows.first) + y) * static_cast<size_t>(image.width_px);
    for (size_t x = 0; x < columns.weights.size(); ++x) {
      const Rgb8 color = image.pixels[row + static_cast<size_t>(columns.first) + x];
      const float weight = rows.weights[y] * columns.weights[x];
      sum[0] += weight * kLight[color.r];
      sum[1] += weight * kLight[color.g];
      sum[2] += weight * kLight[color.b];
    }
  }
  return {EncodeSrgb8(sum[0]), EncodeSrgb8(sum[1]), EncodeSrgb8(sum[2])};
}

}  // namespace

std::optional<TerminalGraphics> TerminalGraphicsFromName(const std::string& name) {
  for (const auto& [known, graphics] : kNames) {
    if (name == known) return graphics;
  }
  return std::nullopt;
}

TerminalGraphics DetectGraphics(const std::function<std::string(const char*)>& variable) {
  const std::string term = variable("TERM"), program = variable("TERM_PROGRAM");
  if (term.empty() || term == "dumb") return TerminalGraphics::kNone;
  const bool is_inside =
      absl::StartsWith(term, "screen") || absl::StartsWith(term, "tmux") || program == "tmux";
  if (!is_inside) {
    if (program == "iTerm.app" || program == "WezTerm" || program == "mintty") {
      return TerminalGraphics::kIterm;
    }
    if (!variable("KITTY_WINDOW_ID").empty() || term == "xterm-kitty" || term == "xterm-ghostty" ||
        program == "ghostty") {
      return TerminalGraphics::kKitty;
    }
  }
  // NO_COLOR disables blocks, which are colored text, but not images.
  if (!variable("NO_COLOR").empty()) return TerminalGraphics::kNone;
  const std::string colors = variable("COLORTERM");
  const bool has_all = colors == "truecolor" || colors == "24bit";
  return has_all ? TerminalGraphics::kBlocks : TerminalGraphics::kBlocks256;
}

TerminalSize MeasureTerminal(int descriptor) {
  TerminalSize size;
  winsize window{};
  if (::ioctl(descriptor, TIOCGWINSZ, &window) == 0 && window.ws_col > 0) {
    size.columns = window.ws_col;
    if (window.ws_xpixel >= window.ws_col) size.column_width_px = window.ws_xpixel / window.ws_col;
  } else if (const char* columns = std::getenv("COLUMNS"); columns != nullptr) {
    int asked = 0;
    if (absl::SimpleAtoi(columns, &asked) && asked > 0) size.columns = asked;
  }
  size.columns = std::min(size.columns, kColumnsMax);
  return size;
}

ShownImage ShrinkTo(int width_px, ShownImage image) {
  if (width_px >= image.width_px) return image;
  ShownImage shrunk;
  shrunk.width_px = width_px;
  shrunk.height_px = std::max(1, static_cast<int>(std::lround(static_cast<double>(width_px) *
                                                              image.height_px / image.width_px)));
  const std::vector<Cover> rows = CoversOf(image.height_px, shrunk.height_px);
  const std::vector<Cover> columns = CoversOf(image.width_px, shrunk.width_px);
  for (const Cover& row : rows) {
    for (const Cover& column : columns) {
      shrunk.pixels.push_back(MeanLight(image, row, column));
    }
  }
  return shrunk;
}

absl::StatusOr<std::string> TerminalText(TerminalGraphics graphics, const TerminalSize& size,
                                         ShownImage image, const PngTags& tags) {
  if (graphics == TerminalGraphics::kNone) return std::string();
  if (graphics == TerminalGraphics::kBlocks || graphics == TerminalGraphics::kBlocks256) {
    return BlocksText(ShrinkTo(size.columns, std::move(image)),
                      graphics == TerminalGraphics::kBlocks256);
  }
  const ShownImage shown = ShrinkTo(size.columns * size.column_width_px, std::move(image));
  const absl::StatusOr<std::string> png =
      EncodeTaggedPng(shown.width_px, shown.height_px, shown.pixels, tags);
  if (!png.ok()) return png.status();
  const int columns = (shown.width_px + size.column_width_px - 1) / size.column_width_px;
  return graphics == TerminalGraphics::kKitty ? KittyText(*png, columns) : ItermText(*png, columns);
}

}  // namespace sheaf::cli
