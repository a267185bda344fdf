// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/upkeep/lost_scenes.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/rpc/manifest_codec.h"

namespace sheaf::coordinator {
namespace {

constexpr absl::Duration kUpdateInterval = absl::Seconds(1);

}  // namespace

void LostScenes::Update() {
  if (SteadyTime::Now() < next_update_time_) return;
  next_update_time_ = SteadyTime::Now() + kUpdateInterval;
  bool changed = false;
  for (BlobDigest& digest : blobs_.TakeLost()) {
    changed = true;
    std::string hex = digest.sha256_hex;
    lost_.insert_or_assign(std::move(hex), std::move(digest));
  }
  changed |= std::erase_if(lost_, [&](const auto& blob) {
               return blobs_.PathOf(blob.second).ok();  // It was brought again.
             }) > 0;
  if (!changed) return;
  std::map<std::string, BlobDigest> scenes;
  {
    const MutexLock lock(&tables_.mutex);
    for (const auto& [id, job] : tables_.scheduler.jobs()) {
      if (job.phase != JobPhase::kLive) continue;
      for (const FrameRecord& frame : job.frames) {
        if (frame.phase == FrameRecord::Phase::kDelivered) continue;
        const FrameSpec spec = frame.Spec();
        scenes.emplace(spec.scene.sha256_hex, spec.scene);
      }
    }
  }
  std::map<std::string, std::string> lost;
  for (const auto& [hex, scene] : scenes) {
    if (std::string file = LostFileOf(scene); !file.empty()) lost[hex] = std::move(file);
  }
  if (lost.empty()) lost_.clear();  // No job needs them.
  {
    const MutexLock lock(&tables_.mutex);
    for (const auto& [hex, why] : lost) {
      if (tables_.scheduler.held_scenes().contains(hex)) continue;
      LogError(why);
      ++tables_.scheduler.counters().scenes_lost;
    }
    tables_.scheduler.HoldScenes(std::move(lost));
  }
  signals_.Changed();
}

std::string LostScenes::LostFileOf(const BlobDigest& scene) const {
  const auto text = [](const std::string& file, const BlobDigest& blob) {
    return absl::StrCat(file, " (blob ", blob.sha256_hex,
                        ") is damaged or lost in the coordinator's store; submit the scene again "
                        "to continue this job");
  };
  if (lost_.contains(scene.sha256_hex)) return text("the list of the scene's files", scene);
  const absl::StatusOr<std::string> bytes = blobs_.ReadChunk(scene, 0, kManifestBytesMax);
  if (!bytes.ok()) return text("the list of the scene's files", scene);
  const absl::StatusOr<Manifest> manifest = DecodeManifest(*bytes);
  if (!manifest.ok()) return "";  // A worker says so.
  for (const ManifestFile& file : manifest->files) {
    if (lost_.contains(file.digest.sha256_hex)) {
      return text(absl::StrCat("file ", file.name), file.digest);
    }
  }
  return "";
}

}  // namespace sheaf::coordinator
