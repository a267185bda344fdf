// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LeaseTokens: proofs that a task was leased to an identity. The coordinator gives a token with
// each lease and accepts a result or a failure only with it. It need not remember the lease: a
// token stays valid after the lease has ended and after a restart, so late results are accepted.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "common/film/task_kind.h"
#include "common/film/tile_cells.h"
#include "common/film/tile_geometry.h"

namespace sheaf::coordinator {

// The statement that a token proves: this work was leased to this identity.
struct LeasedWork {
  uint64_t lease_id = 0;
  std::string_view identity;      // WorkerReport::identity.
  std::string_view frame_digest;  // Hex.
  PixelRect tile;
  SampleBlock block;
  TileCells cells;
  TaskKind kind = TaskKind::kCamera;
};

// Pure. Thread safety: all members may be called concurrently.
class LeaseTokens {
 public:
  // secret: known to the coordinator alone.
  explicit LeaseTokens(std::string secret) : secret_(std::move(secret)) {}

  // HMAC-SHA-256 over all members of the work, 32 bytes.
  std::string Make(const LeasedWork& work) const;
  bool IsValid(const LeasedWork& work, std::string_view token) const;

 private:
  const std::string secret_;
};

}  // namespace sheaf::coordinator
