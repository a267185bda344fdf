// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/direct_scenes.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/load_phases.h"
#include "common/base/log.h"
#include "common/base/mutex.h"
#include "common/film/exr/exr_codec.h"
#include "common/scene/file_source.h"
#include "common/scene/reader/scene_file_reader.h"
#include "common/scene/settings/path_shares.h"
#include "worker/render/eyes/eye_passes.h"
#include "worker/render/guiding_training.h"
#include "worker/render/light_pass.h"
#include "worker/render/plan/path_limits.h"
#include "worker/render/scene/memory_estimate.h"
#include "worker/render/scene/scene_memory.h"
#include "worker/render/tile_pass.h"
#include "worker/sandbox/light_pass_gate.h"

namespace sheaf::worker {
namespace {

OpenResult Failed(FailureKind kind, const absl::Status& status) { return {nullptr, status, kind}; }

// Classifies the cause of an error while reading or compiling a scene.
FailureKind KindOf(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kUnimplemented:
      return FailureKind::kScene;
    case absl::StatusCode::kResourceExhausted:
      return FailureKind::kMemory;
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kDataLoss:
    case absl::StatusCode::kPermissionDenied:
      return FailureKind::kInfrastructure;
    default:
      return FailureKind::kInternal;
  }
}

void AddStats(const render::RenderStats& more, render::RenderStats* stats) {
  stats->samples += more.samples;
  stats->rays += more.rays;
  stats->shadow_rays += more.shadow_rays;
  stats->broken_nestings += more.broken_nestings;
  if (stats->broken_at.empty()) stats->broken_at = more.broken_at;
  stats->long_walks += more.long_walks;
  stats->long_segments += more.long_segments;
  stats->grazing_merges += more.grazing_merges;
  stats->chains += more.chains;
  stats->chain_trials += more.chain_trials;
  stats->capped_chains += more.capped_chains;
  if (stats->capped_at.empty()) stats->capped_at = more.capped_at;
  stats->broken_majorants += more.broken_majorants;
  stats->raised_majorants += more.raised_majorants;
  stats->volume_pages += more.volume_pages;
  stats->volume_bytes += more.volume_bytes;
  stats->volume_waits += more.volume_waits;
  stats->cpu_seconds += more.cpu_seconds;
  stats->non_finite.insert(stats->non_finite.end(), more.non_finite.begin(), more.non_finite.end());
}

// The files of a scene, some of which are fetched when they are read.
class SceneSource : public TableFileSource {
 public:
  explicit SceneSource(const SceneInputs& inputs)
      : TableFileSource(inputs.local_paths), inputs_(inputs) {}
  absl::StatusOr<volume::FileBytes> OpenPart(const std::string& canonical_name) override {
    // All files of a bundle are there.
    if (!inputs_.open_on_demand || inputs_.local_paths.contains(canonical_name)) {
      return TableFileSource::OpenPart(canonical_name);
    }
    return inputs_.open_on_demand(canonical_name, {});
  }

 private:
  const SceneInputs inputs_;
};

// Checks that the memory for compiling the scene is available.
absl::Status CheckEstimate(const SceneDescription& scene, FileSource& files,
                           const MemoryRoom& room) {
  const render::MemoryEstimate estimate = render::EstimateMemory(scene, files);
  if (estimate.TotalBytes() <= room.bytes) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat(
      FormatLocation(scene, estimate.largest), ": the scene takes about ",
      render::FormatMemoryEstimate(estimate), ", of which ", FormatMemory(estimate.largest_bytes),
      " for this shape; available are ", FormatMemory(room.bytes), ", ", room.limit,
      "; make it smaller (fewer levels, coarser meshes), or render it on a machine with more "
      "memory"));
}

void LogStats(const std::string& frame_name, TaskKind kind, const render::RenderStats& stats) {
  for (const PixelAccumulator::NonFinite& sample : stats.non_finite) {
    LogError(absl::StrCat(
        frame_name, ": ", kind == TaskKind::kLight ? "a splat of light pass " : "sample ",
        sample.sample_index, " of pixel ", sample.x, ",", sample.y, " is not finite"));
  }
  if (stats.broken_nestings > 0) {
    LogWarning(absl::StrCat(
        frame_name, ": ", stats.broken_at, stats.broken_at.empty() ? "" : ": ",
        stats.broken_nestings,
        " times a path met a surface in another medium than the surface has on that ",
        "side; it continued in the medium of the other side, as in pbrt-v4, or ended. ",
        "Close the shapes that bound media, and name in each MediumInterface the inside medium, "
        "then the outside one (where the normal points)"));
  }
  if (stats.raised_majorants > 0) {
    LogWarning(absl::StrCat(frame_name, ": densities of a medium exceed their bounds; a ",
                            "block was rendered ", stats.raised_majorants,
                            " more times, with higher bounds"));
  }
  if (stats.broken_majorants > 0) {
    LogError(absl::StrCat(frame_name, ": ", stats.broken_majorants,
                          " densities of a medium exceed their bounds: the image is biased"));
  }
  if (stats.grazing_merges > 0) {
    LogWarning(absl::StrCat(frame_name, ": ", stats.grazing_merges,
                            " merges of light paths that graze a surface were dropped"));
  }
  if (stats.capped_chains > 0) {
    LogWarning(absl::StrCat(frame_name, ": ", stats.capped_at, ": ", stats.capped_chains, " of ",
                            stats.chains, " chains from this lamp were dropped, because they are ",
                            "found too rarely: the image is darker than it should be; remove "
                            "chains from the techniques"));
  }
  if (stats.long_walks > 0) {
    LogWarning(absl::StrCat(frame_name, ": ", stats.long_walks,
                            " paths ended because they scattered too often beneath a surface, "
                            "which darkens it: raise sigma_a or lower sigma_s"));
  }
  if (stats.long_segments > 0) {
    LogWarning(absl::StrCat(frame_name, ": ", stats.long_segments, " paths and shadow rays ended ",
                            "because they passed through more than ", render::kNullCrossingsMax,
                            " cut-outs and interfaces, which darkens what is behind: use fewer"));
  }
}

