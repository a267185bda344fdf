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
  // path: of the frame's scene. Notes are equal where they differ by that path, or by the frame's
  // number in the name of the file with which they begin.
  void Add(int32_t frame_number, const std::string& path, const std::string& note);
  // In the order of the first ones; those of several frames say how many there are.
  std::vector<std::string> List() const;

 private:
  struct Note {
    std::string first;
    size_t frame_count = 0;
    int32_t last_frame = 0;
  };
  std::vector<Note> notes_;
  std::map<std::string, size_t> indices_;  // By the text without what is the frame's own.
};

}  // namespace sheaf::cli
