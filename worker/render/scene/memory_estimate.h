// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MemoryEstimate: the memory that compiling a scene needs, estimated from its description before
// any is allocated.
#pragma once

#include <cstdint>
#include <string>

#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

struct MemoryEstimate {
  uint64_t triangle_count = 0;  // As placed; a bilinear patch counts as two.
  uint64_t curve_count = 0;     // Segments.
  uint64_t instance_count = 0;
  uint64_t surface_bytes = 0;  // For these, during the build of the acceleration structure.
  uint64_t volume_bytes = 0;   // Grids, in the scene or in files.
  uint64_t unpaged_bytes = 0;  // Its files that sheaf pack can make page files of.
  bool has_pages = false;      // Pages of page files come on top, up to their own limit.
  // The shape that needs the most memory, and the amount.
  SourceLocation largest;
  uint64_t largest_bytes = 0;

  uint64_t TotalBytes() const { return surface_bytes + volume_bytes; }
};

// Without the description itself, texture tiles and pages of volumes (bounded by the limits of
// their caches), and the results of displacement. Missing files count as 0.
MemoryEstimate EstimateMemory(const SceneDescription& scene, FileSource& files);

// "1.2 GiB while it is loaded: 4194304 triangles, 3 instances 1.1 GiB, volumes 90 MiB".
std::string FormatMemoryEstimate(const MemoryEstimate& estimate);
// A line about page files where they save much memory; else empty.
std::string PageFileNote(const MemoryEstimate& estimate);

}  // namespace sheaf::render
