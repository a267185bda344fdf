// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A Quote as text and as JSON.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/error_text.h"
#include "cli/progress_line.h"
#include "cli/quote/quote.h"

namespace sheaf::cli {
namespace {

using Json = nlohmann::ordered_json;

std::string FormatBanded(const Banded& time) {
  if (time.value == 0) return "-";
  return absl::StrCat(FormatTime(time.value), " (", FormatTime(time.low), " to ",
                      FormatTime(time.high), ")");
}

// Widths of the columns of the table.
constexpr int kTimeColumns = 34, kSamplesColumns = 8;

std::string ErrorOf(const QuoteRow& row) {
  const Banded& error = row.relative_mse;
  if (row.denoised_error > 0) {
    return absl::StrFormat("%s: %s, once denoised; --target-error %.2g --denoise",
                           FormatBothErrors(row.denoised_error), NoiseWords(row.denoised_error),
                           row.target_error);
  }
  if (row.target_error > 0) {
    return absl::StrCat(FormatBothErrors(row.target_error), ": ", NoiseWords(row.target_error));
  }
  return absl::StrFormat("%s (%s to %s; relMSE %.2g): %s", FormatPixelError(error.value),
                         FormatPixelError(error.low), FormatPixelError(error.high), error.value,
                         NoiseWords(error.value));
}

// Whether the next row promises a smaller error for the same samples, as where both are reached by
// the first round.
bool IsWithinNext(const std::vector<QuoteRow>& rows, size_t i) {
  if (i + 1 >= rows.size()) return false;
  const QuoteRow &row = rows[i], &next = rows[i + 1];
  const auto is_target = [](const QuoteRow& r) {
    return r.target_error > 0 && r.denoised_error == 0 && r.reached;
  };
  return is_target(row) && is_target(next) && next.target_error < row.target_error &&
         next.samples.value == row.samples.value && next.cpu_seconds.value == row.cpu_seconds.value;
}

std::string FormatRow(const QuoteRow& row) {
  const std::string samples = row.samples_given ? absl::StrCat(*row.samples_given)
                                                : absl::StrFormat("%.1f", row.samples.value);
  const std::string wall =
      row.minutes_given > 0 ? FormatTime(60 * row.minutes_given) : FormatBanded(row.wall_seconds);
  std::string text = absl::StrFormat("%-*s %-*s %*s  ", kTimeColumns, wall, kTimeColumns,
                                     FormatBanded(row.cpu_seconds), kSamplesColumns, samples);
  if (row.reached) return absl::StrCat(text, ErrorOf(row), "\n");
  if (row.minutes_given > 0) return text + "too short for a useful error\n";
  return absl::StrCat(text, ErrorOf(row),
                      "; not reached within the maximum of samples per pixel\n");
}

Json BandedJson(const Banded& banded) {
  return {{"value", banded.value}, {"low", banded.low}, {"high", banded.high}};
}

Json HoursJson(const Banded& seconds) {
  return BandedJson({seconds.value / 3600, seconds.low / 3600, seconds.high / 3600});
}

std::string SharingText(const Quote::Sharing& sharing) {
  const char* who = sharing.is_stereo ? "; errors are the worse eye's: " : "; paths are shared: ";
  return absl::StrFormat(
      "%s%.2g of the relMSE and %.2g of the CPU time of %s, by small images of the whole frame",
      who, sharing.error_ratio, sharing.cpu_ratio,
      sharing.is_stereo ? "one eye alone" : "paths of one pixel");
}

Json SharingJson(const Quote& quote) {
  if (!quote.sharing) return nullptr;
  return {{"error_ratio", quote.sharing->error_ratio},
          {"cpu_ratio", quote.sharing->cpu_ratio},
          {"stereo", quote.sharing->is_stereo}};
}

Json StartJson(const Quote& quote) {
  if (!quote.start) return nullptr;
  return {{"samples", quote.start->samples}, {"relative_mse", quote.start->relative_mse}};
}

}  // namespace

std::string FormatQuote(const Quote& quote) {
  std::string text =
      absl::StrFormat("%-*s %-*s %*s  %s\n", kTimeColumns, "wall time (80 % band)", kTimeColumns,
                      quote.start ? "additional CPU time (80 % band)" : "CPU time (80 % band)",
                      kSamplesColumns, "samples", "error of a pixel");
  for (size_t i = 0; i < quote.rows.size(); ++i) {
    if (!IsWithinNext(quote.rows, i)) text += FormatRow(quote.rows[i]);
  }
  absl::StrAppendFormat(&text, "%d x %d px", quote.width_px, quote.height_px);
  if (quote.frame_count > 1) {
    absl::StrAppendFormat(&text, ", %d frames, %d of them in the pilot", quote.frame_count,
                          quote.pilot_frame_count);
  }
  if (quote.sharing) text += SharingText(*quote.sharing);
  if (quote.start) {
    absl::StrAppendFormat(&text, "; %.1f samples exist already, with an error of %s",
                          quote.start->samples, FormatBothErrors(quote.start->relative_mse));
  }
  absl::StrAppendFormat(&text, "; half the error takes %.1f times as long; the pilot took %s",
                        std::pow(4, 1 / std::max(quote.rate, 0.1)),
                        FormatTime(quote.pilot_cpu_seconds));
  if (quote.training_cpu_seconds > 0) {
    absl::StrAppendFormat(&text, "; prices include %s for the training of path guiding%s",
                          FormatTime(quote.training_cpu_seconds),
                          quote.frame_count > 1 ? ", once a frame" : "");
  }
  if (quote.thread_count == 0) {
    text += "; no worker is connected";
  } else {
    absl::StrAppendFormat(&text, "; wall time for all of the farm's %d threads",
                          quote.thread_count);
  }
  if (quote.jobs_before > 0) {
    absl::StrAppendFormat(&text, ", including the time of %d other %s", quote.jobs_before,
                          quote.jobs_before == 1 ? "job" : "jobs");
  }
  if (!quote.denoised) return text + "; nothing is denoised\n";
  absl::StrAppendFormat(&text,
                        "; denoised, crops of the pilot have %.1f times less error (relMSE) at %d "
                        "samples; bands of denoised errors reach from this gain to none\n",
                        quote.denoised->Gain(), static_cast<int>(kDenoisedPilotSamples));
  return text;
}

std::string QuoteJson(const Quote& quote) {
  Json rows = Json::array();
  for (const QuoteRow& row : quote.rows) {
    rows.push_back(
        {{"target_error", row.target_error > 0 ? Json(row.target_error) : Json()},
         {"denoised_error", row.denoised_error > 0 ? Json(row.denoised_error) : Json()},
         {"minutes", row.minutes_given > 0 ? Json(row.minutes_given) : Json()},
         {"sample_count", row.samples_given ? Json(*row.samples_given) : Json()},
         {"reached", row.reached},
         {"relative_mse", BandedJson(row.relative_mse)},
         {"samples", BandedJson(row.samples)},
         {"cpu_hours", HoursJson(row.cpu_seconds)},
         {"wall_seconds", quote.thread_count == 0 ? Json() : BandedJson(row.wall_seconds)}});
  }
  const Json json = {{"width_px", quote.width_px},
                     {"height_px", quote.height_px},
                     {"frame_count", quote.frame_count},
                     {"pilot_frame_count", quote.pilot_frame_count},
                     {"rate", quote.rate},
                     {"rate_deviation", quote.rate_deviation},
                     {"thread_count", quote.thread_count},
                     {"jobs_before", quote.jobs_before},
                     {"pilot_cpu_hours", quote.pilot_cpu_seconds / 3600},
                     {"training_cpu_hours", quote.training_cpu_seconds / 3600},
                     {"start", StartJson(quote)},
                     {"sharing", SharingJson(quote)},
                     {"denoised_gain", quote.denoised ? Json(quote.denoised->Gain()) : Json()},
                     {"band", 0.8},
                     {"rows", rows}};
  return json.dump();
}

}  // namespace sheaf::cli
