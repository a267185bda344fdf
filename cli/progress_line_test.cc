// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/progress_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

v1::Job HalfDone() {
  v1::Job job;
  job.mutable_progress()->set_sample_count_done(500);
  job.mutable_progress()->set_sample_count_total(1000);
  job.mutable_progress()->mutable_wall_duration()->set_seconds(2);
  return job;
}

TEST(ProgressLineTest, FormatsDurationsAndCounts) {
  EXPECT_EQ(FormatDuration(7.4), "0:07");
  EXPECT_EQ(FormatDuration(245), "4:05");
  EXPECT_EQ(FormatDuration(3723), "1:02:03");
  EXPECT_EQ(FormatDuration(-1), "0:00");
  EXPECT_EQ(FormatCount(999), "999");
  EXPECT_EQ(FormatCount(1000), "1 k");
  EXPECT_EQ(FormatCount(1'234'567), "1.23 M");
}

TEST(ProgressLineTest, OmitsUnknownValues) {
  v1::Job job = HalfDone();
  EXPECT_EQ(FormatProgress(job), "50.0 %, 250 samples/s");
  job.mutable_progress()->set_relative_mse(0.0123);
  job.mutable_progress()->mutable_remaining_duration()->set_seconds(42);
  job.set_waiting_reason("no worker");
  job.mutable_progress()->set_nonfinite_count(3);
  EXPECT_EQ(FormatProgress(job),
            "50.0 %, error ±11 % so far, 250 samples/s, 0:42 left; waiting: no "
            "worker; 3 samples are not finite");
}

TEST(ProgressLineTest, TheErrorIsThatOfTheTilesSoFarUntilTheEnd) {
  v1::Job job = HalfDone();
  job.mutable_progress()->set_relative_mse(0.0123);
  EXPECT_THAT(FormatProgress(job), HasSubstr("error ±11 % so far"));
  job.mutable_progress()->set_sample_count_done(job.progress().sample_count_total());
  EXPECT_THAT(FormatProgress(job), HasSubstr("100.0 %, error ±11 %, "));
}

TEST(ProgressLineTest, TimeLeftHasABandAndSaysWhatOtherJobsTake) {
  v1::Job job = HalfDone();
  v1::Progress& progress = *job.mutable_progress();
  progress.mutable_remaining_duration()->set_seconds(3120);
  progress.mutable_remaining_duration_low()->set_seconds(2700);
  progress.mutable_remaining_duration_high()->set_seconds(3600);
  progress.mutable_remaining_duration_alone()->set_seconds(3000);
  EXPECT_THAT(FormatProgress(job), HasSubstr(", 52:00 left (45:00 to 1:00:00)"));
  progress.mutable_remaining_duration_alone()->set_seconds(240);
  EXPECT_THAT(FormatProgress(job),
              HasSubstr(", 52:00 left (45:00 to 1:00:00; 4:00 without other jobs)"));
}

TEST(ProgressLineTest, SamplesOfAnotherJobHaveNoRate) {
  v1::Job job = HalfDone();
  job.add_frames();
  EXPECT_THAT(FormatProgress(job), HasSubstr("samples/s"));
  job.mutable_frames(0)->mutable_spec()->mutable_resumed_image()->set_size_bytes(1);
  EXPECT_EQ(FormatProgress(job), "50.0 %");
}

TEST(ProgressLineTest, ReportsAPausedJob) {
  v1::Job job = HalfDone();
  job.set_state(v1::Job::STATE_PAUSED);
  EXPECT_EQ(FormatProgress(job), "50.0 %, 250 samples/s; paused");
}

TEST(ProgressLineTest, ReportsFramesInTraining) {
  v1::Job job;
  job.set_training_frame_count(1);
  EXPECT_EQ(FormatProgress(job), "0.0 %; training");
  job.set_training_frame_count(2);
  EXPECT_EQ(FormatProgress(job), "0.0 %; training 2 frames");
}

TEST(ProgressLineTest, JobWithoutSamplesIsNotDone) { EXPECT_EQ(FractionDone(v1::Progress()), 0); }

class ProgressOutputTest : public ::testing::Test {
 protected:
  ProgressLine::Clock::time_point now_{};
  std::string output_;
};

TEST_F(ProgressOutputTest, PipesGetALineEveryFewSeconds) {
  ProgressLine line(
      0, [this] { return now_; }, [this](const std::string& s) { output_ += s; });
  line.Show("jobs/1", 0.1, "10 %");
  line.Show("jobs/1", 0.2, "20 %");
  now_ += ProgressLine::kPlainInterval;
  line.Show("jobs/1", 0.3, "30 %");
  line.Finish();
  EXPECT_EQ(output_, "jobs/1: 10 %\njobs/1: 30 %\n");
}

TEST_F(ProgressOutputTest, ShortTasksPrintNothing) {
  ProgressLine line(
      0, [this] { return now_; }, [this](const std::string& s) { output_ += s; },
      std::chrono::seconds(2));
  line.Show("uploading", 0.1, "10 %");
  now_ += std::chrono::milliseconds(1999);
  line.Show("uploading", 0.2, "20 %");
  EXPECT_EQ(output_, "");
  now_ += std::chrono::milliseconds(1);
  line.Show("uploading", 0.3, "30 %");
  EXPECT_EQ(output_, "uploading: 30 %\n");
}

TEST_F(ProgressOutputTest, TerminalsGetAProgressBar) {
  {
    ProgressLine line(
        80, [this] { return now_; }, [this](const std::string& s) { output_ += s; });
    line.Show("jobs/1", 0.5, "50 %");
    EXPECT_THAT(output_, HasSubstr("[###############...............] 50 %"));
    EXPECT_THAT(output_, Not(HasSubstr("\n")));
  }
  EXPECT_TRUE(output_.ends_with("\n"));
}

TEST_F(ProgressOutputTest, LinesFitTheTerminalWidth) {
  ProgressLine line(
      20, [this] { return now_; }, [this](const std::string& s) { output_ += s; });
  line.Show("jobs/1", 0.5, std::string(500, 'x'));
  EXPECT_LE(output_.size(), 20 + std::string("\r\x1b[K").size());
}

TEST_F(ProgressOutputTest, FieldsWithoutRoomAreLeftOut) {
  const auto shown = [this](int columns) {
    output_.clear();
    ProgressLine(
        columns, [this] { return now_; }, [this](const std::string& s) { output_ += s; })
        .Show("jobs/1", 0.5, "50 %, error ±11 %, 0:53 left (0:50 to 0:59; 0:10 alone)");
    return output_.substr(1, output_.find('\x1b') - 1);
  };
  EXPECT_EQ(shown(25), "jobs/1 50 %, error ±11 %");
  EXPECT_EQ(shown(50), "jobs/1 50 %, error ±11 %");
  EXPECT_EQ(shown(24), "jobs/1 50 %");
  EXPECT_EQ(shown(59), "jobs/1 50 %, error ±11 %");
}

}  // namespace
}  // namespace sheaf::cli
