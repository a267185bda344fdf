// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Images as text that a terminal displays. The environment alone decides the kind of text:
// terminals are not queried, so that no replies have to be read.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/image/png_tags.h"

namespace sheaf::cli {

enum class TerminalGraphics {
  kNone,
  kKitty,      // kitty's graphics protocol: a PNG.
  kIterm,      // iTerm2's inline images: a PNG.
  kBlocks,     // Half blocks in 24-bit colors.
  kBlocks256,  // Half blocks in xterm's 256 colors.
};

// "none", "kitty", "iterm", "blocks", "blocks256".
std::optional<TerminalGraphics> TerminalGraphicsFromName(const std::string& name);

// The graphics of the terminal that sets these variables; variable(name) is "" for an unset one.
// Inside tmux and screen only blocks work.
TerminalGraphics DetectGraphics(const std::function<std::string(const char*)>& variable);

struct TerminalSize {
  int columns = 80;
  int column_width_px = 8;  // Typical of most fonts; some terminals report it.
};
// Size of the terminal at the file descriptor; otherwise `columns` is taken from the variable
// COLUMNS.
TerminalSize MeasureTerminal(int descriptor);

// An image as it is displayed. Shape: row-major [height_px][width_px].
struct ShownImage {
  int width_px = 0, height_px = 0;
  std::vector<Rgb8> pixels;
};
// Reduces the image to this width and keeps its aspect ratio; it is at least one pixel high. Each
// pixel is the mean of the linear light of the pixels it covers. An image that is not wider is
// returned unchanged.
ShownImage ShrinkTo(int width_px, ShownImage image);

// The text that shows the image, starting at the left border, at most as wide as the terminal,
// ending a line. tags: for the kinds that contain a PNG. Errors: those of the PNG encoder.
absl::StatusOr<std::string> TerminalText(TerminalGraphics graphics, const TerminalSize& size,
                                         ShownImage image, const PngTags& tags);

}  // namespace sheaf::cli
