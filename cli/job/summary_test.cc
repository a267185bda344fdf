// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/summary.h"

#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

v1::Progress Costs() {
  v1::Progress progress;
  progress.set_sample_count_done(29'491'200);
  progress.set_ray_count(75'000'000);
  progress.mutable_wall_duration()->set_seconds(12);
  progress.mutable_wall_duration()->set_nanos(300'000'000);
  progress.set_relative_mse(2.1e-3);
  return progress;
}

v1::Frame DeliveredFrame() {
  v1::Frame frame;
  frame.mutable_spec()->set_frame_number(7);
  v1::FrameSettings* settings = frame.mutable_spec()->mutable_settings();
  settings->set_sample_count(128);
  settings->mutable_window()->set_x0_px(10);
  settings->mutable_window()->set_x1_px(650);
  settings->mutable_window()->set_y1_px(360);
  *frame.mutable_progress() = Costs();
  return frame;
}

TEST(SummaryTest, HasThreeLines) {
  EXPECT_EQ(FormatImageSummary(DeliveredFrame(), {"out.exr", ""}, Detail::kShort),
            "frame 7: 640x360, 128 samples\n"
            "  12.3 s, error ±4.6 % (relMSE 0.0021)\n"
            "  written to out.exr");
  EXPECT_TRUE(FormatImageSummary(DeliveredFrame(), {"out.exr", "out.png"}, Detail::kShort)
                  .ends_with("\n  written to out.exr and out.png"));
}

TEST(SummaryTest, HasRatesWhereAllDetailsAreAskedFor) {
  EXPECT_NE(FormatImageSummary(DeliveredFrame(), {"out.exr", ""}, Detail::kAll)
                .find("\n  12.3 s, 2.4 M samples/s, 6.1 M rays/s, error ±4.6 %"),
            std::string::npos);
}

TEST(SummaryTest, ResumedSamplesHaveNoRate) {
  v1::Frame frame = DeliveredFrame();
  frame.mutable_spec()->mutable_resumed_image()->set_size_bytes(7);
  EXPECT_NE(FormatImageSummary(frame, {"out.exr", ""}, Detail::kAll)
                .find("128 samples\n  12.3 s, 6.1 M rays/s"),
            std::string::npos);
  v1::Job job;
  *job.add_frames() = frame;
  *job.mutable_progress() = Costs();
  EXPECT_EQ(FormatJobSummary(job, Detail::kAll).find("samples/s"), std::string::npos);
}

TEST(SummaryTest, ReportsFlipBesideTheError) {
  v1::Frame frame = DeliveredFrame();
  frame.set_flip(0.0421);
  const auto text = [&](Detail detail) {
    return FormatImageSummary(frame, {"out.exr", ""}, detail);
  };
  EXPECT_NE(text(Detail::kAll).find("error ±4.6 % (relMSE 0.0021), FLIP 0.042\n"),
            std::string::npos);
  EXPECT_EQ(text(Detail::kShort).find("FLIP"), std::string::npos);
}

TEST(SummaryTest, ReportsUnreliableTilesAndTheirCause) {
  v1::Frame frame = DeliveredFrame();
  frame.set_tile_count(64);
  frame.set_unreliable_tile_count(12);
  const auto text = [&](Detail detail) {
    return FormatImageSummary(frame, {"out.exr", ""}, detail);
  };
  EXPECT_EQ(text(Detail::kShort).find("fireflies"), std::string::npos);
  // Where the frame was to stop at an error, fireflies decide whether to trust that it did.
  v1::Frame stopped = frame;
  stopped.mutable_spec()->mutable_stop()->set_target_error(0.01);
  EXPECT_NE(FormatImageSummary(stopped, {"out.exr", ""}, Detail::kShort).find("fireflies"),
            std::string::npos);
  EXPECT_NE(text(Detail::kAll)
                .find("; 12 of 64 tiles contain fireflies, so error bars of their pixels may be "
                      "too small: more samples help (--light-paths or sheaf study identify the "
                      "light responsible)"),
            std::string::npos);
  for (const auto& [layer, tiles] : {std::pair{"caustic", 9}, std::pair{"indirect", 3}}) {
    v1::UnreliableLayer* count = frame.add_unreliable_layers();
    count->set_layer(layer);
    count->set_tile_count(tiles);
  }
  EXPECT_NE(text(Detail::kShort)
                .find("more samples help; main cause: caustic (9 tiles), then indirect (3 tiles)"),
            std::string::npos);
}

TEST(SummaryTest, ReportsTheGainOfOneSequence) {
  v1::Frame frame = DeliveredFrame();
  frame.set_one_sequence_gain(1.44);
  EXPECT_NE(FormatImageSummary(frame, {"out.exr", ""}, Detail::kAll)
                .find("; the image is smooth: --one-sequence would reduce its relMSE about 1.4x, "
                      "but gives no true error bars"),
            std::string::npos);
}

TEST(SummaryTest, ReportsBias) {
  v1::Frame frame = DeliveredFrame();
  frame.mutable_spec()->mutable_settings()->set_similarity_after_count(8);
  EXPECT_TRUE(FormatImageSummary(frame, {"out.exr", ""}, Detail::kShort)
                  .starts_with("frame 7: 640x360, 128 samples, biased: similarity after 8 "
                               "scatterings\n  12.3 s"));
  frame.mutable_spec()->mutable_settings()->clear_similarity_after_count();
  frame.mutable_spec()->mutable_settings()->set_max_component_value(10);
  EXPECT_TRUE(FormatImageSummary(frame, {"out.exr", ""}, Detail::kShort)
                  .starts_with("frame 7: 640x360, 128 samples, biased: samples clamped to 10\n"
                               "  12.3 s"));
}

TEST(SummaryTest, OmitsUnknownValues) {
  v1::Frame frame = DeliveredFrame();
  frame.mutable_spec()->mutable_settings()->set_sample_count(1);
  frame.mutable_progress()->clear_wall_duration();
  frame.mutable_progress()->clear_relative_mse();
  EXPECT_EQ(FormatImageSummary(frame, {"out.exr", ""}, Detail::kAll),
            "frame 7: 640x360, 1 sample\n  0.0 s\n  written to out.exr");
}

TEST(SummaryTest, ReportsNonFiniteSamplesAsADefect) {
  v1::Frame frame = DeliveredFrame();
  frame.mutable_progress()->set_nonfinite_count(3);
  EXPECT_NE(FormatImageSummary(frame, {"out.exr", ""}, Detail::kShort)
                .find(", 3 samples not finite (a defect, please report it)\n"),
            std::string::npos);
}

TEST(SummaryTest, JobSummarySumsItsFrames) {
  v1::Job job;
  job.set_name("jobs/7");
  *job.mutable_progress() = Costs();
  for (int i = 0; i < 3; ++i) job.add_frames();
  EXPECT_EQ(
      FormatJobSummary(job, Detail::kAll),
      "jobs/7: 3 frames, 12.3 s, 2.4 M samples/s, 6.1 M rays/s, error ±4.6 % (relMSE 0.0021)");
  EXPECT_EQ(FormatJobSummary(job, Detail::kShort),
            "jobs/7: 3 frames, 12.3 s, error ±4.6 % (relMSE 0.0021)");
}

}  // namespace
}  // namespace sheaf::cli
