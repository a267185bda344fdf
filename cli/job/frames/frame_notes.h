// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FrameNotes: the notes about the scenes of many frames. Equal ones are counted instead of
// repeated.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace sheaf::cli {

class FrameNotes {
 public:
  // path: the frame's scene. Notes count as equal if they differ only by that path, or by the
  // frame's number in the file name at their start.
  void Add(int32_t frame_number, const std::string& path, const std::string& note);
  // In the order of first occurrence; a note of several frames includes their number.
  std::vector<std::string> List() const;

 private:
  struct Note {
    std::string first;
    size_t frame_count = 0;
    int32_t last_frame = 0;
  };
  std::vector<Note> notes_;
  std::map<std::string, size_t> indices_;  // By the text without the frame's own parts.
};

}  // namespace sheaf::cli
