// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MemoryAccount: the memory of a process that renders, by kind, beside what the system says it has.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/base/surroundings/process_memory.h"
#include "worker/render/scene/scene_memory.h"

namespace sheaf::cli {

// The memory that a process holds beside a scene.
struct MemoryBesideScene {
  uint64_t program_bytes = 0;  // The heap before anything was read.
  uint64_t farm_bytes = 0;     // The growth of the heap while the coordinator started.
  uint64_t film_bytes = 0;     // Tiles that are not finished.
};

struct MemoryAccount {
  struct Kind {
    const char* name = "";
    uint64_t bytes = 0;
  };
  std::vector<Kind> kinds;      // Those that are not 0.
  uint64_t resident_bytes = 0;  // As the system says; 0 if it does not.

  // The bytes that no kind has; below 0 where kinds count pages that are not in memory.
  int64_t OtherBytes() const;
};
MemoryAccount MakeMemoryAccount(const render::SceneMemory& scene, const MemoryBesideScene& beside,
                                const ProcessMemory& process);

// A table of the kinds, "other" and the sum; each line ends.
std::string FormatMemoryAccount(const MemoryAccount& account);
nlohmann::ordered_json MemoryAccountJson(const MemoryAccount& account);

}  // namespace sheaf::cli
