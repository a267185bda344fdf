// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Protections: the means that confine a scene's process. Each is optional on its own, as systems
// differ in what they permit; limits of resources and the loss of all privileges always apply.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace sheaf::worker {

enum class Protection : uint32_t {
  // Own user, mount, network, process, IPC and host name namespaces: there is no network, no other
  // process, and no file but those of the scene and the program's libraries.
  kNamespaces = 1,
  // Landlock: no other files can be opened, even if they are visible.
  kFileAccess = 2,
  // seccomp: no system calls but those that rendering needs.
  kSystemCalls = 4,
};
inline constexpr Protection kAllProtections[] = {Protection::kNamespaces, Protection::kFileAccess,
                                                 Protection::kSystemCalls};

// A set of protections.
class Protections {
 public:
  Protections() = default;
  explicit Protections(uint32_t bits) : bits_(bits) {}
  static Protections All();

  bool Has(Protection protection) const { return (bits_ & static_cast<uint32_t>(protection)) != 0; }
  bool empty() const { return bits_ == 0; }
  void Add(Protection protection) { bits_ |= static_cast<uint32_t>(protection); }
  void Remove(Protection protection) { bits_ &= ~static_cast<uint32_t>(protection); }
  uint32_t bits() const { return bits_; }
  friend bool operator==(Protections, Protections) = default;

 private:
  uint32_t bits_ = 0;
};

// "namespaces", "file access rules", "system call filter".
const char* NameOf(Protection protection);
// Their names, joined by ", "; "none" if the set is empty.
std::string NamesOf(Protections protections);

// How scenes are confined. kRequired: in processes with all protections, or not at all; kBest: in
// processes with the protections that the system permits; kNone: in the worker's own process.
enum class SandboxMode { kRequired, kBest, kNone };
// From "required", "best" or "none".
std::optional<SandboxMode> SandboxModeFromName(std::string_view name);

}  // namespace sheaf::worker
