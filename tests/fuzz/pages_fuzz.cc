// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the reader of page files as they are, and with the digests that they
// should have, so that changes reach what is behind these; and looks up values of accepted grids.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>

#include "common/base/digest.h"
#include "common/volume/page_format.h"
#include "common/volume/volume_pages.h"
#include "tests/fuzz/volume_lookups.h"

namespace sheaf {
namespace {

using volume::PageEntry;
using volume::PageGridHead;
using volume::PageTrailer;

constexpr uint64_t kPagesBytesMax = uint64_t{1} << 16;  // Small, so that pages are evicted.

// The `count` bytes at `at`; null if the file has fewer.
char* BytesAt(std::string* file, uint64_t at, uint64_t count) {
  return at <= file->size() && file->size() - at >= count ? file->data() + at : nullptr;
}

// Sets the digests of the pages that entries name, as far as the index can be followed.
void SignPages(uint64_t at, uint32_t grid_count, std::string* file) {
  for (uint32_t i = 0; i < std::min(grid_count, 8u); ++i) {
    PageGridHead head;
    const char* from = BytesAt(file, at, sizeof(head));
    if (from == nullptr) return;
    std::memcpy(static_cast<void*>(&head), from, sizeof(head));
    at += sizeof(head) + uint64_t{head.root_tile_count} * sizeof(volume::PageRootTile) +
          uint64_t{head.region_count} * sizeof(volume::PageRegion);
    for (uint32_t k = 0; k < head.page_count; ++k, at += sizeof(PageEntry)) {
      PageEntry entry;
      char* place = BytesAt(file, at, sizeof(entry));
      if (place == nullptr) return;
      std::memcpy(static_cast<void*>(&entry), place, sizeof(entry));
      const char* page = BytesAt(file, entry.offset_bytes, entry.packed_bytes);
      if (page == nullptr) continue;
      const std::string digest = BytesOfHex(Sha256Hex({page, entry.packed_bytes}));
      std::memcpy(place + offsetof(PageEntry, sha256), digest.data(), entry.sha256.size());
    }
  }
}

// The file with the magic numbers and digests of its bytes.
std::string Signed(std::string_view bytes) {
  std::string file(bytes);
  PageTrailer trailer;
  if (file.size() < sizeof(trailer)) return file;
  const uint64_t end = file.size() - sizeof(trailer);
  std::memcpy(static_cast<void*>(&trailer), &file[end], sizeof(trailer));
  std::memcpy(file.data(), &volume::kPageMagic, sizeof(volume::kPageMagic));
  trailer.magic = volume::kPageMagic;
  trailer.version = volume::kPageVersion;
  trailer.index_offset_bytes = std::min(trailer.index_offset_bytes, end);
  trailer.index_bytes = end - trailer.index_offset_bytes;
  SignPages(trailer.index_offset_bytes, trailer.grid_count, &file);
  const std::string digest =
      Sha256Hex(std::string_view(file).substr(trailer.index_offset_bytes, trailer.index_bytes));
  std::copy(digest.begin(), digest.end(), trailer.index_sha256.begin());
  std::memcpy(&file[end], &trailer, sizeof(trailer));
  return file;
}

void ReadPages(std::string_view bytes) {
  const testing::MemoryFile file(bytes);
  const auto entries = ListVolumeFile("a", file.Path(), testing::kVolumeLimits);
  if (!entries.ok()) return;
  for (const VolumeFileEntry& entry : *entries) {
    const auto pages = std::make_shared<volume::VolumePages>(kPagesBytesMax);
    const auto grid =
        ReadVolumeGrid("a", file.Path(), entry.name, testing::kVolumeLimits, 1, pages);
    if (!grid.ok() || !grid->is_paged()) continue;
    VolumeGrid::Cursor cursor(*grid);
    uint64_t state = 1;
    bool is_inside = true;
    for (int i = 0; i < 200; ++i) {
      Vec3d p;
      for (size_t a = 0; a < 3; ++a) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        const double u = static_cast<double>(state >> 33) * 0x1p-31;
        const double lo = grid->box().lo[a] - 9, hi = grid->box().hi[a] + 9;
        p[a] = i % 2 == 0 ? lo + u * 32 : lo + u * (hi - lo);
      }
      const float v = grid->At(p, &cursor);
      is_inside &= v >= grid->info().values.min && v <= grid->info().values.max;
    }
    // A page that cannot be read is an error, and zero until then.
    SHEAF_CHECK(is_inside || !pages->status().ok());
  }
}

}  // namespace

SHEAF_FUZZ_TARGET(pages) {
  if (testing::BeginsAsVdb(bytes)) return;
  ReadPages(bytes);
  ReadPages(Signed(bytes));
}

}  // namespace sheaf
