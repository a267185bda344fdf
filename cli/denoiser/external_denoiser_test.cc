// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/denoiser/external_denoiser.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/stat.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "cli/denoiser/user_command.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/exr/external_layer.h"
#include "tests/support/temporary_path.h"

namespace sheaf::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using testing::TemporaryPath;

constexpr absl::Duration kPatience = absl::Minutes(1);

FrameImage ImageOf(int32_t width_px, float value) {
  FrameImage image = MakeFrameImage({5, 3, 5 + width_px, 5}, 40, 30);
  for (std::vector<float>& plane : image.planes) plane.assign(plane.size(), value);
  return image;
}

// A shell script of that body, and the image that it may copy.
class DenoiserScript {
 public:
  explicit DenoiserScript(const std::string& body) {
    std::ofstream(path_) << "#!/bin/sh\n" << body << "\n";
    ::chmod(path_.c_str(), 0700);
  }
  ~DenoiserScript() { std::filesystem::remove(path_); }
  const std::string& path() const { return path_; }

 private:
  const std::string path_ = TemporaryPath("denoiser.sh");
};

absl::Status Denoise(const std::string& body, FrameImage* image,
                     absl::Duration time_max = kPatience, const std::stop_token& stop = {}) {
  const DenoiserScript script(body);
  return AddExternalLayer(script.path(), EncodeFrameImage(*image), time_max, stop, image);
}

TEST(ExternalDenoiserTest, AddsTheResultAsALayer) {
  const std::string made = TemporaryPath("made.exr");
  ASSERT_TRUE(WriteFrameImage(ImageOf(7, 0.25f), made).ok());
  FrameImage image = ImageOf(7, 0.5f);
  const std::string before = ImageDigest(image);
  // The input is the delivered file, and the working folder is the caller's.
  const std::string delivered = TemporaryPath("delivered.exr");
  ASSERT_TRUE(WriteFrameImage(image, delivered).ok());
  const absl::Status status =
      Denoise(absl::StrCat("cmp \"$1\" '", delivered, "' && cp '", made, "' \"$2\""), &image);
  ASSERT_TRUE(status.ok()) << status;
  for (const char* channel : {"R", "G", "B"}) {
    EXPECT_EQ(image.Find(channel)->front(), 0.5f);
    const std::vector<float>* plane = image.Find(absl::StrCat(kExternalLayer, ".", channel));
    ASSERT_NE(plane, nullptr);
    EXPECT_EQ(*plane, std::vector<float>(14, 0.25f));
  }
  EXPECT_THAT(image.metadata[kExternalDenoiserKey], HasSubstr("denoiser.sh"));
  const absl::StatusOr<FrameImage> read = DecodeFrameImage(EncodeFrameImage(image));
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(ImageDigest(*read), ImageDigest(image));
  RemoveExternalLayer(&image);
  EXPECT_EQ(ImageDigest(image), before);
}

TEST(ExternalDenoiserTest, SaysHowACommandFailed) {
  FrameImage image = ImageOf(7, 0.5f);
  const std::string before = ImageDigest(image);
  const std::string made = TemporaryPath("made.exr"), infinite = TemporaryPath("infinite.exr");
  ASSERT_TRUE(WriteFrameImage(ImageOf(8, 0.25f), made).ok());
  ASSERT_TRUE(WriteFrameImage(ImageOf(7, HUGE_VALF), infinite).ok());
  const std::pair<std::string, std::string> cases[] = {
      {"echo first; echo no model >&2; exit 3",
       "denoiser.sh: ended with exit status 3; it says \"no model\""},
      {"kill -SEGV $$", "ended by signal 11 (Segmentation fault)"},
      {"true", "did not write its last argument"},
      {"echo P5 > \"$2\"", "wrote no EXR with R, G and B that can be read"},
      {absl::StrCat("cp '", made, "' \"$2\""),
       "wrote an image of 8x2 pixels, but this one has 7x2"},
      {absl::StrCat("cp '", infinite, "' \"$2\""), "wrote 42 values that are not finite"}};
  for (const auto& [body, why] : cases) {
    const absl::Status status = Denoise(body, &image);
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(why));
    EXPECT_EQ(ImageDigest(image), before);
    EXPECT_TRUE(image.metadata.empty());
  }
}

TEST(ExternalDenoiserTest, ACommandHasALimitOfTime) {
  FrameImage image = ImageOf(7, 0.5f);
  // Its children end with it: the file appears only if the child outlives it.
  const std::string late = TemporaryPath("late");
  const absl::Status status = Denoise(absl::StrCat("(sleep 0.3; touch '", late, "') & sleep 60"),
                                      &image, absl::Milliseconds(50));
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("did not end within 50ms and was killed"));
  absl::SleepFor(absl::Milliseconds(450));
  EXPECT_FALSE(std::filesystem::exists(late));
}

TEST(ExternalDenoiserTest, AStopEndsACommand) {
  FrameImage image = ImageOf(7, 0.5f);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_TRUE(absl::IsCancelled(Denoise("sleep 60", &image, kPatience, stop.get_token())));
}

TEST(ExternalDenoiserTest, CommandsAreWordsNotShell) {
  ::setenv("SHEAF_TEST_WORD", "a b", 1);
  const absl::StatusOr<std::vector<std::string>> words =
      ParseCommand("sh -c 'x y' \"$SHEAF_TEST_WORD\"");
  ASSERT_TRUE(words.ok()) << words.status();
  EXPECT_THAT((*words)[0], MatchesRegex("/.*/sh"));
  EXPECT_THAT(*words, ::testing::ElementsAre((*words)[0], "-c", "x y", "a b"));
  const std::string spaced = TemporaryPath("a program");
  std::filesystem::copy_file((*words)[0], spaced);
  EXPECT_THAT(*ParseCommand(spaced), ::testing::ElementsAre(spaced));
  const std::pair<std::string, std::string> cases[] = {
      {"sh -c 'x' | cat", "no shell runs it"},
      {"sh $(date)", "no shell runs it"},
      {"sh 'x", "has no end"},
      {"sh $SHEAF_TEST_UNSET", "a variable that is not set"},
      {" ", "the command is empty"},
      {"sheaf-no-such-denoiser -x",
       "sheaf-no-such-denoiser: there is no such program in the folders of PATH"},
      {"/tmp/.sheaf-none/x", "/tmp/.sheaf-none/x: there is no such program, or"}};
  for (const auto& [command, why] : cases) {
    const absl::Status status = CheckDenoiser(command);
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << command;
    EXPECT_THAT(std::string(status.message()),
                AllOf(HasSubstr("--denoise-with: "), HasSubstr(why)));
  }
  EXPECT_TRUE(CheckDenoiser("").ok());
}

}  // namespace
}  // namespace sheaf::cli
