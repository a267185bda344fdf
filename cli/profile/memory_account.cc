// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/profile/memory_account.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace sheaf::cli {
namespace {

std::string MemoryRow(const std::string& name, int64_t bytes) {
  constexpr double kMebibyte = 1 << 20;
  return absl::StrFormat("  %-22s %9.2f MiB\n", name, static_cast<double>(bytes) / kMebibyte);
}

}  // namespace

int64_t MemoryAccount::OtherBytes() const {
  auto other = static_cast<int64_t>(resident_bytes);
  for (const Kind& kind : kinds) other -= static_cast<int64_t>(kind.bytes);
  return other;
}

MemoryAccount MakeMemoryAccount(const render::SceneMemory& scene, const MemoryBesideScene& beside,
                                const ProcessMemory& process) {
  MemoryAccount account;
  account.resident_bytes = process.resident.bytes;
  const MemoryAccount::Kind kinds[] = {
      {"meshes", scene.mesh_bytes},
      {"ray tracer", scene.tracer_bytes},
      {"materials", scene.material_bytes},
      {"textures", scene.texture_bytes},
      {"lights", scene.light_bytes},
      {"environment maps", scene.environment_bytes},
      {"volumes", scene.volume_bytes},
      {"volume pages", scene.page_bytes},
      {"guiding", scene.guiding_bytes},
      {"light passes", scene.light_pass_bytes},
      {"scene description", scene.description_bytes},
      {"film", beside.film_bytes},
      {"libraries", process.resident.file_bytes},
      {"program", beside.program_bytes},
      {"farm", beside.farm_bytes},
      {"freed, kept by malloc", process.heap_free_bytes},
  };
  std::ranges::copy_if(kinds, std::back_inserter(account.kinds),
                       [](const MemoryAccount::Kind& kind) { return kind.bytes > 0; });
  return account;
}

std::string FormatMemoryAccount(const MemoryAccount& account) {
  std::string text;
  for (const MemoryAccount::Kind& kind : account.kinds) {
    absl::StrAppend(&text, MemoryRow(kind.name, static_cast<int64_t>(kind.bytes)));
  }
  absl::StrAppend(&text, MemoryRow("other", account.OtherBytes()),
                  MemoryRow("resident", static_cast<int64_t>(account.resident_bytes)));
  return text;
}

nlohmann::ordered_json MemoryAccountJson(const MemoryAccount& account) {
  nlohmann::ordered_json json = {{"kinds", nlohmann::ordered_json::array()},
                                 {"other_bytes", account.OtherBytes()},
                                 {"resident_bytes", account.resident_bytes}};
  for (const MemoryAccount::Kind& kind : account.kinds) {
    json["kinds"].push_back({{"name", kind.name}, {"bytes", kind.bytes}});
  }
  return json;
}

}  // namespace sheaf::cli
