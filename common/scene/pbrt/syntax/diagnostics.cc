// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/syntax/diagnostics.h"

#include "absl/strings/str_cat.h"
#include "common/base/printable.h"

namespace sheaf {
namespace {

std::string WithPlace(const SceneDescription& scene, SourceLocation location,
                      std::string_view text) {
  constexpr size_t kTextBytesMax = 2000;  // Names in it may be as long as a token of the scene.
  return Printable(
      absl::StrCat(FormatLocation(scene, location), ": ", Printable(text, kTextBytesMax)));
}

}  // namespace

void Diagnostics::Error(SourceLocation location, std::string_view text) {
  if (Exhausted()) return;
  ++error_count_;
  diagnostics_.push_back({SceneDiagnostic::Severity::kError, WithPlace(*scene_, location, text)});
}

void Diagnostics::Explain(SourceLocation location, std::string_view text) {
  if (explanation_.empty()) explanation_ = WithPlace(*scene_, location, text);
}

void Diagnostics::MemoryError(SourceLocation location, std::string_view text) {
  lacks_memory_ = true;
  Error(location, text);
}

void Diagnostics::Warning(SourceLocation location, std::string_view text) {
  AddOnce(SceneDiagnostic::Severity::kWarning, location, text);
}

void Diagnostics::Note(SourceLocation location, std::string_view text) {
  AddOnce(SceneDiagnostic::Severity::kNote, location, text);
}

void Diagnostics::AddOnce(SceneDiagnostic::Severity severity, SourceLocation location,
                          std::string_view text) {
  if (reported_.size() >= notes_max_ || !reported_.emplace(text).second) return;
  diagnostics_.push_back({severity, WithPlace(*scene_, location, text)});
}

absl::Status Diagnostics::ToStatus() const {
  if (!HasErrors()) return absl::OkStatus();
  std::string lines = explanation_;
  for (const SceneDiagnostic& diagnostic : diagnostics_) {
    if (diagnostic.severity != SceneDiagnostic::Severity::kError) continue;
    absl::StrAppend(&lines, lines.empty() ? "" : "\n", diagnostic.text);
  }
  if (Exhausted()) absl::StrAppend(&lines, "\nreading stopped after ", errors_max_, " errors");
  return lacks_memory_ ? absl::ResourceExhaustedError(lines) : absl::InvalidArgumentError(lines);
}

}  // namespace sheaf
