// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/frame_loader.h"

#include <grpcpp/client_context.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/content/chunk_codec.h"
#include "common/film/exr/exr_codec.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/manifest_codec.h"
#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "worker/render/scene/memory_estimate.h"
#include "worker/render/tile_pass.h"

namespace sheaf::worker {
namespace {

LoadResult Failed(FailureKind kind, const absl::Status& status) { return {nullptr, status, kind}; }

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
  stats->broken_majorants += more.broken_majorants;
  stats->raised_majorants += more.raised_majorants;
  stats->cpu_seconds += more.cpu_seconds;
  stats->non_finite.insert(stats->non_finite.end(), more.non_finite.begin(), more.non_finite.end());
}

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

// A compiled frame together with the files of its textures.
class FrameScene : public LoadedScene {
 public:
  FrameScene(const ContentCache* cache, ContentLease files, std::unique_ptr<TableFileSource> source,
             render::CompiledScenePtr scene)
      : cache_(cache),
        files_(std::move(files)),
        source_(std::move(source)),
        scene_(std::move(scene)) {}

  uint64_t memory_bytes() const override { return render::MemoryBytesOf(*scene_); }

  absl::StatusOr<FinishedPart> Render(const Lease& lease, std::stop_token stop) const override {
    // Texture tiles are read from the files on demand, so the files are checked before the task and
    // after it: changes in between may affect the image.
    if (absl::Status status = cache_->CheckUnchanged(files_); !status.ok()) return status;
    render::RenderStats stats;
    absl::StatusOr<FilmTile> tile = RenderCells(lease, stop, &stats);
    if (!tile.ok()) return tile.status();
    if (absl::Status status = cache_->CheckUnchanged(files_); !status.ok()) return status;
    for (const PixelAccumulator::NonFinite& sample : stats.non_finite) {
      LogError(absl::StrCat(lease.frame_name, ": sample ", sample.sample_index, " of pixel ",
                            sample.x, ",", sample.y, " is not finite"));
    }
    if (stats.broken_nestings > 0) {
      LogWarning(absl::StrCat(
          lease.frame_name, ": ", stats.broken_at, stats.broken_at.empty() ? "" : ": ",
          stats.broken_nestings,
          " times a path met a surface in another medium than the surface has on that ",
          "side; it continued in the medium of the other side, as in pbrt-v4, or ended. ",
          "Close the shapes that bound media, and name in each MediumInterface the inside medium, "
          "then the outside one (where the normal points)"));
    }
    if (stats.raised_majorants > 0) {
      LogWarning(absl::StrCat(lease.frame_name, ": densities of a medium exceed their bounds; a ",
                              "block was rendered ", stats.raised_majorants,
                              " more times, with higher bounds"));
    }
    if (stats.broken_majorants > 0) {
      LogError(absl::StrCat(lease.frame_name, ": ", stats.broken_majorants,
                            " densities of a medium exceed their bounds: the image is biased"));
    }
    if (stats.long_walks > 0) {
      LogWarning(absl::StrCat(lease.frame_name, ": ", stats.long_walks,
                              " paths ended because they scattered too often beneath a surface, "
                              "which darkens it: raise sigma_a or lower sigma_s"));
    }
    FinishedPart part;
    part.lease_id = lease.lease_id;
    part.frame_digest = lease.frame_digest;
    part.tile = lease.tile;
    part.block = lease.block;
    part.cells = lease.cells;
    part.exr_bytes = EncodePart(
        *tile, {lease.frame_digest, NumericProfile(), lease.settings.lattice, lease.cells});
    part.digest = {Sha256Hex(part.exr_bytes), part.exr_bytes.size()};
    part.ray_count = stats.rays;
    part.cpu_seconds = stats.cpu_seconds;
    part.token = lease.token;
    return part;
  }

