// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/image_builder.h"

#include <algorithm>
#include <cstdlib>

namespace sheaf {

VolumeBytes::VolumeBytes(uint64_t size_bytes) : size_(size_bytes) {
  const uint64_t padded = (size_bytes + kAlignment - 1) / kAlignment * kAlignment;
  data_.reset(
      static_cast<std::byte*>(std::aligned_alloc(kAlignment, std::max(padded, kAlignment))));
}

namespace volume {

void FillHead(const std::string& name, const Matrix4& medium_from_index, nanovdb::GridType type,
              uint64_t size_bytes, nanovdb::GridData* head) {
  head->mMagic = NANOVDB_MAGIC_NUMBER;
  head->mVersion = nanovdb::Version();
  head->mFlags = static_cast<uint32_t>(nanovdb::GridFlags::IsBreadthFirst);
  head->mGridCount = 1;
  head->mGridSize = size_bytes;
  head->mGridType = type;
  head->mGridClass = nanovdb::GridClass::FogVolume;
  std::memcpy(head->mGridName, name.data(), std::min(name.size(), sizeof(head->mGridName) - 1));
  for (size_t row = 0; row < 3; ++row) {
    for (size_t column = 0; column < 3; ++column) {
      head->mMap.mMatD[3 * row + column] = medium_from_index.m[row][column];
    }
    head->mMap.mVecD[row] = medium_from_index.m[row][3];
  }
  head->mMap.mTaperD = 1;
}

}  // namespace volume
}  // namespace sheaf
