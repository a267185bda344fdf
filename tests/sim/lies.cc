// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/lies.h"

#include "common/base/digest.h"
#include "tests/sim/sim_messages.h"
#include "tests/sim/synthetic_film.h"

namespace sheaf::sim {

void Falsify(uint64_t kind, worker::FinishedPart* part) {
  worker::Lease other = LeaseOf(*part);
  switch (kind) {
    case 0:
      part->block.first += part->block.count;
      break;
    case 1:
      part->tile.x0 += part->tile.Width();
      part->tile.x1 = part->tile.x0 + 8;
      break;
    case 2:
      part->frame_digest = Sha256Hex(part->frame_digest);
      break;
    case kLieAboutDigest:
      part->exr_bytes[part->exr_bytes.size() / 2] ^= 1;
      return;
    case 4:
      part->exr_bytes.resize(part->exr_bytes.size() / 2);
      break;
    case 5:
      part->exr_bytes = ImpossiblePart(other);
      break;
    case 6:
      other.block.first += other.block.first == 0 ? other.block.count : -other.block.count;
      part->exr_bytes = TruePart(other);
      break;
    default:
      other.tile.x0 += 8;
      other.tile.x1 += 8;
      part->exr_bytes = TruePart(other);
  }
  part->digest = {Sha256Hex(part->exr_bytes), part->exr_bytes.size()};
}

}  // namespace sheaf::sim
