// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/image/comparison_report.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/film/error/error_estimate.h"

namespace sheaf::cli {
namespace {

constexpr const char* kChannelNames[] = {"R", "G", "B"};

// "+0.4 %". If exactly one of the two is black, there is no ratio.
std::string ChangeText(double ratio) {
  if (!std::isfinite(ratio)) return "no ratio, because the reference is black";
  return absl::StrFormat("%+.2g %%", 100 * (ratio - 1));
}

std::string MeanText(const Comparison& comparison) {
  const double ratio = comparison.reference_mean == 0 && comparison.image_mean == 0
                           ? 1
                           : comparison.image_mean / comparison.reference_mean;
  std::string text = absl::StrFormat("%.4g, reference %.4g: %s", comparison.image_mean,
                                     comparison.reference_mean, ChangeText(ratio));
  for (size_t c = 0; c < comparison.mean_ratio.size(); ++c) {
    absl::StrAppend(&text, c == 0 ? " (" : ", ", kChannelNames[c], " ",
                    ChangeText(comparison.mean_ratio[c]));
  }
  return text + ")";
}

void AppendTiles(const TileDeviations& tiles, std::string* text) {
  absl::StrAppendFormat(text, "%-20s %d of %d differ by more than noise\n", "tiles",
                        tiles.deviating_count, tiles.tile_count);
  for (const TileDeviation& tile : tiles.worst) {
    const PixelRect& rect = tile.rect;
    absl::StrAppendFormat(text, "  [%d, %d) x [%d, %d)  %s %.3g, reference %.3g, ", rect.x0,
                          rect.x1, rect.y0, rect.y1, kChannelNames[tile.channel], tile.image_mean,
                          tile.reference_mean);
    if (std::isfinite(tile.excess)) {
      absl::StrAppendFormat(text, "%+.1f standard errors beyond the limit\n", tile.excess);
    } else {
      absl::StrAppend(text, "without noise\n");
    }
  }
}

// The reasons for the verdict.
std::string VerdictText(const ComparisonReport& report) {
  const std::string_view verdict = VerdictOf(report);
  if (verdict == "identical") return "identical: every pixel has the same bits";
  const double relative_mse = report.comparison.relative_mse;
  if (verdict == "unknown") {
    return "unknown: the image has no true error bars to separate noise from other differences";
  }
  const std::string noise = absl::StrFormat("the error bars predict a relMSE of %.2g +- %.1g",
                                            report.noise->relative_mse, report.noise->deviation);
  if (verdict == "within noise") {
    return absl::StrCat("within noise: ", noise, "; no other difference is detected");
  }
  return absl::StrFormat("beyond noise: %s, and relMSE is %.1f times that; --tiles shows where",
                         noise, relative_mse / report.noise->relative_mse);
}

}  // namespace

std::optional<ExpectedNoise> NoiseOf(const FrameImage& image) {
  for (const char* channel :
       {"R", "G", "B", "stderr.R", "stderr.G", "stderr.B", "samples", "nonfinite"}) {
    if (image.Find(channel) == nullptr) return std::nullopt;
  }
  const auto sampling = image.metadata.find("sampling");
  if (sampling != image.metadata.end() && sampling->second == "one-sequence") return std::nullopt;
  const FrameError error = EstimateError(image);
  if (!(error.relative_mse > 0)) return std::nullopt;
  return ExpectedNoise{error.relative_mse, error.relative_mse_deviation};
}

std::optional<ExpectedNoise> NoiseOfDifference(const std::optional<ExpectedNoise>& reference,
                                               const std::optional<ExpectedNoise>& image) {
  if (!image || !reference) return image;
  return ExpectedNoise{image->relative_mse + reference->relative_mse,
                       std::hypot(image->deviation, reference->deviation)};
}

const char* VerdictOf(const ComparisonReport& report) {
  if (report.comparison.fraction_differing == 0) return "identical";
  if (!report.noise) return "unknown";
  const ExpectedNoise& noise = *report.noise;
  const double most = noise.relative_mse + kNoiseDeviationsMax * noise.deviation;
  return report.comparison.relative_mse <= most ? "within noise" : "beyond noise";
}

std::string FormatComparison(const ComparisonReport& report) {
  const Comparison& comparison = report.comparison;
  std::string text;
  const auto line = [&](const char* name, const std::string& value) {
    absl::StrAppendFormat(&text, "%-20s %s\n", name, value);
  };
  const double typical = 100 * std::sqrt(comparison.relative_mse);
  line("relMSE", absl::StrFormat("%.3g (typical error of a pixel: %.2g %%)",
                                 comparison.relative_mse, typical));
  line("FLIP", absl::StrFormat("%.3g (0: no visible difference, 1: largest)", report.flip));
  if (report.hdr_flip) line("HDR-FLIP", absl::StrFormat("%.3g", *report.hdr_flip));
  line("mean", MeanText(comparison));
  line("MSE", absl::StrFormat("%.3g", comparison.mse));
  line("largest difference", absl::StrFormat("%.3g", comparison.max_abs_difference));
  line("pixels that differ", absl::StrFormat("%.4g %%", 100 * comparison.fraction_differing));
  line("NaN/Inf values", absl::StrCat(comparison.nonfinite_count));
  if (report.tiles) AppendTiles(*report.tiles, &text);
  line("reference", report.reference_digest);
  line("image", report.image_digest);
  if (report.tolerance >= 0) {
    const bool is_more = comparison.relative_mse > report.tolerance;
    line("tolerance",
         absl::StrFormat("relMSE is %s %.3g", is_more ? "above" : "within", report.tolerance));
  }
  line("verdict", VerdictText(report));
  return text;
}

}  // namespace sheaf::cli
