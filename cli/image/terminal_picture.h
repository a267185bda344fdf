// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Pictures as text that a terminal shows. Which kind of text is told by the environment alone:
// terminals are asked nothing, so that nothing has to be read from them.
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
  kKitty,      // The graphics protocol of kitty: a PNG.
  kIterm,      // The inline images of iTerm2: a PNG.
  kBlocks,     // Half blocks, of 24-bit colors.
  kBlocks256,  // Half blocks, of xterm's 256 colors.
};

// "none", "kitty", "iterm", "blocks", "blocks256".
std::optional<TerminalGraphics> TerminalGraphicsFromName(const std::string& name);

// What a terminal can show that sets these variables; variable(name) is "" where there is none.
// Inside of tmux and screen only blocks get through.
TerminalGraphics DetectGraphics(const std::function<std::string(const char*)>& variable);

struct TerminalSize {
  int columns = 80;
  int column_width_px = 8;  // As most fonts have it; some terminals say.
};
// That of the terminal at the file descriptor, otherwise `columns` by the variable COLUMNS.
TerminalSize MeasureTerminal(int descriptor);

// A picture as it is displayed. Shape: row-major [height_px][width_px].
struct ShownPicture {
  int width_px = 0, height_px = 0;
  std::vector<Rgb8> pixels;
};
// The same picture of this width, with its aspect kept, at least one pixel high: every pixel is the
// mean of the light of those it covers. One that is not wider is returned as it is.
ShownPicture ShrinkTo(int width_px, ShownPicture picture);

// The text that shows the picture from the left border on, as wide as the terminal at most, ending
// a line. tags: for the kinds that hold a PNG. Errors: those of the PNG encoder.
absl::StatusOr<std::string> TerminalText(TerminalGraphics graphics, const TerminalSize& size,
                                         ShownPicture picture, const PngTags& tags);

}  // namespace sheaf::cli
