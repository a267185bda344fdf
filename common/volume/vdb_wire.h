// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What goes over the socket between a process that wants grids of a .vdb file and sheaf-vdb-reader,
// the confined process that reads it. Both are of one build, on one machine.
//
//     VdbRequest | file name > VdbReply | text of an error | payload
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/volume/volume_file.h"
#include "common/volume/volume_surface.h"

namespace sheaf::volume {

inline constexpr char kVdbReaderProgram[] = "sheaf-vdb-reader";
// Changes with these messages.
inline constexpr uint32_t kVdbWireVersion = 1;
// Limits of either end, besides those of images.
inline constexpr uint32_t kVdbTextBytesMax = 4'096;
inline constexpr uint32_t kVdbFileNameBytesMax = 1 << 16;
inline constexpr uint64_t kVdbListBytesMax = uint64_t{16} << 20;

enum class VdbVerb : uint32_t {
  kConfine = 1,  // First, once. Payload: the missing protections, a uint32_t.
  kList = 2,     // Payload: EncodeVdbList.
  kRead = 3,     // Payload: an image.
  kSurface = 4,  // Payload: SurfaceCounts, then the arrays of a VolumeSurface in their order.
};
struct VdbRequest {
  uint32_t version = kVdbWireVersion;
  VdbVerb verb = VdbVerb::kConfine;
  // kConfine: the protections, as bits; the limits of memory and processor time.
  uint32_t protections = 0;
  uint32_t cpu_seconds_max = 0;
  uint64_t memory_bytes_max = 0;
  // kList, kRead, kSurface.
  VolumeLimits limits = {};
  uint64_t index = 0;
  float isovalue = 0;
  uint32_t file_name_bytes = 0;
};
struct VdbReply {
  int32_t code = 0;  // absl::StatusCode
  uint32_t text_bytes = 0;
  uint64_t payload_bytes = 0;
};

struct SurfaceCounts {
  uint64_t positions = 0, triangle_indices = 0;
};

// False if the other end is closed. SendAll requires: SIGPIPE is ignored.
bool SendAll(int socket, const void* bytes, size_t size_bytes);
bool ReceiveAll(int socket, void* bytes, size_t size_bytes);

std::string EncodeVdbList(const std::vector<VolumeFileEntry>& entries);
// Errors: kInvalidArgument.
absl::StatusOr<std::vector<VolumeFileEntry>> DecodeVdbList(std::string_view bytes);

}  // namespace sheaf::volume
