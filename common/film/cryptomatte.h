// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Cryptomatte: mattes of all objects in an image, as ranked pairs of an id and its coverage.
// Source: Friedman and Jones 2015, "Fully automatic ID mattes with support for motion blur and
// transparency"; Cryptomatte specification 1.2.0 (Psyop).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/film/film_outputs.h"
#include "common/film/frame_image.h"
#include "common/film/id_sums.h"

namespace sheaf {

// Source: Appleby 2011, MurmurHash3_x86_32 with seed 0.
uint32_t MurmurHash3(std::string_view text);
// A name's id: its hash as the bits of a float that is neither 0, subnormal, infinite nor NaN.
uint32_t CryptomatteIdBits(std::string_view name);

// Two pairs fit in the R, G, B, A of a layer.
inline constexpr size_t kCryptomatteRankCount = 6;
// CryptoObject00.R to CryptoObject02.A, and rest.CryptoObject: coverage without a rank.
std::vector<std::string> CryptomatteChannels(IdKind kind);

// One pixel's values in the order of those channels. weight: of all samples of the pixel. Ids whose
// names have the same hash are one matte; coverage that is not positive (filters with negative
// lobes) gets no rank.
// Requires: names holds all ids of the list.
std::array<float, 2 * kCryptomatteRankCount + 1> RankIds(
    const IdList& list, const std::map<uint32_t, std::string>& names, double weight);

// The id with the most weight, or the smallest of equally weighted ones; kNoId if no weight is
// above 0.
uint32_t LeadingId(const IdList& list);

// The metadata by which programs find the mattes, for the cryptomattes among the image's outputs
// and all names from NoteNames: cryptomatte/KEY/{name,hash,conversion,manifest}.
std::map<std::string, std::string> CryptomatteAttributes(const FrameImage& image);

}  // namespace sheaf
