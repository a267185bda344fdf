// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Verifies NanoVDB images. Such a file is a memory image of its writer, with offsets between nodes,
// and untrusted. After VerifyImage no lookup can read outside the image.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "common/volume/volume_grid.h"

namespace sheaf::volume {

// The properties in the head of an image, after checking it. head: the beginning of the image.
// Errors: kInvalidArgument, kResourceExhausted.
absl::StatusOr<VolumeGridInfo> VerifyHead(std::span<const std::byte> head, uint64_t image_bytes,
                                          const std::string& where, const VolumeLimits& limits);

// Walks from the root to every leaf; completes bounds, counts and range of *info.
// Requires: *info came from VerifyHead of this image.
// Errors: kDataLoss if an offset leads out of the image, is not aligned, or nodes are shared;
// kInvalidArgument for NaN, infinity and coordinates beyond the limits.
absl::Status VerifyNodes(const VolumeBytes& image, const std::string& where,
                         const VolumeLimits& limits, int thread_count, VolumeGridInfo* info);

}  // namespace sheaf::volume
