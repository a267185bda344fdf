// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Frame ranges and the numbers of frames in paths: "1-24", "1-100x5", "1,4,9-12" with
// "shot.####.pbrt".
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf::cli {

inline constexpr size_t kFramesMax = 100'000;

// Numbers in ascending order without duplicates. "A-BxS" means every S-th number from A to B.
// Errors: kInvalidArgument, saying what is wrong with the text.
absl::StatusOr<std::vector<int32_t>> ParseFrameRange(const std::string& text);

// The same as text: "1-3,7". Requires: ascending numbers.
std::string FormatFrameRange(const std::vector<int32_t>& numbers);

// A path, and the position of the frame number in it.
struct FramePath {
  std::string path;
  size_t first = 0;  // Start of the run of '#' for the number.
  size_t width = 0;  // Its length; 0: the path is the same for every frame.

  bool HasNumber() const { return width > 0; }
  // With the number in place of the run, padded with zeros to its length: "shot.####.exr" and 7
  // make "shot.0007.exr".
  std::string Of(int32_t frame_number) const;
};

// Finds the number in a path of an image to write: the last run of at least run_min '#' in the
// file's name. Without one, the run in the one folder that does not exist literally
// ("f/####/s.exr"); '#' in folders that do exist are letters. frame_number: a frame's, for folders
// below that one. Errors: kInvalidArgument if it could be in several folders.
absl::StatusOr<FramePath> FindFrameNumber(const std::string& path, int32_t frame_number,
                                          size_t run_min = 1);
// The same for a file to read. If its name has several runs, chooses the one that gives an existing
// file. Errors: also kInvalidArgument if several do.
absl::StatusOr<FramePath> FindInputFrameNumber(const std::string& path, int32_t frame_number);

// The longest run of '#' in the file's name.
size_t LongestRun(const std::string& path);

}  // namespace sheaf::cli
