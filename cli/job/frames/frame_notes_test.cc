// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/frames/frame_notes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace sheaf::cli {
namespace {

using ::testing::ElementsAre;

TEST(FrameNotesTest, EqualNotesOfManyFramesAreOne) {
  FrameNotes notes;
  for (int32_t frame = 1; frame <= 10'000; ++frame) {
    const std::string path = absl::StrFormat("shots/f.%04d.pbrt", frame);
    notes.Add(frame, path, absl::StrCat(path, ":3:1: warning: \"foo\" is ignored"));
    notes.Add(frame, path,
              absl::StrFormat("meshes/m%d.ply:1:1: warning: it has no normals", frame));
  }
  EXPECT_THAT(notes.List(),
              ElementsAre("shots/f.0001.pbrt:3:1: warning: \"foo\" is ignored (also 9999 other "
                          "frames)",
                          "meshes/m1.ply:1:1: warning: it has no normals (also 9999 other "
                          "frames)"));
}

TEST(FrameNotesTest, OtherPlacesAndTextsStay) {
  FrameNotes notes;
  notes.Add(7, "f.7.pbrt", "f.7.pbrt:7:1: warning: a");
  notes.Add(8, "f.8.pbrt", "f.8.pbrt:8:1: warning: a");
  notes.Add(8, "f.8.pbrt", "f.8.pbrt:7:1: warning: a");
  notes.Add(8, "f.8.pbrt", "f.8.pbrt:7:1: warning: b");
  EXPECT_THAT(notes.List(), ElementsAre("f.7.pbrt:7:1: warning: a (also 1 other frame)",
                                        "f.8.pbrt:8:1: warning: a", "f.8.pbrt:7:1: warning: b"));
}

TEST(FrameNotesTest, ANoteThatOneFrameHasTwiceIsOne) {
  FrameNotes notes;
  for (int i = 0; i < 2; ++i) notes.Add(1, "a.pbrt", "a.pbrt: warning: a");
  EXPECT_THAT(notes.List(), ElementsAre("a.pbrt: warning: a"));
}

}  // namespace
}  // namespace sheaf::cli
