// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/synthetic_film.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/light/light_pass_accumulator.h"
#include "common/math/mix_bits.h"
#include "coordinator/core/frame/cell_errors.h"
#include "coordinator/core/frame/frame_merge.h"
#include "coordinator/core/frame/sample_rounds.h"

namespace sheaf::sim {
namespace {

using coordinator::CellGrid;
using coordinator::CellRound;
using coordinator::FrameMerge;
using coordinator::FrameSpec;

float Unit(uint64_t bits) { return static_cast<float>(bits & 0xffffff) * 0x1p-24f; }

uint64_t SeedOf(const std::string& frame_digest) {
  uint64_t seed = 0;
  for (const char c : frame_digest.substr(0, 16)) {
    seed = seed * 16 + static_cast<uint64_t>(c <= '9' ? c - '0' : c - 'a' + 10);
  }
  return seed;
}

std::string FieldOf(uint64_t seed) { return absl::StrCat("field ", seed); }

// The seed of samples that are made with a field of this digest.
uint64_t GuidedSeed(uint64_t seed, const std::string& field_sha256) {
  return field_sha256.empty() ? seed : MixBits(seed ^ SeedOf(field_sha256));
}

// The seed of a frame's true samples.
uint64_t TrueSeedOf(const FrameSpec& frame) {
  const uint64_t seed = SeedOf(frame.frame_digest);
  if (!NeedsTraining(frame.settings.techniques)) return seed;
  return GuidedSeed(seed, Sha256Hex(FieldOf(seed)));
}

FilmSample SampleOf(uint64_t seed, int32_t x, int32_t y, uint64_t index) {
  const uint64_t pixel = static_cast<uint64_t>(y) * 65536 + static_cast<uint64_t>(x);
  const uint64_t bits = MixBits(MixBits(MixBits(seed + 1) + pixel) + index);
  FilmSample sample;
  // Magnitudes far apart, so that another order of additions gives other bits, and more of them in
  // some pixels, so that cells get different numbers of samples.
  const float scale = (bits >> 60) < pixel % 3 ? 300.0f : 1.0f;
  sample.radiance = {Unit(bits) * scale, Unit(bits >> 8) * scale, Unit(bits >> 16)};
  sample.alpha = 1;
  sample.depth = 1 + Unit(bits >> 3);
  return sample;
}

FilmTile MakePart(uint64_t seed, const PixelRect& rect, SampleBlock block, const TileCells& cells) {
  FilmTile tile(rect, block);
  PixelAccumulator accumulator(&tile);
  for (const PixelRect& cell : RectsOf(rect, cells)) {
    for (int32_t y = cell.y0; y < cell.y1; ++y) {
      for (int32_t x = cell.x0; x < cell.x1; ++x) {
        accumulator.Begin(x, y);
        for (uint64_t i = block.first; i < block.End(); ++i) {
          accumulator.Add(i, SampleOf(seed, x, y, i));
        }
        accumulator.End();
      }
    }
  }
  return tile;
}

// Light passes: a splat on every pixel, and more on some.
FilmTile MakeLightPart(uint64_t seed, const PixelRect& window, SampleBlock block) {
  FilmTile tile(window, block);
  LightPassAccumulator film(&tile);
  for (uint64_t pass = block.first; pass < block.End(); ++pass) {
    for (int32_t y = window.y0; y < window.y1; ++y) {
      for (int32_t x = window.x0; x < window.x1; ++x) {
        const int32_t splat_count = 1 + x % 2;
        for (int32_t i = 0; i < splat_count; ++i) {
          const FilmSample sample = SampleOf(seed ^ 0x5157, x, y, pass * 2 + i);
          film.Add(x, y, sample.radiance, 0.5f, std::nullopt);
        }
      }
    }
    film.EndPass();
  }
  film.Finish();
  return tile;
}

FilmTile MakePartOf(uint64_t seed, const worker::Lease& lease) {
  return lease.kind == TaskKind::kLight ? MakeLightPart(seed, lease.tile, lease.block)
                                        : MakePart(seed, lease.tile, lease.block, lease.cells);
}

PartHeader HeaderOf(const worker::Lease& lease) {
  return {lease.frame_digest, NumericProfile(), {}, lease.cells, lease.kind};
}

std::string Encoded(uint64_t seed, const worker::Lease& lease) {
  if (lease.kind == TaskKind::kTraining) return FieldOf(seed);
  seed = GuidedSeed(seed, lease.field.sha256_hex);
  return EncodePart(MakePartOf(seed, lease), HeaderOf(lease));
}

// Adds samples [from, to) of a cell to the merge.
void AddSamples(const FrameSpec& frame, uint32_t cell, uint64_t from, uint64_t to,
                FrameMerge* merge) {
  const CellGrid& grid = merge->grid();
  const uint32_t tile = grid.TileOf(cell);
  const uint64_t mask = uint64_t{1} << (cell - grid.first_cell(tile));
  const TileCells cells = grid.CellsOf(tile, mask);
  for (const SampleBlock& block : CutSamples(from, to - from, uint64_t{1} << 40)) {
    FilmTile part = MakePart(TrueSeedOf(frame), grid.tiles()[tile], block, cells);
    const auto decoded =
        DecodePart(EncodePart(part, {frame.frame_digest, NumericProfile(), {}, cells}));
    SHEAF_CHECK(decoded.ok());
    merge->Insert(tile, {decoded->tile, mask});
  }
}

// Adds light passes [from, to) to the merge.
void AddPasses(const FrameSpec& frame, uint64_t from, uint64_t to, FrameMerge* merge) {
  const uint32_t tile = *merge->grid().light_tile();
  for (const SampleBlock& block : CutSamples(from, to - from, LightPassAccumulator::kPassesMax)) {
    merge->Insert(tile, {MakeLightPart(TrueSeedOf(frame), merge->grid().RectOf(tile), block)});
  }
}

std::string RenderAlone(const FrameSpec& frame, const coordinator::Partition& partition) {
  coordinator::MergeBudget budget(uint64_t{1} << 40);
  const bool in_rounds = frame.stop.IsActive();
  const uint64_t first = in_rounds
                             ? std::min(frame.settings.samples, frame.stop.first_round_samples)
                             : frame.settings.samples;
  CellGrid grid(frame, partition);
  std::vector<uint64_t> samples(grid.cells().size(), first);
  std::vector<uint64_t> have(samples.size(), 0);
  FrameMerge merge(frame, grid, samples, &budget);
  std::vector<CellRound> before;
  for (int round = 0; !samples.empty(); ++round) {
    for (uint32_t cell = 0; cell < samples.size(); ++cell) merge.Grow(cell, samples[cell]);
    for (uint32_t cell = 0; cell < samples.size(); ++cell) {
      if (have[cell] < samples[cell]) AddSamples(frame, cell, have[cell], samples[cell], &merge);
    }
    if (grid.light_tile()) {
      AddPasses(frame, std::ranges::max(have), std::ranges::max(samples), &merge);
    }
    merge.Refresh();
    SHEAF_CHECK(merge.AllDeveloped());
    have = samples;
    if (!in_rounds) break;
    const std::vector<ErrorSums> errors = EstimateCellErrors(merge.image(), grid);
    std::vector<CellRound> cells;
    for (size_t i = 0; i < have.size(); ++i) cells.push_back({have[i], errors[i]});
    samples = DecideRound(frame.stop, frame.settings.samples, round, cells, before, {}).samples;
    before = std::move(cells);
  }
  merge.AddLightLayer();
  return ImageDigest(merge.image());
}

}  // namespace

const std::string& TruePart(const worker::Lease& lease) {
  static auto& parts = *new std::map<std::string, std::string>();
  std::string& bytes = parts[absl::StrCat(
      lease.frame_digest, " ", lease.field.sha256_hex, " ", lease.tile.x0, " ", lease.tile.y0, " ",
      lease.tile.x1, " ", lease.tile.y1, " ", lease.block.first, " ", lease.block.count, " ",
      lease.cells.mask, " ", TaskKindName(lease.kind))];
  if (bytes.empty()) bytes = Encoded(SeedOf(lease.frame_digest), lease);
  return bytes;
}

std::string FalsePart(const worker::Lease& lease, uint64_t kind) {
  return Encoded(SeedOf(lease.frame_digest) + 1 + kind, lease);
}

std::string ImpossiblePart(const worker::Lease& lease) {
  if (lease.kind == TaskKind::kTraining) return "";
  FilmTile tile = MakePartOf(SeedOf(lease.frame_digest), lease);
  float* alpha = tile.channel(FilmChannel::kAlpha);
  std::for_each(alpha, alpha + tile.plane_size(), [](float& sum) { sum = 2 * sum + 1; });
  return EncodePart(tile, HeaderOf(lease));
}

const std::string& OneProcessImage(const FrameSpec& frame,
                                   const coordinator::Partition& partition) {
  static auto& images = *new std::map<std::string, std::string>();
  std::string& digest = images[absl::StrCat(
      frame.frame_digest, " ", frame.settings.samples, " ", frame.stop.target_error, " ",
      frame.stop.first_round_samples, " ", partition.tile_size_px, " ", partition.cell_size_px)];
  if (digest.empty()) digest = RenderAlone(frame, partition);
  return digest;
}

}  // namespace sheaf::sim
