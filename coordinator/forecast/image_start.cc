// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/image_start.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/film/error/error_planes.h"
#include "common/scene/spectrum/primaries.h"
#include "coordinator/core/frame/cell_errors.h"
#include "coordinator/forecast/pilot_light.h"

namespace sheaf::coordinator {
namespace {

// A property that an image states in its metadata, and its value in images of the frame.
struct Claim {
  const char* key;
  std::string wanted;
  const char* what;
  const char* otherwise = "";  // The value of images that do not state it.
};

// Empty if the image belongs to the frame.
std::string WhyNotOf(const FrameSpec& spec, const std::string& numeric_profile,
                     const FrameImage& image) {
  const auto text_of = [&](const char* key, const char* otherwise) {
    const auto found = image.metadata.find(key);
    return found == image.metadata.end() ? std::string(otherwise) : found->second;
  };
  if (text_of(kFrameDigestKey, "") == spec.frame_digest) return "";
  const FrameSettings& s = spec.settings;
  const PixelRect& w = s.window;
  const Claim claims[] = {
      {"numericProfile", numeric_profile, "by another build of Sheaf"},
      {"size", absl::StrCat(s.width_px, "x", s.height_px), "at another size"},
      {"window", absl::StrCat(w.x0, ",", w.y0, ",", w.x1, ",", w.y1), "with another crop"},
      {"seed", absl::StrCat(s.seed), "with another seed"},
      {"depthMax", absl::StrCat(s.max_depth), "with another --max-depth"},
      {"techniques", s.techniques.Name(), "with other --techniques", "camera"},
      {"sceneDigest", spec.scene.sha256_hex, "from another scene, or its files have changed"},
  };
  for (const Claim& claim : claims) {
    const std::string text = text_of(claim.key, claim.otherwise);
    if (text == claim.wanted) continue;
    return absl::StrCat("it was rendered ", claim.what, " (it has ", claim.key, " \"", text,
                        "\", the job \"", claim.wanted, "\")");
  }
  return "it was rendered with other settings (outputs, color, primaries or sampling)";
}

// The fraction of each cell's error that light passes cause.
std::vector<double> LightFractionsOf(const FrameImage& image, const CellGrid& grid) {
  const std::vector<double> of_pixels = LightFractions(image);
  const ErrorPlanes planes(image);
  const double mean = planes.Mean();
  std::vector<double> of_cells;
  for (const PixelRect& cell : grid.cells()) {
    const std::vector<PixelError> errors = PixelErrors(planes, image, cell, mean);
    double light = 0, all = 0;
    size_t next = 0;
    for (int32_t y = cell.y0; y < cell.y1; ++y) {
      for (int32_t x = cell.x0; x < cell.x1; ++x) {
        const double error = errors[next++].value;
        light += error * of_pixels[image.window.IndexOf(x, y)];
        all += error;
      }
    }
    of_cells.push_back(all > 0 ? light / all : 0);
  }
  return of_cells;
}

// The sums of errors that are this fraction of those given.
ErrorSums Scaled(const ErrorSums& errors, double fraction) {
  return {errors.pixel_count, fraction * errors.sum, fraction * fraction * errors.square_sum};
}

double LogDeviationOf(const ErrorSums& sum) {
  return sum.sum > 0 ? sum.Deviation() / sum.RelativeMse() : 0;
}

}  // namespace

absl::StatusOr<ResumedImage> ResumeImage(FrameImage image, const FrameSpec& spec,
                                         const std::string& numeric_profile) {
  const FrameSettings& s = spec.settings;
  if (!s.lattice.All()) return absl::InvalidArgumentError("not all of its pixels are rendered");
  const std::string why_not = WhyNotOf(spec, numeric_profile, image);
  absl::StatusOr<ResumedImage> resumed =
      ResumedImage::Make(std::move(image), s.outputs,
                         ImageColorOf(s.primaries, s.white_balance_k, s.sensor), HasLightPasses(s));
  // Errors in the image itself are reported first.
  if (!why_not.empty() && resumed.ok()) return absl::InvalidArgumentError(why_not);
  return resumed;
}

double ImageStart::SamplesPerPixel() const {
  return PixelSamples(cells) / static_cast<double>(SumOf(cells).pixel_count);
}

double ImageStart::RelativeMse() const {
  ErrorSums light;
  for (const ErrorSums& cell : light_errors) light.Add(cell);
  return AddIndependent(SumOf(cells), light).RelativeMse();
}

absl::StatusOr<ImageStart> ImageStartOf(const ResumedImage& resumed, const CellGrid& grid) {
  const std::vector<ErrorSums> errors = EstimateCellErrors(resumed.image(), grid);
  ImageStart start;
  start.light_passes = resumed.light_pass_count();
  std::vector<double> of_light(errors.size());
  if (start.light_passes > 0) of_light = LightFractionsOf(resumed.image(), grid);
  for (size_t i = 0; i < grid.cells().size(); ++i) {
    const absl::StatusOr<uint64_t> samples = resumed.SamplesOf(grid.cells()[i]);
    if (!samples.ok()) return samples.status();
    start.cells.push_back({*samples, Scaled(errors[i], 1 - of_light[i])});
    if (start.light_passes > 0) start.light_errors.push_back(Scaled(errors[i], of_light[i]));
  }
  return start;
}

void ContinueFrom(const ImageStart& start, ErrorModel* model) {
  SHEAF_CHECK(start.cells.size() == model->cells.size());
  for (size_t i = 0; i < start.cells.size(); ++i) {
    model->cells[i].measured = start.cells[i];
    model->cells[i].samples_kept = start.cells[i].samples;
  }
  model->log_error_deviation = LogDeviationOf(SumOf(start.cells));
  model->silhouettes = {};
  SHEAF_CHECK((model->light.passes > 0) == (start.light_passes > 0));
  if (start.light_passes == 0) return;
  ErrorSums sum;
  for (const ErrorSums& cell : start.light_errors) sum.Add(cell);
  model->light.passes = model->light.passes_kept = start.light_passes;
  model->light.errors = start.light_errors;
  model->light.log_error_deviation = LogDeviationOf(sum);
}

}  // namespace sheaf::coordinator
