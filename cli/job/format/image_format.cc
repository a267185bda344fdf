// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/format/image_format.h"

#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "cli/job/format/plane_depth.h"
#include "common/base/printable.h"

namespace sheaf::cli {
namespace {

constexpr size_t kTextBytesMax = 4096;

// "24" or "24000/1001"; nothing if the text is not a positive ratio of 32-bit integers.
std::optional<std::pair<int32_t, int32_t>> ParseRatio(const std::string& text) {
  const std::vector<std::string> items = absl::StrSplit(text, '/');
  std::pair<int32_t, int32_t> ratio{0, 1};
  const bool is_good = items.size() <= 2 && absl::SimpleAtoi(items[0], &ratio.first) &&
                       (items.size() == 1 || absl::SimpleAtoi(items[1], &ratio.second));
  if (!is_good || ratio.first < 1 || ratio.second < 1) return std::nullopt;
  return ratio;
}

std::string SecondsText(const google::protobuf::Duration& duration) {
  return absl::StrFormat("%.6g", static_cast<double>(duration.seconds()) + duration.nanos() * 1e-9);
}

absl::Status CheckText(const char* option, const std::string& text) {
  if (text.size() <= kTextBytesMax && FindUnprintable(text) == std::string::npos) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(option, ": the text has more than ", kTextBytesMax,
                                                 " bytes, or is not printable UTF-8"));
}

}  // namespace

absl::Status CheckImageFormat(const ImageFormat& format) {
  if (absl::Status status = CheckExrFormat(format.exr); !status.ok()) return status;
  if (absl::Status status = CheckText("--exr-owner", format.owner); !status.ok()) return status;
  if (absl::Status status = CheckText("--exr-comments", format.comments); !status.ok()) {
    return status;
  }
  if (format.frames_per_second.empty() || ParseRatio(format.frames_per_second)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--exr-fps ", format.frames_per_second,
                   ": expected a number of frames per second, as in 24 or 24000/1001"));
}

void AddAttributes(const ImageFormat& format, const v1::Frame& frame, absl::Time now,
                   FrameImage* image) {
  std::map<std::string, std::string>& attributes = image->attributes;
  if (!format.owner.empty()) attributes["owner"] = format.owner;
  if (!format.comments.empty()) attributes["comments"] = format.comments;
  if (const auto ratio = ParseRatio(format.frames_per_second)) {
    attributes["framesPerSecond"] = absl::StrCat(ratio->first, "/", ratio->second);
  }
  if (format.date) {
    attributes["capDate"] = absl::FormatTime("%Y:%m:%d %H:%M:%S", now, absl::UTCTimeZone());
    attributes["utcOffset"] = "0";
  }
  if (format.render_time) {
    image->metadata["renderSeconds"] = SecondsText(frame.progress().wall_duration());
    image->metadata["cpuSeconds"] = SecondsText(frame.progress().cpu_duration());
  }
}

std::vector<std::pair<std::string, std::string>> FormatOptions(const ImageFormat& format) {
  const ImageFormat usual;
  std::vector<std::pair<std::string, std::string>> options;
  const auto add = [&options](const char* option, const std::string& value) {
    options.emplace_back(option, value);
  };
  if (format.exr.type != usual.exr.type) add("--exr-type", ExrTypeName(format.exr.type));
  if (format.exr.compression != usual.exr.compression) {
    add("--exr-compression", ExrCompressionName(format.exr.compression));
  }
  if (format.exr.parts) add("--exr-parts", ExrPartsName(*format.exr.parts));
  if (format.exr.tile_size_px != 0) add("--exr-tiles", absl::StrCat(format.exr.tile_size_px));
  if (format.depth == ExrDepth::kPlane) add("--exr-depth", kPlaneDepth);
  if (!format.owner.empty()) add("--exr-owner", format.owner);
  if (!format.comments.empty()) add("--exr-comments", format.comments);
  if (!format.frames_per_second.empty()) add("--exr-fps", format.frames_per_second);
  if (format.date) add("--exr-date", "");
  if (format.render_time) add("--exr-render-time", "");
  return options;
}

}  // namespace sheaf::cli
