// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The advice of a study, for curves with known gains.
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_join.h"
#include "cli/study/study.h"

namespace sheaf::cli {
namespace {

StudyCurve MakeCurve(std::string name, std::string flag, std::optional<Estimate> gain) {
  StudyCurve curve;
  curve.setting.name = std::move(name);
  curve.setting.flag = std::move(flag);
  curve.setting.how = "how";
  curve.points = {{16, 10, {0.04, 0.001}, false}, {64, 40, {0.01, 0.0005}, false}};
  curve.rate = Estimate{1, 0.01};
  curve.bias_floor = Estimate{0, 1e-5};
  curve.gain = gain;
  return curve;
}

StudyResult MakeResult(std::vector<StudyCurve> others) {
  StudyResult result;
  result.threads = 2;
  result.cpu_seconds_per_sample = 40.0 / 64;
  result.curves = {MakeCurve("as given", "", std::nullopt)};
  result.curves.front().setting.is_base = true;
  for (StudyCurve& other : others) result.curves.push_back(std::move(other));
  return result;
}

StudyCurve OneSequence(Estimate gain) {
  StudyCurve curve = MakeCurve("one sequence", "--one-sequence", gain);
  curve.setting.settings.one_sequence = true;
  curve.setting.keeps_error_bars = false;
  return curve;
}

std::string TextOf(const StudyResult& result) { return absl::StrJoin(Recommend(result), "\n"); }

bool Has(const std::string& text, std::string_view part) {
  return text.find(part) != std::string::npos;
}

TEST(StudyWordsTest, FirstLinesSayErrorAndTimeAndWhatTenMinutesBuy) {
  StudyResult result = MakeResult({});
  const std::vector<std::string> lines = Recommend(result);
  ASSERT_GE(lines.size(), 2u);
  EXPECT_EQ(lines[0],
            "As given, 64 samples per pixel have an error of ±10 % (relMSE 0.01) and take 40 s of "
            "CPU time, on the 2 threads of this machine about 21.1 s; half the error takes 4.0 "
            "times as long, where independent samples take 4 times.");
  // 600 s x 2 threads x 0.95 / 0.625 s = 1824 samples, and relMSE 0.64 / 1824.
  EXPECT_EQ(lines[1],
            "In 10 minutes, this machine reaches about ±1.9 % (relMSE 0.00035) (1.82 k samples "
            "per pixel). Nothing is denoised.");
  result.farm = StudyFarm{"farm:7400", 4, 32, 0};
  EXPECT_TRUE(Has(Recommend(result)[1],
                  "; the 32 threads of the farm at farm:7400, if they are as fast, ±0.47 %"))
      << Recommend(result)[1];
}

TEST(StudyWordsTest, OneSequenceIsNeverTheFirstAdvice) {
  const StudyResult result =
      MakeResult({OneSequence({2, 0.1}),
                  MakeCurve("adaptive sampling", "--target-error", Estimate{1.3, 0.05})});
  const std::string text = TextOf(result);
  EXPECT_TRUE(Has(text,
                  "Use \"adaptive sampling\" (--target-error): the same image and true error "
                  "bars, 1.30 ± 0.05 times as fast"))
      << text;
  EXPECT_FALSE(Has(text, "Use \"one sequence\"")) << text;
  EXPECT_TRUE(Has(text,
                  "\"one sequence\" (--one-sequence) would be 2.00 ± 0.10 times as fast to "
                  "the same error, but gives no true error bars."))
      << text;
  EXPECT_LT(text.find("Use \"adaptive"), text.find("one sequence"));
  EXPECT_FALSE(Has(TextOf(MakeResult({OneSequence({2, 0.1})})), "Use "));
}

// A user who renders with one sequence has given up true error bars already.
TEST(StudyWordsTest, SettingsWithOneSequenceCountWhereItIsGiven) {
  StudyResult result =
      MakeResult({MakeCurve("adaptive sampling", "--target-error", Estimate{1.3, 0.05})});
  for (StudyCurve& curve : result.curves) curve.setting.settings.one_sequence = true;
  EXPECT_TRUE(Has(TextOf(result), "Use \"adaptive sampling\""));
}

TEST(StudyWordsTest, NothingIsClaimedWhereTwoDeviationsTouchOne) {
  const std::string text =
      TextOf(MakeResult({MakeCurve("adaptive sampling", "--target-error", Estimate{1.27, 0.14}),
                         MakeCurve("no roulette", "", Estimate{0.9, 0.06}),
                         MakeCurve("generic variant", "", Estimate{0.8, 0.02})}));
  EXPECT_TRUE(Has(text, "No setting that renders the same image")) << text;
  EXPECT_TRUE(Has(text,
                  "Undecided, as two standard errors do not exclude a ratio of 1: \"adaptive "
                  "sampling\" (--target-error) measured 1.27 ± 0.14 times as fast"))
      << text;
  EXPECT_TRUE(Has(text, "Slower than as given: generic variant (1.25 ± 0.03 times as slow)."))
      << text;
  EXPECT_FALSE(Has(text, "no roulette")) << text;
}

StudyResult ResultWithLight(std::optional<Estimate> gain) {
  StudyCurve without = MakeCurve("no light paths", "--techniques camera", gain);
  without.setting.is_without_light_paths = true;
  StudyResult result = MakeResult({without});
  result.light = StudyLight{.shrink = 3, .width_px = 100, .height_px = 75, .reference_passes = 64};
  return result;
}

TEST(StudyWordsTest, LightPathsPayWhereTheSameErrorTakesLongerWithoutThem) {
  EXPECT_TRUE(Has(TextOf(ResultWithLight(Estimate{0.25, 0.025})),
                  "Light paths pay here: without them (--techniques camera) the same error takes "
                  "4.00 ± 0.40 times as long."));
  const std::string text = TextOf(ResultWithLight(Estimate{2, 0.1}));
  EXPECT_TRUE(Has(text,
                  "Light paths do not pay here: without them (--techniques camera) it is 2.00 ± "
                  "0.10 times as fast to the same error."))
      << text;
  EXPECT_FALSE(Has(text, "Use ")) << text;
  EXPECT_TRUE(Has(TextOf(ResultWithLight(Estimate{1.1, 0.1})),
                  "Undecided whether light paths pay here: without them (--techniques camera) it "
                  "measured 1.10 ± 0.10 times as fast to the same error."));
}

// The curves do not overlap, so their ends are compared.
TEST(StudyWordsTest, ErrorsTooDifferentForARatioAreNamed) {
  StudyResult result = ResultWithLight(std::nullopt);
  result.curves[1].points = {{64, 20, {3, 0.1}, false}};
  result.curves[1].bias_floor = Estimate{2, 0.1};
  EXPECT_TRUE(Has(TextOf(result),
                  "Light paths pay here: without them (--techniques camera) the image has an error "
                  "of ±173 % (relMSE 3) after 20 s of CPU time, with them ±20 % (relMSE 0.04) "
                  "after 10 s. Its samples miss light that light paths find: their spread does not "
                  "show ±141 % (relMSE 2) of the error."))
      << TextOf(result);
  result.curves[1].points = {{64, 20, {1e-4, 1e-6}, false}};
  result.curves[1].bias_floor = std::nullopt;
  EXPECT_TRUE(Has(TextOf(result), "Light paths do not pay here: without them")) << TextOf(result);
  result.curves[1].points.clear();
  EXPECT_TRUE(Has(TextOf(result), "Whether light paths pay here is not known")) << TextOf(result);
}

TEST(StudyWordsTest, TheImageOfLightPathsIsNamed) {
  StudyResult result = ResultWithLight(Estimate{1, 0.1});
  EXPECT_TRUE(Has(TextOf(result),
                  "Errors and costs of light paths are those of an image of 100 x 75 pixels, 3 "
                  "times smaller; crops and the reference have 64 light passes of the whole image "
                  "at most. Effects are those of paths from the camera alone."))
      << TextOf(result);
  result.light->shrink = 1;
  EXPECT_TRUE(
      Has(TextOf(result), "Errors and costs of light paths are those of the image itself;"));
  result.light.reset();
  EXPECT_FALSE(Has(TextOf(result), "of light paths are")) << TextOf(result);
}

// A training comes before the first sample: 600 s x 2 threads x 0.95 = 1140 s, 140 s of it left.
TEST(StudyWordsTest, TenMinutesIncludeTheTraining) {
  StudyResult result = ResultWithLight(Estimate{1, 0.1});
  result.cpu_seconds_per_sample = 1;
  result.training_cpu_seconds = 1000;
  EXPECT_TRUE(Has(Recommend(result)[1], "(140 samples per pixel)")) << Recommend(result)[1];
}

TEST(StudyWordsTest, BiasedSettingsAreCalledBiased) {
  StudyCurve coarse = MakeCurve("coarse", "--coarse", Estimate{5, 0.1});
  coarse.setting.is_unbiased = false;
  coarse.bias_floor = Estimate{0.04, 0.001};
  StudyCurve subtle = MakeCurve("subtle", "--subtle", Estimate{2, 0.1});
  subtle.setting.is_unbiased = false;
  const std::string text = TextOf(MakeResult({coarse, subtle}));
  EXPECT_TRUE(Has(text,
                  "\"coarse\" (--coarse) is biased and renders another image: its error "
                  "never falls below ±20 % (relMSE 0.04)."))
      << text;
  EXPECT_TRUE(Has(text, "\"subtle\" (--subtle) is biased, and 2.00 ± 0.10 times as fast.")) << text;
  EXPECT_FALSE(Has(text, "Use ")) << text;
}

TEST(StudyWordsTest, EffectsOfUncertainTimeAreNotMentioned) {
  StudyResult result = MakeResult({});
  render::EffectMeasurement lens;
  lens.name = "lens";
  lens.time_ratio = {1.2, 0.02};
  lens.relative_mse = 0.0004;
  render::EffectMeasurement light = lens;
  light.name = "light";
  light.time_ratio = {1.2, 0.11};
  result.effects.effects = {lens, light};
  const std::string text = TextOf(result);
  EXPECT_TRUE(Has(text,
                  "17 % of the time is spent on \"lens\". Without it, the image differs by "
                  "±2.0 % (relMSE 0.0004), less than the remaining error."))
      << text;
  EXPECT_FALSE(Has(text, "\"light\"")) << text;
}

TEST(StudyWordsTest, FirefliesSayWhatIsMeantAndHowToAct) {
  StudyResult result = MakeResult({});
  result.assessed_tile_count = 240;
  result.unreliable_tiles = {{{0, 0, 16, 16}, LightPathKind::kIndirect, 0.7},
                             {{16, 0, 32, 16}, LightPathKind::kCaustic, 0.9},
                             {{32, 0, 48, 16}, LightPathKind::kCaustic, 0.9}};
  EXPECT_TRUE(Has(TextOf(result),
                  "3 of 240 tiles contain fireflies; error bars of their pixels may be too small, "
                  "while the errors above include them. More samples help. Main cause: caustic (2 "
                  "tiles), then indirect (1 tile)."))
      << TextOf(result);
}

}  // namespace
}  // namespace sheaf::cli
