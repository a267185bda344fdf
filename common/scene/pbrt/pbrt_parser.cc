// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/pbrt_parser.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/check.h"
#include "common/scene/formats/number.h"
#include "common/scene/pbrt/syntax/old_syntax.h"

namespace sheaf {
namespace {

constexpr const char* kDirectives[] = {
    "Accelerator",
    "ActiveTransform",
    "AreaLightSource",
    "Attribute",
    "AttributeBegin",
    "AttributeEnd",
    "Camera",
    "ColorSpace",
    "ConcatTransform",
    "CoordSysTransform",
    "CoordinateSystem",
    "Film",
    "Identity",
    "Import",
    "Include",
    "Integrator",
    "LightSource",
    "LookAt",
    "MakeNamedMaterial",
    "MakeNamedMedium",
    "Material",
    "MediumInterface",
    "NamedMaterial",
    "ObjectBegin",
    "ObjectEnd",
    "ObjectInstance",
    "Option",
    "PixelFilter",
    "ReverseOrientation",
    "Rotate",
    "Sampler",
    "Scale",
    "Shape",
    "Texture",
    "Transform",
    "TransformBegin",
    "TransformEnd",
    "TransformTimes",
    "Translate",
    "WorldBegin",
};

bool IsDirective(std::string_view word) {
  return std::find(std::begin(kDirectives), std::end(kDirectives), word) != std::end(kDirectives);
}

std::string Quoted(std::string_view text) {
  constexpr size_t kShownBytesMax = 60;
  const bool cut = text.size() > kShownBytesMax;
  return absl::StrCat("\"", std::string(text.substr(0, kShownBytesMax)), cut ? "...\"" : "\"");
}

}  // namespace

absl::Status PbrtParser::ParseMainFile(const std::string& canonical_name) {
  const absl::Status status = ParseFile(canonical_name);
  if (status.ok()) builder_->EndOfScene();
  return status;
}

absl::Status PbrtParser::ParseFile(const std::string& canonical_name) {
  if (++inclusions_ > limits_.inclusions_max) {
    return absl::ResourceExhaustedError(
        absl::StrCat("files are included more often than the limit of ", limits_.inclusions_max,
                     " (inclusions_max); define an object once and place it by ObjectInstance"));
  }
  absl::StatusOr<std::string> path = files_->PathToRead(canonical_name);
  if (!path.ok()) return path.status();
  absl::StatusOr<std::unique_ptr<TextInput>> input = TextInput::Open(*path, limits_.file_bytes_max);
  if (!input.ok()) return input.status();
  Tokenizer tokenizer(std::move(*input));
  Tokenizer* const outer_tokens = std::exchange(tokens_, &tokenizer);
  const int32_t outer_file = std::exchange(file_, builder_->AddFile(canonical_name));
  const bool outer_failed = std::exchange(file_failed_, false);
  open_files_.push_back(canonical_name);
  ParseDirectives();
  open_files_.pop_back();
  tokens_ = outer_tokens;
  file_ = outer_file;
  file_failed_ = outer_failed;
  return absl::OkStatus();
}

Token PbrtParser::Next() {
  Token token = tokens_->Next();
  if (token.kind == Token::Kind::kError) {
    if (!file_failed_) ErrorAt(token, token.text);
    file_failed_ = true;
    token.kind = Token::Kind::kEnd;
  }
  return token;
}

void PbrtParser::ParseDirectives() {
  while (!diagnostics_->Exhausted() && !file_failed_) {
    const Token token = Next();
    if (token.kind == Token::Kind::kEnd) return;
    if (token.kind != Token::Kind::kWord) {
      ErrorAt(token, absl::StrCat("expected a directive, found ",
                                  token.kind == Token::Kind::kString ? "the string " : "",
                                  Quoted(token.text)));
      Recover();
      continue;
    }
    const std::string word(token.text);
    ParseDirective(word, LocationOf(token));
  }
}

void PbrtParser::Recover() {
  while (!file_failed_) {
    const Token token = Next();
    if (token.kind == Token::Kind::kEnd) return;
    if (token.kind == Token::Kind::kWord && IsDirective(token.text)) {
      tokens_->Unget();
      return;
    }
  }
}

void PbrtParser::ParseDirective(std::string_view word, SourceLocation location) {
  if (!IsDirective(word)) {
    const std::vector<std::string> names(std::begin(kDirectives), std::end(kDirectives));
    diagnostics_->Error(
        location, absl::StrCat("unknown directive ", Quoted(word), NearestNameHint(word, names)));
    Recover();
    return;
  }
  if (ParseTransformDirective(word, location) || ParseBlockDirective(word, location)) return;
  if (word == "Include") return ParseReference(false, location);
  if (word == "Import") return ParseReference(true, location);
  if (word == "MediumInterface") return ParseMediumInterface(location);
  if (word == "Option") return ParseOption(location);
  if (word == "Texture") return ParseTexture(location);
  SHEAF_CHECK(ParseNamedDirective(word, location));
}

bool PbrtParser::ParseTransformDirective(std::string_view word, SourceLocation location) {
  struct Form {
    std::string_view word;
    size_t count;
    void (SceneBuilder::*call)(const double* numbers, SourceLocation location);
  };
  static constexpr Form kForms[] = {
      {"Identity", 0, &SceneBuilder::Identity},
      {"Translate", 3, &SceneBuilder::Translate},
      {"Scale", 3, &SceneBuilder::Scale},
      {"Rotate", 4, &SceneBuilder::Rotate},
      {"LookAt", 9, &SceneBuilder::LookAt},
      {"Transform", 16, &SceneBuilder::Transform},
      {"ConcatTransform", 16, &SceneBuilder::ConcatTransform},
      {"TransformTimes", 2, &SceneBuilder::TransformTimes},
  };
  for (const Form& form : kForms) {
    if (form.word != word) continue;
    double numbers[16];
    if (ParseNumbers(word, numbers, form.count)) (builder_->*form.call)(numbers, location);
    return true;
  }
  if (word != "ActiveTransform") return false;
  const Token token = Next();
  if (token.kind != Token::Kind::kWord || !builder_->ActiveTransform(token.text)) {
    ErrorAt(token, "ActiveTransform needs one of StartTime, EndTime and All");
    Recover();
  }
  return true;
}

bool PbrtParser::ParseBlockDirective(std::string_view word, SourceLocation location) {
  struct Form {
    std::string_view word;
    void (SceneBuilder::*call)(SourceLocation location);
  };
  static constexpr Form kForms[] = {
      {"WorldBegin", &SceneBuilder::WorldBegin},
      {"AttributeBegin", &SceneBuilder::AttributeBegin},
      {"AttributeEnd", &SceneBuilder::AttributeEnd},
      {"TransformBegin", &SceneBuilder::TransformBegin},
      {"TransformEnd", &SceneBuilder::TransformEnd},
      {"ObjectEnd", &SceneBuilder::ObjectEnd},
      {"ReverseOrientation", &SceneBuilder::ReverseOrientation},
  };
  for (const Form& form : kForms) {
    if (form.word != word) continue;
    (builder_->*form.call)(location);
    return true;
  }
  return false;
}

bool PbrtParser::ParseNamedDirective(std::string_view word, SourceLocation location) {
  struct Plain {
    std::string_view word;
    void (SceneBuilder::*call)(const std::string& name, SourceLocation location);
  };
  static constexpr Plain kPlain[] = {
      {"ColorSpace", &SceneBuilder::ColorSpace},
      {"CoordinateSystem", &SceneBuilder::CoordinateSystem},
      {"CoordSysTransform", &SceneBuilder::CoordSysTransform},
      {"NamedMaterial", &SceneBuilder::NamedMaterial},
      {"ObjectBegin", &SceneBuilder::ObjectBegin},
  };
  struct WithParameters {
    std::string_view word;
    void (SceneBuilder::*call)(const std::string& name, std::vector<Parameter> parameters,
                               SourceLocation location);
  };
  static constexpr WithParameters kWithParameters[] = {
      {"Accelerator", &SceneBuilder::Accelerator},
      {"AreaLightSource", &SceneBuilder::AreaLightSource},
      {"Attribute", &SceneBuilder::Attribute},
      {"Camera", &SceneBuilder::Camera},
      {"Film", &SceneBuilder::Film},
      {"Integrator", &SceneBuilder::Integrator},
      {"LightSource", &SceneBuilder::LightSource},
      {"MakeNamedMaterial", &SceneBuilder::MakeNamedMaterial},
      {"MakeNamedMedium", &SceneBuilder::MakeNamedMedium},
      {"Material", &SceneBuilder::Material},
      {"ObjectInstance", &SceneBuilder::ObjectInstance},
      {"PixelFilter", &SceneBuilder::PixelFilter},
      {"Sampler", &SceneBuilder::Sampler},
      {"Shape", &SceneBuilder::Shape},
  };
  std::string name;
  if (!ParseString(word, "a name in quotation marks", &name)) return true;
  for (const Plain& form : kPlain) {
    if (form.word != word) continue;
    (builder_->*form.call)(name, location);
    return true;
  }
  for (const WithParameters& form : kWithParameters) {
    if (form.word != word) continue;
    (builder_->*form.call)(name, ParametersOf(word, name, location), location);
    return true;
  }
  return false;
}

void PbrtParser::ParseReference(bool is_import, SourceLocation location) {
  std::string reference;
  if (!ParseString(is_import ? "Import" : "Include", "a file name", &reference)) return;
  const std::string name = CanonicalFileName(reference);
  if (std::find(open_files_.begin(), open_files_.end(), name) != open_files_.end()) {
    diagnostics_->Error(location, absl::StrCat("the files include each other in a cycle: ",
                                               absl::StrJoin(open_files_, " > "), " > ", name));
    return;
  }
  if (open_files_.size() > limits_.include_depth_max) {
    diagnostics_->Error(location, absl::StrCat("files are nested deeper than the limit of ",
                                               limits_.include_depth_max, " (include_depth_max)"));
    return;
  }
  if (is_import && !builder_->ImportBegin(location)) return;
  const absl::Status status = ParseFile(name);
  if (!status.ok()) {
    diagnostics_->Error(location,
                        absl::StrCat("cannot read ", Quoted(reference), ": ", status.message()));
  }
  if (is_import) builder_->ImportEnd(location);
}

void PbrtParser::ParseMediumInterface(SourceLocation location) {
  std::string inside;
  if (!ParseString("MediumInterface", "the name of a medium", &inside)) return;
  const Token token = Next();
  std::string outside = inside;
  if (token.kind == Token::Kind::kString) {
    outside = std::string(token.text);
  } else {
    tokens_->Unget();
  }
  builder_->MediumInterface(inside, outside, location);
}

void PbrtParser::ParseOption(SourceLocation location) {
  std::string name;
  if (!ParseString("Option", "the option's name", &name)) return;
  const Token token = Next();
  if (token.kind != Token::Kind::kString && token.kind != Token::Kind::kWord) {
    ErrorAt(token, "Option needs a value after its name");
    Recover();
    return;
  }
  builder_->Option(name, std::string(token.text), location);
}

void PbrtParser::ParseTexture(SourceLocation location) {
  std::string name, type, kind;
  if (!ParseString("Texture", "its name", &name)) return;
  if (!ParseString("Texture", "its type, \"float\" or \"spectrum\",", &type)) return;
  if (!ParseString("Texture", "its class, such as \"imagemap\",", &kind)) return;
  if (IsOldParameterType(type)) {
    diagnostics_->Explain(location, OldSyntaxAdvice(absl::StrCat("a texture of type ", type)));
  }
  builder_->Texture(name, type, kind, ParametersOf("Texture", kind, location), location);
}

std::vector<Parameter> PbrtParser::ParametersOf(std::string_view directive, const std::string& type,
                                                SourceLocation location) {
  std::vector<Parameter> parameters = ParseParameters();
  const std::string sign = OldSyntaxIn(directive, type, parameters);
  if (!sign.empty()) diagnostics_->Explain(location, OldSyntaxAdvice(sign));
  return parameters;
}

bool PbrtParser::ParseString(std::string_view directive, std::string_view what, std::string* text) {
  const Token token = Next();
  if (token.kind == Token::Kind::kString) {
    *text = std::string(token.text);
    return true;
  }
  ErrorAt(token, absl::StrCat(std::string(directive), " needs ", std::string(what), " here"));
  if (token.kind == Token::Kind::kWord) tokens_->Unget();
  Recover();
  return false;
}

bool PbrtParser::ParseNumbers(std::string_view directive, double* numbers, size_t count) {
  bool is_bracketed = false;
  for (size_t i = 0; i < count;) {
    const Token token = Next();
    // pbrt writes the matrices of Transform in brackets; around other numbers they are harmless.
    if (i == 0 && !is_bracketed && token.kind == Token::Kind::kLeftBracket) {
      is_bracketed = true;
      continue;
    }
    if (token.kind != Token::Kind::kWord || !ParseDouble(token.text, &numbers[i])) {
      ErrorAt(token, absl::StrCat(std::string(directive), " needs ", count, " numbers; number ",
                                  i + 1, " is missing or malformed"));
      if (token.kind == Token::Kind::kWord) tokens_->Unget();
      Recover();
      return false;
    }
    ++i;
  }
  if (!is_bracketed) return true;
  const Token token = Next();
  if (token.kind == Token::Kind::kRightBracket) return true;
  ErrorAt(token, absl::StrCat(std::string(directive), " needs ] after ", count, " numbers"));
  tokens_->Unget();
  Recover();
  return false;
}

}  // namespace sheaf
