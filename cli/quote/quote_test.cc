// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/quote.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include <nlohmann/json.hpp>

namespace sheaf::cli {
namespace {

Quote MakeTestQuote() {
  Quote quote;
  quote.width_px = 640;
  quote.height_px = 360;
  quote.rate = 1.25;
  quote.thread_count = 8;
  quote.pilot_cpu_seconds = 0.5;
  QuoteRow target;
  target.target_error = 0.02;
  target.samples = {48, 40, 60};
  target.cpu_seconds = {7200, 5400, 9000};
  target.wall_seconds = {950, 710, 1180};
  QuoteRow samples = target;
  samples.target_error = 0;
  samples.samples_given = 64;
  samples.relative_mse = {0.015, 0.012, 0.019};
  quote.rows = {target, samples};
  return quote;
}

TEST(QuoteTest, TrainingsAreStated) {
  Quote quote = MakeTestQuote();
  EXPECT_EQ(FormatQuote(quote).find("training"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(QuoteJson(quote))["training_cpu_hours"], 0);
  quote.training_cpu_seconds = 36;
  const std::string text = FormatQuote(quote);
  EXPECT_NE(text.find("; prices include 36 s for the training of path guiding; wall"),
            std::string::npos)
      << text;
  EXPECT_EQ(nlohmann::json::parse(QuoteJson(quote))["training_cpu_hours"], 0.01);
  quote.frame_count = 3;
  EXPECT_NE(FormatQuote(quote).find("of path guiding, once a frame; wall"), std::string::npos);
}

TEST(QuoteTest, SharedPathsAreStated) {
  Quote quote = MakeTestQuote();
  EXPECT_TRUE(nlohmann::json::parse(QuoteJson(quote))["sharing"].is_null());
  quote.sharing = Quote::Sharing{0.5, 2.25, true};
  EXPECT_NE(FormatQuote(quote).find("; errors are the worse eye's: 0.5 of the relMSE and 2.2 of "
                                    "the CPU time of one eye alone"),
            std::string::npos)
      << FormatQuote(quote);
  EXPECT_EQ(nlohmann::json::parse(QuoteJson(quote))["sharing"]["cpu_ratio"], 2.25);
  quote.sharing->is_stereo = false;
  EXPECT_NE(FormatQuote(quote).find("of paths of one pixel"), std::string::npos);
}

TEST(QuoteTest, TableHasARowPerErrorAndABasisLine) {
  Quote quote = MakeTestQuote();
  QuoteRow minutes = quote.rows[1];
  minutes.samples_given.reset();
  minutes.target_error = 0;
  minutes.minutes_given = 10;
  minutes.relative_mse = {0.0009, 0.0004, 0.0016};
  quote.rows.push_back(minutes);
  EXPECT_EQ(FormatQuote(quote),
            "wall time (80 % band)              CPU time (80 % band)                samples  error "
            "of a pixel\n"
            "15.8 min (11.8 min to 19.7 min)    2 h (90 min to 2.5 h)                  48.0  "
            "±14 % (relMSE 0.02): strong noise\n"
            "15.8 min (11.8 min to 19.7 min)    2 h (90 min to 2.5 h)                    64  "
            "±12 % (±11 % to ±14 %; relMSE 0.015): strong noise\n"
            "10 min                             2 h (90 min to 2.5 h)                  48.0  "
            "±3.0 % (±2.0 % to ±4.0 %; relMSE 0.0009): fine grain\n"
            "640 x 360 px; half the error takes 3.0 times as long; the pilot took 500 ms; wall "
            "time for all of the farm's 8 threads; nothing is denoised\n");
}

// The first round has the same samples for each error that it reaches.
TEST(QuoteTest, ErrorsOfTheSameSamplesAreOneRow) {
  Quote quote = MakeTestQuote();
  QuoteRow strict = quote.rows[0];
  strict.target_error = quote.rows[0].target_error / 4;
  quote.rows.insert(quote.rows.begin() + 1, strict);
  const std::string text = FormatQuote(quote);
  EXPECT_EQ(text.find("relMSE 0.02)"), std::string::npos) << text;
  EXPECT_NE(text.find("relMSE 0.005)"), std::string::npos) << text;
  quote.rows[1].cpu_seconds.value *= 2;
  EXPECT_NE(FormatQuote(quote).find("relMSE 0.02)"), std::string::npos);
}

TEST(QuoteTest, LeastErrorInATimeFollowsPowerLaws) {
  // Between the two the time grows as error^-1.5.
  const std::vector<ErrorTime> known = {{0.04, 10}, {0.01, 80}};
  EXPECT_NEAR(*LeastErrorIn(80, known), 0.01, 1e-9);
  EXPECT_NEAR(*LeastErrorIn(std::sqrt(10.0 * 80), known), 0.02, 1e-9);
  EXPECT_NEAR(*LeastErrorIn(800, known), 0.001, 1e-9);
  EXPECT_NEAR(*LeastErrorIn(5, known), 0.08, 1e-9);
  EXPECT_EQ(*LeastErrorIn(1e9, known), kMinutesErrorMin);
  EXPECT_FALSE(LeastErrorIn(0.01, known)) << "an error above the largest";
  EXPECT_FALSE(LeastErrorIn(80, {}));
}

// A training comes before the first sample, whatever the error.
TEST(QuoteTest, MinutesPayTheTrainingOnce) {
  const auto row_of = [](double error, double seconds) {
    QuoteRow row;
    row.target_error = error;
    row.samples = {seconds - 100, seconds - 100, seconds - 100};
    row.cpu_seconds = row.wall_seconds = {seconds, seconds, seconds};
    return row;
  };
  const std::vector<QuoteRow> targets = {row_of(0.04, 110), row_of(0.01, 180)};
  const QuoteRow row = RowOfMinutes(900 / 60.0, targets, 100);
  ASSERT_TRUE(row.reached);
  EXPECT_NEAR(row.relative_mse.value, 0.001, 1e-9);
  EXPECT_NEAR(row.cpu_seconds.value, 900, 1e-6);
  EXPECT_NEAR(row.samples.value, 800, 1e-6);
  EXPECT_FALSE(RowOfMinutes(99 / 60.0, targets, 100).reached) << "shorter than the training";
  EXPECT_NEAR(RowOfMinutes(1800 / 60.0, targets, 0).relative_mse.value, 0.001, 1e-9);
}

TEST(QuoteTest, ATooShortTimeSaysSo) {
  Quote quote = MakeTestQuote();
  QuoteRow& row = quote.rows.emplace_back();
  row.minutes_given = 0.01;
  row.reached = false;
  EXPECT_NE(FormatQuote(quote).find("too short for a useful error"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(QuoteJson(quote))["rows"][2]["minutes"], 0.01);
}

TEST(QuoteTest, QuotesOnlyMissingSamples) {
  Quote quote = MakeTestQuote();
  quote.start = Quote::Start{16, 0.0336};
  const std::string text = FormatQuote(quote);
  EXPECT_NE(text.find("additional CPU time (80 % band)"), std::string::npos) << text;
  EXPECT_NE(text.find("; 16.0 samples exist already, with an error of ±18 % (relMSE 0.034); "),
            std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(QuoteJson(quote))["start"]["samples"], 16);
  EXPECT_TRUE(nlohmann::json::parse(QuoteJson(MakeTestQuote()))["start"].is_null());
}

TEST(QuoteTest, ReportsMissingInformation) {
  Quote quote = MakeTestQuote();
  quote.thread_count = 0;
  quote.frame_count = 24;
  quote.pilot_frame_count = 3;
  quote.jobs_before = 2;
  quote.rows[0].wall_seconds = {};
  quote.rows[0].reached = false;
  const std::string text = FormatQuote(quote);
  EXPECT_NE(text.find("24 frames, 3 of them in the pilot"), std::string::npos) << text;
  EXPECT_NE(text.find("no worker is connected"), std::string::npos) << text;
  EXPECT_NE(text.find("not reached within the maximum of samples"), std::string::npos) << text;
}

TEST(QuoteTest, RowsOfDenoisedErrorsNameTheErrorOfTheImage) {
  Quote quote = MakeTestQuote();
  QuoteRow& row = quote.rows.emplace_back(quote.rows[0]);
  row.denoised_error = 0.02;
  row.target_error = 0.085;
  quote.denoised = DenoisedPilot{0.3, 0.05};
  const std::string text = FormatQuote(quote);
  EXPECT_NE(text.find("  ±14 % (relMSE 0.02): strong noise, once denoised; --target-error 0.085 "
                      "--denoise\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("; denoised, crops of the pilot have 6.0 times less error (relMSE) at 16 "
                      "samples; bands of denoised errors reach from this gain to none\n"),
            std::string::npos);
  EXPECT_EQ(text.find("nothing is denoised"), std::string::npos);
  const auto json = nlohmann::json::parse(QuoteJson(quote));
  EXPECT_NEAR(json["denoised_gain"].get<double>(), 6, 1e-12);
  EXPECT_EQ(json["rows"][2]["denoised_error"], 0.02);
  EXPECT_TRUE(json["rows"][0]["denoised_error"].is_null());
}

TEST(QuoteTest, JsonHasHoursAndIntervals) {
  const auto json = nlohmann::json::parse(QuoteJson(MakeTestQuote()));
  EXPECT_EQ(json["rows"][0]["target_error"], 0.02);
  EXPECT_TRUE(json["rows"][0]["sample_count"].is_null());
  EXPECT_EQ(json["rows"][0]["cpu_hours"]["low"], 1.5);
  EXPECT_EQ(json["rows"][1]["sample_count"], 64);
  EXPECT_TRUE(json["rows"][1]["target_error"].is_null());
  EXPECT_EQ(json["thread_count"], 8);
}

}  // namespace
}  // namespace sheaf::cli
