// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/bundle/reproduction.h"

#include <string_view>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/printable.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/task_kind.h"
#include "coordinator/core/frame/part_check.h"
#include "worker/agent/render_failure.h"
#include "worker/agent/task_border.h"

namespace sheaf::cli {
namespace {

using coordinator::FailureKind;

// The end of a message that Printable has cut.
constexpr std::string_view kCut = "...";

FailureKind KindOf(worker::FailureKind kind) {
  switch (kind) {
    case worker::FailureKind::kReleased:
      return FailureKind::kReleased;
    case worker::FailureKind::kInfrastructure:
      return FailureKind::kInfrastructure;
    case worker::FailureKind::kScene:
      return FailureKind::kScene;
    case worker::FailureKind::kMemory:
      return FailureKind::kMemory;
    case worker::FailureKind::kInternal:
      break;
  }
  return FailureKind::kInternal;
}

Reproduction Failed(const Bundle& bundle, FailureKind kind, const absl::Status& status) {
  Reproduction result;
  result.ending = Ending::kFailedOtherwise;
  result.kind = kind;
  result.message = std::string(status.message());
  for (const v1::RecordedFailure& recorded : bundle.task().failures()) {
    if (recorded.kind() != coordinator::FailureKindName(kind)) continue;
    result.ending = Ending::kFailedAsRecorded;
    result.same_message |= IsSameMessage(recorded.message(), result.message);
  }
  return result;
}

// Why the coordinator would refuse the result; empty if it would not.
std::string WhyRefused(const worker::Lease& lease, const std::string& bytes) {
  if (lease.kind == TaskKind::kTraining) {
    if (!bytes.empty() && bytes.size() <= kGuidingFieldBytesMax) return "";
    return absl::StrCat("a guiding field has 1 to ", kGuidingFieldBytesMax, " bytes, not ",
                        bytes.size());
  }
  const absl::StatusOr<DecodedPart> part = DecodePart(bytes, lease.tile.PixelCount());
  if (!part.ok()) return std::string(part.status().message());
  const bool fits = part->tile.rect() == lease.tile && part->tile.block() == lease.block;
  if (!fits) return "the part has another tile or other samples than its task";
  return coordinator::WhyNotOfSettings(part->tile, lease.settings, lease.kind);
}

// The text with each number replaced by one sign.
std::string WithoutNumbers(std::string_view text) {
  std::string result;
  bool in_number = false;
  for (const char c : text) {
    const bool is_digit = absl::ascii_isdigit(static_cast<unsigned char>(c));
    const bool goes_on = in_number && (is_digit || c == '.');
    if (!is_digit && !goes_on) result += c;
    if (is_digit && !in_number) result += '#';
    in_number = is_digit || goes_on;
  }
  return result;
}

absl::StatusOr<worker::RenderedPart> Render(const Bundle& bundle, const worker::OpenScene& scene,
                                            const std::stop_token& stop) {
  const absl::StatusOr<std::string> field = bundle.ReadField();
  if (!field.ok()) return field.status();
  absl::StatusOr<worker::RenderedPart> part;
  const absl::Status in_memory = worker::CatchOutOfMemory("rendering", [&] {
    const absl::Status set = field->empty() ? absl::OkStatus() : scene.SetField(*field, stop);
    if (set.ok()) {
      part = scene.Render(bundle.lease(), stop);
    } else {
      part = set;
    }
  });
  if (!in_memory.ok()) return in_memory;
  return part;
}

}  // namespace

const char* EndingName(Ending ending) {
  switch (ending) {
    case Ending::kRendered:
      return "rendered";
    case Ending::kFailedAsRecorded:
      return "failed as recorded";
    case Ending::kFailedOtherwise:
      break;
  }
  return "failed otherwise";
}

bool IsSameMessage(const std::string& recorded, const std::string& message) {
  std::string_view expected = recorded;
  const bool is_cut = expected.ends_with(kCut);
  if (is_cut) expected.remove_suffix(kCut.size());
  const std::string found = WithoutNumbers(Printable(message));
  if (!is_cut) return WithoutNumbers(Printable(expected)) == found;
  // It may have been cut inside a number.
  while (!expected.empty() && absl::ascii_isdigit(static_cast<unsigned char>(expected.back()))) {
    expected.remove_suffix(1);
  }
  return found.starts_with(WithoutNumbers(Printable(expected)));
}

absl::StatusOr<Reproduction> Reproduce(const Bundle& bundle, ContentCache* cache,
                                       worker::SceneOpener* scenes,
                                       const worker::SceneLimits& limits, std::stop_token stop) {
  const absl::StatusOr<ContentLease> files =
      cache->Acquire(bundle.manifest().files, bundle.Fetcher(), stop);
  if (absl::IsCancelled(files.status())) return files.status();
  if (!files.ok()) {
    return Failed(bundle, FailureKind::kInfrastructure, files.status());
  }
  const worker::OpenResult opened = scenes->Open(
      {bundle.manifest().main_file, files->local_paths(), bundle.lease().settings, limits}, stop);
  if (stop.stop_requested()) return absl::CancelledError("interrupted");
  if (opened.scene == nullptr) {
    return Failed(bundle, KindOf(opened.failure_kind), opened.status);
  }
  absl::StatusOr<worker::RenderedPart> part = Render(bundle, *opened.scene, stop);
  if (stop.stop_requested()) return absl::CancelledError("interrupted");
  if (!part.ok()) {
    return Failed(bundle, KindOf(worker::RenderFailureKind(part.status())), part.status());
  }
  const std::string why = WhyRefused(bundle.lease(), part->exr_bytes);
  if (!why.empty())
    return Failed(bundle, FailureKind::kInvalid, absl::InternalError("invalid result: " + why));
  Reproduction result;
  result.part_sha256 = Sha256Hex(part->exr_bytes);
  result.part = *std::move(part);
  return result;
}

}  // namespace sheaf::cli
