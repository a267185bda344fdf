// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Diagnostics: a reader's errors, warnings and notes about a scene, each with its location,
// collected so that one run shows every mistake. Text quoted from the scene is made printable.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "common/base/nearest_name.h"
#include "common/scene/scene_description.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf {

struct SceneDiagnostic {
  enum class Severity { kNote, kWarning, kError } severity = Severity::kError;
  std::string text;  // "file:line:column: what, why, what to do".
};

class Diagnostics {
 public:
  // Requires: scene outlives this; its files name the locations.
  Diagnostics(const SceneDescription* scene, const SceneReaderLimits& limits)
      : scene_(scene), errors_max_(limits.errors_max), notes_max_(limits.notes_max) {}

  void Error(SourceLocation location, std::string_view text);
  // The scene needs more memory than this machine has; others may have more.
  void MemoryError(SourceLocation location, std::string_view text);
  void Warning(SourceLocation location, std::string_view text);
  // A cause of the errors that follow; only the first is kept. It is printed before the errors, and
  // omitted if there are none.
  void Explain(SourceLocation location, std::string_view text);
  // Notes and warnings with the same text are reported once, at their first location.
  void Note(SourceLocation location, std::string_view text);

  // True once reading should stop.
  bool Exhausted() const { return error_count_ >= errors_max_; }
  bool HasErrors() const { return error_count_ > 0; }
  // OK if there are no errors; otherwise kInvalidArgument, or kResourceExhausted after a
  // MemoryError, listing every error, one per line.
  absl::Status ToStatus() const;
  std::vector<SceneDiagnostic> TakeAll() { return std::move(diagnostics_); }

 private:
  void AddOnce(SceneDiagnostic::Severity severity, SourceLocation location, std::string_view text);

  const SceneDescription* scene_;
  uint32_t errors_max_;
  uint32_t notes_max_;
  uint32_t error_count_ = 0;
  std::string explanation_;
  bool lacks_memory_ = false;
  std::set<std::string, std::less<>> reported_;
  std::vector<SceneDiagnostic> diagnostics_;
};

}  // namespace sheaf
