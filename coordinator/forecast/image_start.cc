// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/image_start.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/scene/spectrum/primaries.h"
#include "coordinator/core/cell_errors.h"

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
      {"techniques", TechniquesName(s.techniques), "with other --techniques", "camera"},
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

}  // namespace

absl::StatusOr<ResumedImage> ResumeImage(FrameImage image, const FrameSpec& spec,
                                         const std::string& numeric_profile) {
  const FrameSettings& s = spec.settings;
  if (!s.lattice.All()) return absl::InvalidArgumentError("not all of its pixels are rendered");
  if (HasLightPaths(s.techniques)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the techniques ", TechniquesName(s.techniques),
        " count light paths and camera paths apart, and an image holds only their sum; render "
        "anew, or continue the job itself with sheaf refine"));
  }
  const std::string why_not = WhyNotOf(spec, numeric_profile, image);
  absl::StatusOr<ResumedImage> resumed = ResumedImage::Make(
      std::move(image), s.outputs, ImageColorOf(s.primaries, s.white_balance_k, s.sensor));
  // Errors in the image itself are reported first.
  if (!why_not.empty() && resumed.ok()) return absl::InvalidArgumentError(why_not);
  return resumed;
}

absl::StatusOr<std::vector<CellRound>> ImageStartOf(const ResumedImage& resumed,
                                                    const CellGrid& grid) {
  const std::vector<ErrorSums> errors = EstimateCellErrors(resumed.image(), grid);
  std::vector<CellRound> cells;
  for (size_t i = 0; i < grid.cells().size(); ++i) {
    const absl::StatusOr<uint64_t> samples = resumed.SamplesOf(grid.cells()[i]);
    if (!samples.ok()) return samples.status();
    cells.push_back({*samples, errors[i]});
  }
  return cells;
}

void ContinueFrom(const std::vector<CellRound>& cells, ErrorModel* model) {
  SHEAF_CHECK(cells.size() == model->cells.size());
  for (size_t i = 0; i < cells.size(); ++i) {
    model->cells[i].measured = cells[i];
    model->cells[i].samples_kept = cells[i].samples;
  }
  const ErrorSums sum = SumOf(cells);
  model->log_error_deviation = sum.sum > 0 ? sum.Deviation() / sum.RelativeMse() : 0;
  model->silhouettes = {};
}

}  // namespace sheaf::coordinator
