// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/tile_cells.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"

namespace sheaf {
namespace {

// Copies the planes of the pixels common to both. The part's block lies in the whole's, or equals
// it.
class PixelCopy {
 public:
  PixelCopy(const FilmTile& from, const PixelRect& rect, FilmTile* to)
      : from_(from), rect_(rect), to_(to) {}

  void CopyAll() const {
    for (size_t i = 0; i < kFilmChannelCount; ++i) {
      const auto channel = static_cast<FilmChannel>(i);
      CopyPlane(from_.channel(channel), to_->channel(channel));
    }
    for (size_t i = 0; i < from_.mean_count(); ++i) {
      for (const size_t half : {size_t{0}, size_t{1}}) {
        CopyPlane(from_.mean(i, half), to_->mean(i, half));
      }
    }
    for (uint32_t slot = 0; slot < from_.replicate_count(); ++slot) {
      const uint32_t to_slot = from_.replicate_first() + slot - to_->replicate_first();
      for (size_t component = 0; component < kReplicateChannelCount; ++component) {
        CopyPlane(from_.replicate(slot, component), to_->replicate(to_slot, component));
      }
    }
    for (size_t i = 0; i < kIdKindCount; ++i) {
      const auto kind = static_cast<IdKind>(i);
      if (!from_.outputs().HasIds(kind)) continue;
      CopyPlane(from_.ids(kind).pixels.data(), to_->ids(kind).pixels.data());
      to_->ids(kind).names.insert(from_.ids(kind).names.begin(), from_.ids(kind).names.end());
    }
  }

 private:
  template <typename Value>
  void CopyPlane(const Value* from, Value* to) const {
    for (int32_t y = rect_.y0; y < rect_.y1; ++y) {
      std::copy_n(from + from_.rect().IndexOf(rect_.x0, y), rect_.Width(),
                  to + to_->rect().IndexOf(rect_.x0, y));
    }
  }

  const FilmTile& from_;
  const PixelRect rect_;
  FilmTile* to_;
};

}  // namespace

std::string WhyNoCells(const PixelRect& tile, const TileCells& cells) {
  if (cells.All()) return cells.mask == 0 ? "" : "cells without their size";
  if (cells.size_px < 0) return "cells of a negative size";
  const int64_t least = (int64_t{tile.Width()} / cells.size_px) * (tile.Height() / cells.size_px);
  const size_t count = least > kTileCellsMax ? 0 : CutTiles(tile, cells.size_px).size();
  if (count == 0 || count > kTileCellsMax) {
    return absl::StrCat("more than ", kTileCellsMax, " cells of ", cells.size_px, " px");
  }
  const uint64_t all = count == kTileCellsMax ? ~uint64_t{0} : (uint64_t{1} << count) - 1;
  if (cells.mask == 0 || (cells.mask & ~all) != 0) return "cells that it does not have";
  return cells.mask == all ? "all of its cells, one by one" : "";
}

std::vector<PixelRect> RectsOf(const PixelRect& tile, const TileCells& cells) {
  if (cells.All()) return {tile};
  const std::vector<PixelRect> all = CutTiles(tile, cells.size_px);
  std::vector<PixelRect> chosen;
  for (size_t i = 0; i < all.size(); ++i) {
    if ((cells.mask >> i & 1) != 0) chosen.push_back(all[i]);
  }
  return chosen;
}

FilmTile CutOut(const FilmTile& tile, const PixelRect& rect) {
  SHEAF_CHECK(tile.rect().Contains(rect));
  FilmTile pixels(rect, tile.block(), tile.outputs());
  PixelCopy(tile, rect, &pixels).CopyAll();
  return pixels;
}

void Paste(const FilmTile& pixels, FilmTile* tile) {
  SHEAF_CHECK(tile->rect().Contains(pixels.rect()) && pixels.outputs() == tile->outputs());
  SHEAF_CHECK(Contains(tile->block(), pixels.block()));
  PixelCopy(pixels, pixels.rect(), tile).CopyAll();
}

}  // namespace sheaf
