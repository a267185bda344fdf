// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "cli/study/study.h"

namespace sheaf::cli {
namespace {

// A gain counts as different from 1 if it is this many standard errors away.
constexpr double kReportedGainDeviations = 2;
// Smaller gains are not mentioned.
constexpr double kGainMin = 1.03;
constexpr double kEffectTimeMin = 0.05;
constexpr double kNoiseFractionMin = 0.25;

const LightPathName& PathNameOf(LightPathKind kind) {
  return kLightPathNames[static_cast<size_t>(kind)];
}

std::string OfBase(const StudyCurve& base) {
  if (base.points.empty()) {
    return "The errors of the settings as given cannot be distinguished from 0: give the study "
           "more minutes.";
  }
  const StudyPoint& last = base.points.back();
  std::string text = absl::StrFormat(
      "As given, %.0f samples per pixel take %.3g CPU seconds and have relMSE %.2g +- %.1g",
      last.samples, last.cpu_seconds, last.relative_mse.value, last.relative_mse.error);
  if (base.rate) {
    absl::StrAppendFormat(
        &text,
        "; errors fall as 1 / samples^%.2f, so a quarter of the error takes %.1f times as long",
        base.rate->value, std::pow(4, 1 / std::max(base.rate->value, 0.1)));
  }
  return text + ".";
}

bool IsFaster(const StudyCurve& curve) {
  return curve.gain && curve.gain->value > kGainMin &&
         curve.gain->value - kReportedGainDeviations * curve.gain->error > 1;
}

std::string GainText(const StudyCurve& curve) {
  const bool faster = curve.gain->value > 1;
  const double ratio = faster ? curve.gain->value : 1 / curve.gain->value;
  return absl::StrFormat("%.2f +- %.2f times as %s", ratio,
                         ratio * curve.gain->error / curve.gain->value, faster ? "fast" : "slow");
}

std::string FlagText(const StudySetting& setting) {
  return setting.flag.empty() ? "" : absl::StrCat(" (", setting.flag, ")");
}

void AddUnbiased(const StudyResult& result, std::vector<std::string>* lines) {
  const StudyCurve* best = nullptr;
  std::vector<std::string> slower;
  for (const StudyCurve& curve : result.curves) {
    if (curve.setting.is_base || !curve.setting.is_unbiased || !curve.gain) continue;
    if (IsFaster(curve) && !curve.setting.flag.empty() &&
        (best == nullptr || curve.gain->value > best->gain->value)) {
      best = &curve;
    }
    if (curve.gain->value + kReportedGainDeviations * curve.gain->error < 1 / kGainMin) {
      slower.push_back(absl::StrCat(curve.setting.name, " (", GainText(curve), ")"));
    }
  }
  if (best != nullptr) {
    lines->push_back(absl::StrCat("Use \"", best->setting.name, "\"", FlagText(best->setting),
                                  ": the same expectation, ", GainText(*best),
                                  " to the same error; ", best->setting.how, "."));
  } else {
    lines->emplace_back(
        "No available setting with the same expectation reaches the same error faster.");
  }
  if (!slower.empty()) {
    lines->push_back(absl::StrCat("Slower than as given: ", absl::StrJoin(slower, ", "), "."));
  }
}

void AddBiased(const StudyResult& result, std::vector<std::string>* lines) {
  const StudyCurve& base = result.curves.front();
  for (const StudyCurve& curve : result.curves) {
    const StudySetting& setting = curve.setting;
    if (setting.is_unbiased || setting.flag.empty() || !curve.bias_floor) continue;
    const Estimate& floor = *curve.bias_floor;
    const std::string name = absl::StrCat("\"", setting.name, "\"", FlagText(setting));
    if (!curve.HasBias()) {
      if (!IsFaster(curve)) continue;
      lines->push_back(absl::StrFormat(
          "%s is %s. Its bias is too small to be measured here: below relMSE %.1g.", name,
          GainText(curve), std::max(0.0, floor.value) + kReportedGainDeviations * floor.error));
      continue;
    }
    if (setting.is_truer) {
      lines->push_back(
          absl::StrFormat("As given, the scene omits light: the image of %s differs by relMSE %.2g "
                          "+- %.1g and is closer to the truth.",
                          name, floor.value, floor.error));
      continue;
    }
    if (curve.points.empty() || base.points.empty()) continue;
    const auto seconds_per_sample = [](const StudyCurve& of) {
      return of.points.back().cpu_seconds / of.points.back().samples;
    };
    lines->push_back(absl::StrFormat(
        "%s changes the image: its error never falls below relMSE %.2g +- %.1g. A sample takes "
        "%.0f %% of the time; it may be acceptable for targets well above that floor.",
        name, floor.value, floor.error,
        100 * seconds_per_sample(curve) / seconds_per_sample(base)));
  }
}

void AddEffects(const StudyResult& result, std::vector<std::string>* lines) {
  if (result.curves.front().points.empty()) return;
  const double error = result.curves.front().points.back().relative_mse.value;
  for (const render::EffectMeasurement& effect : result.effects.effects) {
    if (!effect.problem.empty() || effect.TimeFraction() < kEffectTimeMin) continue;
    const double loss = std::max(0.0, effect.relative_mse);
    lines->push_back(absl::StrFormat(
        "%.0f %% of the time is spent on \"%s\". Without it, the image differs by relMSE %.2g, %s "
        "than the remaining error.",
        100 * effect.TimeFraction(), effect.name, loss, loss < error ? "less" : "more"));
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
  std::vector<std::string> blamed;
  for (size_t k = 0; k < counts.size(); ++k) {
    if (counts[k] > 0) blamed.push_back(absl::StrCat(kLightPathNames[k].name, " in ", counts[k]));
  }
  lines->push_back(absl::StrCat(result.unreliable_tiles.size(),
                                " of the tiles contain fireflies; their error estimates are "
                                "unreliable. Main cause: ",
                                absl::StrJoin(blamed, ", "), "."));
}

}  // namespace

std::vector<std::string> Recommend(const StudyResult& result) {
  std::vector<std::string> lines;
  if (result.curves.empty()) return lines;
  lines.push_back(OfBase(result.curves.front()));
  AddUnbiased(result, &lines);
  AddBiased(result, &lines);
  AddEffects(result, &lines);
  AddPaths(result, &lines);
  return lines;
}

}  // namespace sheaf::cli