// The part of the memory that is free beside the scene that its light passes may take together; the
// rest is for their encoding, and for tiles.
constexpr uint64_t kLightPassShare = 2;

// A compiled scene with the table of its textures' files.
class DirectScene : public OpenScene {
 public:
  // room_bytes: the memory that is free beside the scene. training_threads: at least 1.
  DirectScene(std::unique_ptr<TableFileSource> source, render::CompiledScenePtr scene,
              uint64_t room_bytes, uint32_t training_threads, DirectScenes::MemoryWatch watch,
              std::shared_ptr<PageTotals> totals)
      : source_(std::move(source)),
        scene_(std::move(scene)),
        totals_(std::move(totals)),
        training_threads_(training_threads),
        watch_(std::move(watch)),
        light_passes_(room_bytes / kLightPassShare) {}

  uint64_t memory_bytes() const override { return render::MemoryBytesOf(*scene_); }

  absl::Status SetField(std::string_view field, std::stop_token /*stop*/) const override {
    return render::SetGuiding(*scene_, field);
  }

  absl::StatusOr<RenderedPart> Render(const Lease& lease, std::stop_token stop) const override {
    absl::StatusOr<RenderedPart> part = RenderPart(lease, stop);
    if (part.ok()) TellWatch();
    if (part.ok()) SetPages(&*part);
    return part;
  }

 private:
  void TellWatch() const {
    if (!watch_) return;
    render::SceneMemory memory = render::MemoryOf(*scene_);
    memory.light_pass_bytes = light_passes_.bytes();
    watch_(memory);
  }
  // Figures of the pages that were used since the last part.
  void SetPages(RenderedPart* part) const {
    const MutexLock lock(&mutex_);
    const render::ScenePages pages = render::PagesOf(*scene_);
    part->pages = pages.counts - std::exchange(taken_pages_, pages.counts);
    part->page_bytes = pages.resident_bytes;
    totals_->Add(*part);
  }
  absl::StatusOr<RenderedPart> RenderPart(const Lease& lease, const std::stop_token& stop) const {
    const bool trains = lease.kind == TaskKind::kTraining;
    const PhaseTimer timer(trains ? LoadPhase::kTraining : LoadPhase::kSamples,
                           trains ? PhaseCpu::kProcess : PhaseCpu::kThread);
    render::RenderStats stats;
    if (trains) {
      absl::StatusOr<std::string> field =
          render::TrainGuiding(*scene_, training_threads_, stop, &stats);
      if (!field.ok()) return field.status();
      if (absl::Status volumes = render::CheckVolumes(*scene_); !volumes.ok()) return volumes;
      LogStats(lease.frame_name, lease.kind, stats);
      return RenderedPart{*std::move(field), stats.rays, stats.cpu_seconds};
    }
    const absl::StatusOr<FilmTile> tile = RenderCells(lease, stop, &stats);
    if (!tile.ok()) return tile.status();
    if (absl::Status volumes = render::CheckVolumes(*scene_); !volumes.ok()) return volumes;
    LogStats(lease.frame_name, lease.kind, stats);
    return RenderedPart{EncodePart(*tile, {lease.frame_digest, NumericProfile(),
                                           lease.settings.lattice, lease.cells, lease.kind}),
                        stats.rays, stats.cpu_seconds};
  }

