// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf compare: measures the error of an image against a reference.
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "cli/commands/command.h"
#include "cli/commands/error_option.h"
#include "cli/commands/options.h"
#include "cli/image/comparison_report.h"
#include "cli/image/tone_map.h"
#include "cli/job/output_files.h"
#include "cli/message.h"
#include "common/film/error/compare.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/film.h"
#include "common/image/image_io.h"

namespace sheaf::cli {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kChannelNames[] = {"R", "G", "B"};

// JSON has no numbers for infinity and NaN.
Json Number(double value) { return std::isfinite(value) ? Json(value) : Json(); }

// Mean of the image's channel of sample counts; 0 without this channel.
double MeanSampleCount(const FrameImage& image) {
  const std::vector<float>* samples = image.Find("samples");
  if (samples == nullptr || samples->empty()) return 0;
  double sum = 0;
  for (const float count : *samples) sum += count;
  return sum / static_cast<double>(samples->size());
}

absl::Status WriteDifference(FrameImage difference, const std::string& path) {
  if (!IsPng(path)) return WriteFrameImage(difference, path);
  // A PNG has no negative values: it shows the magnitude of a difference, not its sign.
  for (std::vector<float>& plane : difference.planes) {
    for (float& value : plane) value = std::fabs(value);
  }
  return WritePng(path, difference.window.Width(), difference.window.Height(),
                  ToneMapSrgb(difference));
}

class CompareCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = app->add_subcommand("compare", "Compare an image with a reference");
    command->add_option("REFERENCE", reference_path_, "Reference image (.exr)")->required();
    command->add_option("IMAGE", image_path_, "Image to compare (.exr)")->required();
    command->add_option("--diff", diff_path_,
                        "Write IMAGE - REFERENCE (.exr), or its absolute value (.png)");
    command
        ->add_option(
            "--tolerance", tolerance_,
            "Exit with 1 if relMSE is larger, or the typical error of a pixel, as in 1%; 0 "
            "also requires identical bits")
        ->transform(PercentAsRelativeMse())
        ->check(InRange(0.0));
    command->add_flag("--hdr-flip", hdr_flip_,
                      "Also print how different they look over all exposures (HDR-FLIP; slow)");
    command->add_flag("--tiles", tiles_, "Also list tiles that differ by more than noise");
    command
        ->add_option(
            "--tile-tolerance", limits_.mean_fraction_max,
            "With --tiles: allowed difference beyond noise, as a fraction of a tile's mean")
        ->check(InRange(0.0))
        ->capture_default_str();
    command
        ->add_option("--tile-sigmas", limits_.standard_errors_max,
                     "With --tiles: allowed difference in standard errors")
        ->check(InRange(0.0))
        ->capture_default_str();
    command
        ->add_option("--reference-samples", reference_samples_,
                     "With --tiles: samples per pixel of REFERENCE; 0: it has converged")
        ->check(InRange(0.0))
        ->capture_default_str();
    AddJsonFlag(command, &json_);
    command->footer(
        "FLIP measures how different the images look in the sRGB view, without exposure: the mean\n"
        "of LDR-FLIP at 67 pixels per degree, from 0 (no visible difference) to 1. The verdict\n"
        "compares relMSE with the value that the error bars of both images predict; a reference\n"
        "without error bars is assumed to have converged.\n\n"
        "Examples:\n"
        "  sheaf compare reference.exr image.exr --diff difference.exr\n"
        "  sheaf compare a.exr b.exr --tolerance 0          # identical bits?\n"
        "  sheaf compare reference.exr image.exr --tiles --reference-samples 1024");
    return command;
  }

  ExitCode Run() override {
    if (absl::Status status = CheckOutputName("--diff", diff_path_, {".exr", ".png"});
        !status.ok()) {
      return ReportError(ExitCode::kUsage, status);
    }
    if (absl::Status status = CheckOutputs({diff_path_}, {reference_path_, image_path_});
        !status.ok()) {
      return ReportOutputError(status);
    }
    absl::StatusOr<FrameImage> reference = ReadFrameImage(reference_path_);
    if (!reference.ok()) return ReportError(ExitCode::kFile, reference.status());
    const absl::StatusOr<FrameImage> image = ReadFrameImage(image_path_);
    if (!image.ok()) return ReportError(ExitCode::kFile, image.status());
    ComparisonReport report;
    report.tolerance = tolerance_;
    report.reference_digest = ImageDigest(*reference);
    report.image_digest = ImageDigest(*image);
    report.noise = NoiseOfDifference(NoiseOf(*reference), NoiseOf(*image));
    const bool converts = !(reference->color.chromaticities == image->color.chromaticities);
    if (converts) {
      // The reference is converted, not the image: the image's standard errors hold only in its own
      // primaries.
      const absl::Status status = ConvertColor(image->color.chromaticities, &*reference);
      if (!status.ok()) return ReportError(ExitCode::kFailed, status);
      PrintNote(absl::StrCat(reference_path_, " is converted to the primaries of ", image_path_));
    }
    if (absl::Status status = Compare(*reference, *image, &report); !status.ok()) {
      return ReportError(ExitCode::kFailed, status);
    }
    if (!diff_path_.empty()) {
      absl::StatusOr<FrameImage> difference = DifferenceImage(*reference, *image);
      if (!difference.ok()) return ReportError(ExitCode::kFailed, difference.status());
      const absl::Status written = WriteDifference(*std::move(difference), diff_path_);
      if (!written.ok()) return ReportError(ExitCode::kFile, written);
    }
    const std::string text = json_ ? ReportJson(report, converts) : FormatComparison(report);
    std::fputs(text.c_str(), stdout);
    return IsWithin(report) ? ExitCode::kOk : ExitCode::kFailed;
  }

 private:
  absl::Status Compare(const FrameImage& reference, const FrameImage& image,
                       ComparisonReport* report) {
    const absl::StatusOr<Comparison> comparison = CompareImages(reference, image);
    if (!comparison.ok()) return comparison.status();
    report->comparison = *comparison;
    const absl::StatusOr<double> flip = PerceivedDifference(reference, image, FlipRange::kScreen);
    if (!flip.ok()) return flip.status();
    report->flip = *flip;
    if (hdr_flip_) {
      const absl::StatusOr<double> hdr = PerceivedDifference(reference, image, FlipRange::kAll);
      if (!hdr.ok()) return hdr.status();
      report->hdr_flip = *hdr;
    }
    if (!tiles_) return absl::OkStatus();
    limits_.samples_ratio =
        reference_samples_ > 0 ? MeanSampleCount(image) / reference_samples_ : 0;
    absl::StatusOr<TileDeviations> tiles = FindTileDeviations(reference, image, limits_);
    if (!tiles.ok()) return tiles.status();
    report->tiles = *std::move(tiles);
    return absl::OkStatus();
  }

  // Whether the exit code is kOk.
  static bool IsWithin(const ComparisonReport& report) {
    if (report.tiles && report.tiles->deviating_count > 0) return false;
    if (report.tolerance == 0 && report.comparison.fraction_differing > 0) return false;
    return report.tolerance < 0 || report.comparison.relative_mse <= report.tolerance;
  }

  static std::string ReportJson(const ComparisonReport& report, bool converted) {
    const Comparison& comparison = report.comparison;
    Json json = {
        {"relative_mse", Number(comparison.relative_mse)},
        {"flip", Number(report.flip)},
        {"mse", Number(comparison.mse)},
        {"reference_mean", Number(comparison.reference_mean)},
        {"image_mean", Number(comparison.image_mean)},
        {"mean_ratio", Json::array()},
        {"fraction_differing", comparison.fraction_differing},
        {"max_abs_difference", Number(comparison.max_abs_difference)},
        {"nonfinite_count", comparison.nonfinite_count},
        {"reference_digest", report.reference_digest},
        {"image_digest", report.image_digest},
        {"expected_relative_mse", report.noise ? Json(report.noise->relative_mse) : Json()},
        {"expected_deviation", report.noise ? Json(report.noise->deviation) : Json()},
        {"verdict", VerdictOf(report)}};
    if (converted) json["reference_converted"] = true;
    if (report.hdr_flip) json["hdr_flip"] = Number(*report.hdr_flip);
    for (const double ratio : comparison.mean_ratio) json["mean_ratio"].push_back(Number(ratio));
    if (report.tiles) AddTiles(*report.tiles, &json);
    return json.dump() + "\n";
  }

  static void AddTiles(const TileDeviations& tiles, Json* json) {
    (*json)["tile_count"] = tiles.tile_count;
    (*json)["tiles_deviating"] = tiles.deviating_count;
    Json worst = Json::array();
    for (const TileDeviation& tile : tiles.worst) {
      worst.push_back({{"x0_px", tile.rect.x0},
                       {"y0_px", tile.rect.y0},
                       {"channel", kChannelNames[tile.channel]},
                       {"reference_mean", Number(tile.reference_mean)},
                       {"image_mean", Number(tile.image_mean)},
                       {"standard_error", Number(tile.standard_error)},
                       {"excess", Number(tile.excess)}});
    }
    (*json)["worst"] = std::move(worst);
  }

  std::string reference_path_, image_path_, diff_path_;
  double tolerance_ = -1;  // Negative: report only.
  bool hdr_flip_ = false, tiles_ = false, json_ = false;
  double reference_samples_ = 0;
  TileDeviationLimits limits_;
};

}  // namespace

std::unique_ptr<Command> MakeCompareCommand() { return std::make_unique<CompareCommand>(); }

}  // namespace sheaf::cli
