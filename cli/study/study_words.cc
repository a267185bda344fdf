// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "cli/error_text.h"
#include "cli/progress_line.h"
#include "cli/study/study.h"

namespace sheaf::cli {
namespace {

// A value is claimed to be larger or smaller than another one if this many standard errors exclude
// that they are equal.
constexpr double kClaimDeviations = 2;
// Smaller gains are not mentioned.
constexpr double kGainMin = 1.03;
constexpr double kEffectTimeMin = 0.05;
constexpr double kNoiseFractionMin = 0.25;
// The time whose result the second sentence states.
constexpr double kAskedMinutes = 10;

const LightPathName& PathNameOf(LightPathKind kind) {
  return kLightPathNames[static_cast<size_t>(kind)];
}

std::string ThreadsText(int threads) {
  return absl::StrCat(threads, threads == 1 ? " thread" : " threads");
}

std::string OfBase(const StudyResult& result) {
  const StudyCurve& base = result.curves.front();
  if (base.points.empty()) {
    return "The errors of the settings as given cannot be distinguished from 0: give the study "
           "more minutes.";
  }
  const StudyPoint& last = base.points.back();
  std::string text = absl::StrFormat(
      "As given, %.0f samples per pixel have an error of %s and take %s of CPU time, on the %s of "
      "this machine about %s",
      last.samples, FormatBothErrors(last.relative_mse.value), FormatTime(last.cpu_seconds),
      ThreadsText(result.threads), FormatTime(WallSecondsOn(result.threads, last.cpu_seconds)));
  if (base.rate) {
    absl::StrAppendFormat(&text,
                          "; half the error takes %.1f times as long, where independent samples "
                          "take 4 times",
                          std::pow(4, 1 / std::max(base.rate->value, 0.1)));
  }
  return text + ".";
}

// The error after ten minutes, here and on the farm.
void AddAskedTime(const StudyResult& result, std::vector<std::string>* lines) {
  if (!(result.cpu_seconds_per_sample > 0)) return;
  const auto buys = [&](int threads) -> std::string {
    const double samples = SamplesIn(60 * kAskedMinutes, threads, result.cpu_seconds_per_sample,
                                     result.training_cpu_seconds);
    const std::optional<Estimate> error = ErrorAt(result.curves.front(), samples);
    if (!error || samples < 1) return "";
    return absl::StrFormat("%s (%s samples per pixel)", FormatBothErrors(error->value),
                           FormatCount(std::floor(samples)));
  };
  const std::string here = buys(std::max(1, result.threads));
  if (here.empty()) return;
  std::string text =
      absl::StrFormat("In %g minutes, this machine reaches about %s", kAskedMinutes, here);
  if (result.farm && result.farm->thread_count > 0) {
    absl::StrAppend(&text, "; the ", ThreadsText(result.farm->thread_count), " of the farm at ",
                    result.farm->address, ", if they are as fast, ",
                    buys(result.farm->thread_count));
  }
  lines->push_back(text + ". Nothing is denoised.");
}

bool IsFaster(const StudyCurve& curve) {
  return curve.gain && curve.gain->value > kGainMin &&
         curve.gain->value - kClaimDeviations * curve.gain->error > 1;
}

std::string GainText(const StudyCurve& curve) {
  const bool faster = curve.gain->value > 1;
  const double ratio = faster ? curve.gain->value : 1 / curve.gain->value;
  return absl::StrFormat("%.2f ± %.2f times as %s", ratio,
                         ratio * curve.gain->error / curve.gain->value, faster ? "fast" : "slow");
}

std::string FlagText(const StudySetting& setting) {
  return setting.flag.empty() ? "" : absl::StrCat(" (", setting.flag, ")");
}

std::string NameText(const StudySetting& setting) {
  return absl::StrCat("\"", setting.name, "\"", FlagText(setting));
}

bool IsSlower(const StudyCurve& curve) {
  return curve.gain && curve.gain->value + kClaimDeviations * curve.gain->error < 1;
}

// Whether light paths pay if the measured errors overlap; otherwise the errors.
std::string LightVerdict(const StudyCurve& base, const StudyCurve& without) {
  const std::string flag = FlagText(without.setting);
  if (IsSlower(without)) {
    const Estimate& gain = *without.gain;
    return absl::StrFormat(
        "Light paths pay here: without them%s the same error takes %.2f ± %.2f times as long.",
        flag, 1 / gain.value, gain.error / (gain.value * gain.value));
  }
  if (IsFaster(without)) {
    return absl::StrCat("Light paths do not pay here: without them", flag, " it is ",
                        GainText(without), " to the same error.");
  }
  if (without.gain) {
    return absl::StrCat("Undecided whether light paths pay here: without them", flag,
                        " it measured ", GainText(without), " to the same error.");
  }
  const StudyPoint &with_first = base.points.front(), &with_last = base.points.back(),
                   &last = without.points.back();
  const bool pay = last.relative_mse.value > with_first.relative_mse.value;
  const StudyPoint& with = pay ? with_first : with_last;
  return absl::StrFormat(
      "Light paths %s here: without them%s the image has an error of %s after %s of CPU time, with "
      "them %s after %s.",
      pay ? "pay" : "do not pay", flag, FormatBothErrors(last.relative_mse.value),
      FormatTime(last.cpu_seconds), FormatBothErrors(with.relative_mse.value),
      FormatTime(with.cpu_seconds));
}

// Whether light paths pay, and on which image they were measured.
void AddLight(const StudyResult& result, std::vector<std::string>* lines) {
  if (!result.light) return;
  const StudyCurve& base = result.curves.front();
  for (const StudyCurve& curve : result.curves) {
    if (!curve.setting.is_without_light_paths) continue;
    if (curve.points.empty() || base.points.empty()) {
      lines->emplace_back(
          "Whether light paths pay here is not known: errors with them or without them cannot be "
          "distinguished from 0.");
      continue;
    }
    std::string text = LightVerdict(base, curve);
    if (curve.HasBias()) {
      absl::StrAppend(&text,
                      " Its samples miss light that light paths find: their spread does not show ",
                      FormatBothErrors(curve.bias_floor->value), " of the error.");
    }
    lines->push_back(std::move(text));
  }
  const StudyLight& light = *result.light;
  lines->push_back(absl::StrCat(
      light.shrink > 1 ? absl::StrCat("Errors and costs of light paths are those of an image of ",
                                      light.width_px, " x ", light.height_px, " pixels, ",
                                      light.shrink, " times smaller; ")
                       : "Errors and costs of light paths are those of the image itself; ",
      "crops and the reference have ", light.reference_passes,
      " light passes of the whole image at most. Effects are those of paths from the camera "
      "alone."));
}

// Settings that render the same image: advice among those that keep the error bars, then the
// undecided ones, the slower ones, and last those without error bars.
void AddUnbiased(const StudyResult& result, std::vector<std::string>* lines) {
  const StudyCurve* best = nullptr;
  std::vector<std::string> slower, undecided, without_bars;
  for (const StudyCurve& curve : result.curves) {
    const StudySetting& setting = curve.setting;
    if (setting.is_base || !setting.is_unbiased || !curve.gain) continue;
    if (setting.is_without_light_paths) continue;
    if (curve.gain->value + kClaimDeviations * curve.gain->error < 1 / kGainMin) {
      slower.push_back(absl::StrCat(setting.name, " (", GainText(curve), ")"));
    }
    if (setting.flag.empty()) continue;
    if (!setting.keeps_error_bars) {
      if (IsFaster(curve)) {
        without_bars.push_back(absl::StrCat(NameText(setting), " would be ", GainText(curve),
                                            " to the same error, but gives no true error bars."));
      }
    } else if (IsFaster(curve)) {
      if (best == nullptr || curve.gain->value > best->gain->value) best = &curve;
    } else if (curve.gain->value > kGainMin) {
      undecided.push_back(absl::StrCat(NameText(setting), " measured ", GainText(curve)));
    }
  }
  if (best != nullptr) {
    lines->push_back(absl::StrCat("Use ", NameText(best->setting),
                                  ": the same image and true "
                                  "error bars, ",
                                  GainText(*best), " to the same error; ", best->setting.how, "."));
  } else {
    lines->emplace_back(
        "No setting that renders the same image with true error bars was found to reach the same "
        "error faster.");
  }
  if (!undecided.empty()) {
    lines->push_back(absl::StrCat("Undecided, as two standard errors do not exclude a ratio of 1: ",
                                  absl::StrJoin(undecided, ", "),
                                  "; a study of more minutes decides."));
  }
  if (!slower.empty()) {
    lines->push_back(absl::StrCat("Slower than as given: ", absl::StrJoin(slower, ", "), "."));
  }
  std::move(without_bars.begin(), without_bars.end(), std::back_inserter(*lines));
}

void AddBiased(const StudyResult& result, std::vector<std::string>* lines) {
  const StudyCurve& base = result.curves.front();
  for (const StudyCurve& curve : result.curves) {
    const StudySetting& setting = curve.setting;
    if (setting.is_unbiased || setting.flag.empty() || !curve.bias_floor) continue;
    const Estimate& floor = *curve.bias_floor;
    const std::string name = NameText(setting);
    if (!curve.HasBias()) {
      if (!IsFaster(curve)) continue;
      lines->push_back(absl::StrCat(
          name, " is biased, and ", GainText(curve),
          ". Its bias is too small to be measured here: below ",
          FormatBothErrors(std::max(0.0, floor.value) + kClaimDeviations * floor.error), "."));
      continue;
    }
    if (setting.is_truer) {
      lines->push_back(absl::StrCat("As given, the scene omits light: the image of ", name,
                                    " differs by ", FormatBothErrors(floor.value),
                                    " and is closer to the truth."));
      continue;
    }
    if (curve.points.empty() || base.points.empty()) continue;
    const auto seconds_per_sample = [](const StudyCurve& of) {
      return of.points.back().cpu_seconds / of.points.back().samples;
    };
    lines->push_back(absl::StrFormat(
        "%s is biased and renders another image: its error never falls below %s. A sample takes "
        "%.0f %% of the time; it may be acceptable for errors well above that.",
        name, FormatBothErrors(floor.value),
        100 * seconds_per_sample(curve) / seconds_per_sample(base)));
  }
}

void AddEffects(const StudyResult& result, std::vector<std::string>* lines) {
  if (result.curves.front().points.empty()) return;
  const double error = result.curves.front().points.back().relative_mse.value;
  for (const render::EffectMeasurement& effect : result.effects.effects) {
    if (!effect.problem.empty() || effect.TimeFraction() < kEffectTimeMin) continue;
    if (effect.time_ratio.value - kClaimDeviations * effect.time_ratio.error <= 1) continue;
    const std::string cost = absl::StrFormat("%.0f %% of the time is spent on \"%s\". Without it, ",
                                             100 * effect.TimeFraction(), effect.name);
    if (!(effect.relative_mse > 0)) {
      lines->push_back(cost + "no difference is seen.");
      continue;
    }
    lines->push_back(
        absl::StrCat(cost, "the image differs by ", FormatBothErrors(effect.relative_mse), ", ",
                     effect.relative_mse < error ? "less" : "more", " than the remaining error."));
  }
}

void AddPaths(const StudyResult& result, std::vector<std::string>* lines) {
  for (const StudyPath& path : result.paths) {
    if (path.fractions.variance < kNoiseFractionMin) continue;
    lines->push_back(
        absl::StrFormat("%.0f %% of the noise comes from %.0f %% of the light: %s, %s.",
                        100 * path.fractions.variance, 100 * path.fractions.light,
                        PathNameOf(path.kind).name, PathNameOf(path.kind).meaning));
  }
  if (result.unreliable_tiles.empty()) return;
  std::array<size_t, kLightPathKindCount> counts{};
  for (const UnreliableTile& tile : result.unreliable_tiles) {
    ++counts[static_cast<size_t>(tile.kind)];
  }
  std::vector<size_t> kinds;
  for (size_t k = 0; k < counts.size(); ++k) {
    if (counts[k] > 0) kinds.push_back(k);
  }
  std::sort(kinds.begin(), kinds.end(), [&](size_t a, size_t b) { return counts[a] > counts[b]; });
  std::vector<std::string> causes;
  for (const size_t k : kinds) {
    causes.push_back(absl::StrCat(kLightPathNames[k].name, " (", counts[k],
                                  counts[k] == 1 ? " tile)" : " tiles)"));
  }
  lines->push_back(absl::StrCat(
      result.unreliable_tiles.size(), " of ", result.assessed_tile_count,
      " tiles contain fireflies; error bars of their pixels may be too small, while the errors "
      "above include them. More samples help. Main cause: ",
      absl::StrJoin(causes, ", then "), "."));
}

}  // namespace

std::vector<std::string> Recommend(const StudyResult& result) {
  std::vector<std::string> lines;
  if (result.curves.empty()) return lines;
  lines.push_back(OfBase(result));
  AddAskedTime(result, &lines);
  AddLight(result, &lines);
  AddUnbiased(result, &lines);
  AddBiased(result, &lines);
  AddEffects(result, &lines);
  AddPaths(result, &lines);
  return lines;
}

}  // namespace sheaf::cli
