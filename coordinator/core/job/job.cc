// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/job.h"

#include "absl/strings/str_cat.h"
#include "coordinator/core/job/cell_grid.h"

namespace sheaf::coordinator {
namespace {

constexpr char kSceneFailure[] = " cannot be rendered: ";

}  // namespace

const char* FailureKindName(FailureKind kind) {
  switch (kind) {
    case FailureKind::kReleased:
      return "released";
    case FailureKind::kInfrastructure:
      return "infrastructure";
    case FailureKind::kScene:
      return "scene";
    case FailureKind::kMemory:
      return "memory";
    case FailureKind::kInternal:
      return "internal";
    case FailureKind::kLost:
      return "lost";
    case FailureKind::kLoading:
      return "loading";
    case FailureKind::kInvalid:
      return "invalid";
  }
  return "unknown";
}

const char* FailureKindText(FailureKind kind) {
  switch (kind) {
    case FailureKind::kReleased:
      return "a stop";
    case FailureKind::kInfrastructure:
      return "trouble with its disk or network";
    case FailureKind::kScene:
      return "an error in the scene";
    case FailureKind::kMemory:
      return "lack of memory";
    case FailureKind::kInternal:
      return "a crash";
    case FailureKind::kLost:
    case FailureKind::kLoading:
      return "its disappearance";
    case FailureKind::kInvalid:
      return "an invalid result";
  }
  return "an unknown failure";
}

bool IsOwnFailure(FailureKind kind) {
  return kind == FailureKind::kInternal || kind == FailureKind::kMemory ||
         kind == FailureKind::kInvalid;
}

int64_t PathsPerLightPass(const FrameSettings& settings) {
  return int64_t{settings.width_px} * settings.height_px;
}

uint64_t PathsPerSample(const FrameSettings& settings) {
  const int64_t light = HasLightPasses(settings) ? PathsPerLightPass(settings) : 0;
  return static_cast<uint64_t>(settings.window.PixelCount() + light);
}

std::string SceneFailureText(int32_t frame_number, const std::string& message) {
  return absl::StrCat("frame ", frame_number, kSceneFailure, message);
}

bool IsSceneFailure(std::string_view failure) {
  return failure.starts_with("frame ") && failure.find(kSceneFailure) != std::string_view::npos;
}

std::string WorkText(TaskKind kind, const PixelRect& tile, SampleBlock block) {
  if (kind == TaskKind::kTraining) return TaskKindName(kind);
  const std::string range = absl::StrCat("[", block.first, ", ", block.End(), ")");
  if (kind == TaskKind::kLight) return absl::StrCat("light passes ", range);
  return absl::StrCat("tile [", tile.x0, ", ", tile.x1, ") x [", tile.y0, ", ", tile.y1,
                      "), samples ", range);
}

}  // namespace sheaf::coordinator
