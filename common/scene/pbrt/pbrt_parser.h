// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PbrtParser: the syntax of pbrt-v4 scene files. Reads directives with their arguments and passes
// each to a SceneBuilder, which interprets them. Follows Include and Import.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "common/scene/pbrt/scene_builder.h"
#include "common/scene/pbrt/statements/scene_files.h"
#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/pbrt/syntax/tokenizer.h"

namespace sheaf {

class PbrtParser {
 public:
  PbrtParser(SceneBuilder* builder, SceneFiles* files, Diagnostics* diagnostics,
             const SceneReaderLimits& limits)
      : builder_(builder), files_(files), diagnostics_(diagnostics), limits_(limits) {}

  // Errors: kNotFound for the file itself. Mistakes inside it go to the diagnostics.
  absl::Status ParseMainFile(const std::string& canonical_name);

 private:
  absl::Status ParseFile(const std::string& canonical_name);
  void ParseDirectives();
  void ParseDirective(std::string_view word, SourceLocation location);
  bool ParseTransformDirective(std::string_view word, SourceLocation location);
  bool ParseNamedDirective(std::string_view word, SourceLocation location);
  bool ParseBlockDirective(std::string_view word, SourceLocation location);
  void ParseReference(bool is_import, SourceLocation location);
  void ParseMediumInterface(SourceLocation location);
  void ParseOption(SourceLocation location);
  void ParseTexture(SourceLocation location);

  std::vector<Parameter> ParseParameters();
  // The same after a directive and its type; explains errors that come from an older format.
  std::vector<Parameter> ParametersOf(std::string_view directive, const std::string& type,
                                      SourceLocation location);
  bool ParseDeclaration(const Token& token, Parameter* parameter);
  void ParseValues(Parameter* parameter, bool* is_good);
  bool CheckComponents(const Parameter& parameter);
  bool AppendValue(const Token& token, Parameter* parameter);
  bool AppendString(const Token& token, Parameter* parameter);
  bool ChargeMemory(const Parameter& parameter);

  bool ParseNumbers(std::string_view directive, double* numbers, size_t count);
  bool ParseString(std::string_view directive, std::string_view what, std::string* text);
  // Skips to the next directive after an error, so that one mistake gives one message.
  void Recover();
  Token Next();
  SourceLocation LocationOf(const Token& token) const { return {file_, token.line, token.column}; }
  void ErrorAt(const Token& token, std::string_view text) {
    diagnostics_->Error(LocationOf(token), text);
  }

  SceneBuilder* builder_;
  SceneFiles* files_;
  Diagnostics* diagnostics_;
  SceneReaderLimits limits_;
  Tokenizer* tokens_ = nullptr;          // The file being read.
  int32_t file_ = kNone;                 // Its index in SceneDescription::files.
  bool file_failed_ = false;             // The rest of the file cannot be read.
  std::vector<std::string> open_files_;  // From the main file to the one being read.
  uint32_t inclusions_ = 0;
};

}  // namespace sheaf