 private:
  // The pixels of the lease, as one tile; other pixels are empty.
  absl::StatusOr<FilmTile> RenderCells(const Lease& lease, const std::stop_token& stop,
                                       render::RenderStats* stats) const {
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

  const ContentCache* const cache_;
  ContentLease files_;  // Pins the files for the lifetime of the scene.
  std::unique_ptr<TableFileSource> source_;
  render::CompiledScenePtr scene_;
};

}  // namespace

FrameLoader::FrameLoader(const std::shared_ptr<grpc::Channel>& channel, ContentCache* cache,
                         FrameLoaderOptions options)
    : stub_(v1::ContentService::NewStub(channel)), cache_(cache), options_(options) {}

ContentCache::Fetch FrameLoader::FetchFromCoordinator(std::stop_token stop) const {
  return [this, stop](const BlobDigest& digest, uint64_t offset_bytes,
                      const ContentCache::Append& append) {
    grpc::ClientContext context;
    SetDeadline(&context, kStreamDeadline);
    const std::stop_callback cancel(stop, [&context] { context.TryCancel(); });
    v1::ReadBlobRequest request;
    request.mutable_digest()->set_sha256_hex(digest.sha256_hex);
    request.mutable_digest()->set_size_bytes(digest.size_bytes);
    request.set_offset_bytes(offset_bytes);
    const std::unique_ptr<grpc::ClientReader<v1::ReadBlobResponse>> reader =
        stub_->ReadBlob(&context, request);
    absl::Status appended;
    v1::ReadBlobResponse response;
    while (appended.ok() && reader->Read(&response)) {
      const absl::StatusOr<std::string> bytes =
          DecompressChunk(response.zstd_chunk(), kBlobChunkBytesMax);
      appended = bytes.ok() ? append(*bytes) : absl::DataLossError(bytes.status().message());
    }
    if (!appended.ok()) context.TryCancel();
    const absl::Status finished = FromGrpcStatus(reader->Finish());
    return appended.ok() ? finished : appended;
  };
}

MemoryRoom FrameLoader::RoomForScene() const {
  const MemoryRoom room = FindMemoryRoom();
  if (room.bytes < options_.scene_memory_bytes_max) {
    return {room.bytes, absl::StrCat("the remainder of ", room.limit)};
  }
  return {options_.scene_memory_bytes_max,
          absl::StrCat("this worker's limit for scenes (--scene-memory-max ",
                       FormatMemory(options_.scene_memory_bytes_max), ")")};
}

LoadResult FrameLoader::Load(const Lease& lease, std::stop_token stop) {
  const ContentCache::Fetch fetch = FetchFromCoordinator(stop);
  absl::StatusOr<ContentLease> manifest_file =
      cache_->Acquire({{"scene.manifest", lease.scene}}, fetch, stop);
  if (!manifest_file.ok()) return Failed(FailureKind::kInfrastructure, manifest_file.status());
  const absl::StatusOr<std::string> manifest_bytes =
      ReadWholeFile(manifest_file->local_paths().at("scene.manifest"), kManifestBytesMax);
  if (!manifest_bytes.ok()) return Failed(FailureKind::kInfrastructure, manifest_bytes.status());
  if (Sha256Hex(*manifest_bytes) != lease.scene.sha256_hex) {
    return Failed(FailureKind::kInfrastructure,
                  absl::DataLossError("the scene's manifest was altered while it was read"));
  }
  const absl::StatusOr<Manifest> manifest = DecodeManifest(*manifest_bytes);
  if (!manifest.ok()) return Failed(FailureKind::kScene, manifest.status());
  absl::StatusOr<ContentLease> files = cache_->Acquire(manifest->files, fetch, stop);
  if (!files.ok()) return Failed(FailureKind::kInfrastructure, files.status());

  auto source = std::make_unique<TableFileSource>(files->local_paths());
  const MemoryRoom room = RoomForScene();
  SceneReaderLimits reader_limits;
  reader_limits.memory_bytes_max = room.bytes;
  reader_limits.memory_limit = room.limit;
  absl::StatusOr<ReadSceneResult> read = ReadScene(manifest->main_file, *source, reader_limits);
  if (!read.ok()) return Failed(KindOf(read.status()), read.status());
  if (stop.stop_requested()) {
    return Failed(FailureKind::kReleased, absl::CancelledError("stopped while its scene was read"));
  }
  const absl::Status fits = CheckEstimate(read->scene, *source, RoomForScene());
  if (!fits.ok()) return Failed(FailureKind::kMemory, fits);
  render::CompileLimits limits;
  limits.texture_cache_bytes_max = options_.texture_memory_bytes_max;
  limits.build_threads = options_.build_threads;
  absl::StatusOr<render::CompiledScenePtr> compiled =
      render::CompileScene(std::move(read->scene), lease.settings, *source, limits);
  if (!compiled.ok()) return Failed(KindOf(compiled.status()), compiled.status());
  const uint64_t memory_bytes = render::MemoryBytesOf(**compiled);
  if (memory_bytes > options_.scene_memory_bytes_max) {
    return Failed(
        FailureKind::kMemory,
        absl::ResourceExhaustedError(absl::StrCat(
            manifest->main_file, ": the compiled scene has ", memory_bytes, " bytes, the limit is ",
            options_.scene_memory_bytes_max, "; raise it (--scene-memory-max)")));
  }
  LogInfo(absl::StrCat(lease.frame_name, ": ", manifest->main_file, " is ready, ",
                       memory_bytes >> 20, " MiB"));
  return {std::make_unique<FrameScene>(cache_, *std::move(files), std::move(source),
                                       *std::move(compiled)),
          absl::OkStatus(), FailureKind::kInternal};
}

}  // namespace sheaf::worker
