// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/frames/frame_notes.h"

#include <algorithm>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace sheaf::cli {
namespace {

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// The text with "#" in place of the frame's number.
std::string WithoutNumber(const std::string& text, int32_t frame_number) {
  std::string result;
  for (size_t i = 0; i < text.size();) {
    size_t end = i;
    while (end < text.size() && IsDigit(text[end])) ++end;
    int32_t number = 0;
    if (end == i) {
      result += text[i++];
      continue;
    }
    const std::string digits = text.substr(i, end - i);
    const bool is_frame = absl::SimpleAtoi(digits, &number) && number == frame_number;
    result += is_frame ? "#" : digits;
    i = end;
  }
  return result;
}

}  // namespace

void FrameNotes::Add(int32_t frame_number, const std::string& path, const std::string& note) {
  std::string key = path.empty() ? note : absl::StrReplaceAll(note, {{path, "\n"}});
  const size_t name_end = std::min(key.find(':'), key.size());
  key = WithoutNumber(key.substr(0, name_end), frame_number) + key.substr(name_end);
  const auto [place, is_new] = indices_.emplace(std::move(key), notes_.size());
  if (is_new) notes_.push_back({note, 0, frame_number});
  Note& known = notes_[place->second];
  if (known.frame_count > 0 && known.last_frame == frame_number) return;
  ++known.frame_count;
  known.last_frame = frame_number;
}

std::vector<std::string> FrameNotes::List() const {
  std::vector<std::string> notes;
  for (const Note& note : notes_) {
    const size_t others = note.frame_count - 1;
    notes.push_back(others == 0 ? note.first
                                : absl::StrCat(note.first, " (also ", others, " other ",
                                               others == 1 ? "frame)" : "frames)"));
  }
  return notes;
}

}  // namespace sheaf::cli