  // The pixels of the lease, as one tile; other pixels are empty.
  absl::StatusOr<FilmTile> RenderCells(const Lease& lease, const std::stop_token& stop,
                                       render::RenderStats* stats) const {
    if (lease.kind == TaskKind::kLight) {
      const absl::StatusOr<LightPassGate::Pass> pass = light_passes_.Enter(
          render::LightPassMemoryBytes(lease.tile, lease.block, LightOutputsOf(lease.settings)),
          stop);
      if (!pass.ok()) return pass.status();
      TellWatch();
      return render::RenderLightPass(*scene_, lease.tile, lease.block, stop, stats);
    }
    if (HasOneTile(lease.settings)) {
      const absl::StatusOr<LightPassGate::Pass> pass = light_passes_.Enter(
          render::EyePassMemoryBytes(lease.tile.PixelCount(), lease.block), stop);
      if (!pass.ok()) return pass.status();
      return render::RenderTilePass(*scene_, lease.tile, lease.block, stop, stats);
    }
    if (lease.cells.All()) {
      return render::RenderTilePass(*scene_, lease.tile, lease.block, stop, stats);
    }
    FilmTile tile(lease.tile, lease.block, lease.settings.outputs);
    for (const PixelRect& rect : RectsOf(lease.tile, lease.cells)) {
      render::RenderStats of_cell;
      const absl::StatusOr<FilmTile> cell =
          render::RenderTilePass(*scene_, rect, lease.block, stop, &of_cell);
      if (!cell.ok()) return cell.status();
      Paste(*cell, &tile);
      AddStats(of_cell, stats);
    }
    return tile;
  }

  std::unique_ptr<TableFileSource> source_;
  render::CompiledScenePtr scene_;
  const std::shared_ptr<PageTotals> totals_;
  const uint32_t training_threads_;
  const DirectScenes::MemoryWatch watch_;
  mutable LightPassGate light_passes_;
  mutable Mutex mutex_;
  mutable volume::PageCounts taken_pages_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace

MemoryRoom DirectScenes::RoomForScene(const SceneLimits& limits) const {
  const MemoryRoom room = room_now_();
  if (room.bytes < limits.scene_memory_bytes_max) {
    return {room.bytes, absl::StrCat("the remainder of ", room.limit)};
  }
  return {limits.scene_memory_bytes_max,
          absl::StrCat("this worker's limit for scenes (--scene-memory-max ",
                       FormatMemory(limits.scene_memory_bytes_max), ")")};
}

void DirectScenes::Expect(std::string manifest_sha256_hex, SceneDescription description) {
  const MutexLock lock(&mutex_);
  expected_ = {std::move(manifest_sha256_hex), std::move(description)};
}

absl::StatusOr<SceneDescription> DirectScenes::DescriptionOf(const SceneInputs& inputs,
                                                             FileSource& source) {
  {
    const MutexLock lock(&mutex_);
    if (expected_ && expected_->manifest_sha256_hex == inputs.manifest_sha256_hex) {
      SceneDescription description = std::move(expected_->description);
      expected_.reset();
      return description;
    }
  }
  const MemoryRoom room = RoomForScene(inputs.limits);
  SceneReaderLimits limits;
  limits.memory_bytes_max = room.bytes;
  limits.memory_limit = room.limit;
  absl::StatusOr<ReadSceneResult> read = ReadSceneByName(inputs.main_file, source, limits);
  if (!read.ok()) return read.status();
  return std::move(read->scene);
}

OpenResult DirectScenes::Open(const SceneInputs& inputs, std::stop_token stop) {
  auto source = std::make_unique<SceneSource>(inputs);
  const SceneLimits& scene_limits = inputs.limits;
  absl::StatusOr<SceneDescription> description = DescriptionOf(inputs, *source);
  if (!description.ok()) return Failed(KindOf(description.status()), description.status());
  if (stop.stop_requested()) {
    return Failed(FailureKind::kReleased, absl::CancelledError("stopped while its scene was read"));
  }
  const absl::Status fits = CheckEstimate(*description, *source, RoomForScene(scene_limits));
  if (!fits.ok()) return Failed(FailureKind::kMemory, fits);
  render::CompileLimits limits;
  limits.texture_cache_bytes_max = scene_limits.texture_memory_bytes_max;
  limits.volume_memory_bytes_max = scene_limits.volume_memory_bytes_max;
  limits.build_threads = scene_limits.build_threads;
  absl::StatusOr<render::CompiledScenePtr> compiled =
      render::CompileScene(*std::move(description), inputs.settings, *source, limits);
  if (!compiled.ok()) return Failed(KindOf(compiled.status()), compiled.status());
  const uint64_t memory_bytes = render::MemoryBytesOf(**compiled);
  if (memory_bytes > scene_limits.scene_memory_bytes_max) {
    return Failed(
        FailureKind::kMemory,
        absl::ResourceExhaustedError(absl::StrCat(
            inputs.main_file, ": the compiled scene has ", memory_bytes, " bytes, the limit is ",
            scene_limits.scene_memory_bytes_max, "; raise it (--scene-memory-max)")));
  }
  return {std::make_unique<DirectScene>(std::move(source), *std::move(compiled), room_now_().bytes,
                                        std::max(1u, scene_limits.render_threads), watch_, totals_),
          absl::OkStatus(), FailureKind::kInternal};
}

}  // namespace sheaf::worker
