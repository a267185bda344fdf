// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of PbrtParser that reads parameter lists: "type name" value or "type name" [ values ].
// Inline meshes are read here, so appending a number neither allocates nor copies its text.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "absl/strings/str_cat.h"
#include "common/base/memory_room.h"
#include "common/scene/formats/number.h"
#include "common/scene/pbrt/pbrt_parser.h"
#include "common/scene/pbrt/syntax/old_syntax.h"

namespace sheaf {
namespace {

std::string Shown(const Token& token) {
  constexpr size_t kShownBytesMax = 40;
  if (token.kind == Token::Kind::kEnd) return "the end of the file";
  return absl::StrCat("\"", std::string(token.text.substr(0, kShownBytesMax)), "\"");
}

bool HasFloats(ParameterType type) {
  switch (type) {
    case ParameterType::kInteger:
    case ParameterType::kBool:
    case ParameterType::kString:
    case ParameterType::kTexture:
      return false;
    default:
      return true;
  }
}

bool HasStrings(ParameterType type) {
  return type == ParameterType::kString || type == ParameterType::kTexture ||
         type == ParameterType::kSpectrum;
}

}  // namespace

std::vector<Parameter> PbrtParser::ParseParameters() {
  std::vector<Parameter> parameters;
  while (!file_failed_ && !diagnostics_->Exhausted()) {
    const Token token = Next();
    if (token.kind != Token::Kind::kString) {
      if (token.kind != Token::Kind::kEnd) tokens_->Unget();
      break;
    }
    Parameter parameter;
    bool is_good = ParseDeclaration(token, &parameter);
    ParseValues(&parameter, &is_good);
    if (!is_good) continue;
    const auto same = [&](const Parameter& other) { return other.name == parameter.name; };
    if (std::any_of(parameters.begin(), parameters.end(), same)) {
      diagnostics_->Error(parameter.location, absl::StrCat("parameter \"", parameter.name,
                                                           "\" is given twice; remove one"));
      continue;
    }
    parameters.push_back(std::move(parameter));
  }
  return parameters;
}

bool PbrtParser::ParseDeclaration(const Token& token, Parameter* parameter) {
  constexpr std::string_view kBlank = " \t";
  parameter->location = LocationOf(token);
  const std::string_view text = token.text;
  const size_t type_begin = std::min(text.find_first_not_of(kBlank), text.size());
  const size_t type_end = std::min(text.find_first_of(kBlank, type_begin), text.size());
  const size_t name_begin = std::min(text.find_first_not_of(kBlank, type_end), text.size());
  const size_t name_end = std::min(text.find_first_of(kBlank, name_begin), text.size());
  const std::string_view type = text.substr(type_begin, type_end - type_begin);
  parameter->name = std::string(text.substr(name_begin, name_end - name_begin));
  if (parameter->name.empty()) {
    ErrorAt(token, absl::StrCat("parameter ", Shown(token),
                                " needs a type and a name, such as \"float radius\""));
    return false;
  }
  if (ParameterTypeFromName(type, &parameter->type)) return true;
  if (IsOldParameterType(type)) {
    diagnostics_->Explain(LocationOf(token),
                          OldSyntaxAdvice(absl::StrCat("\"", std::string(text), "\"")));
  }
  ErrorAt(token,
          absl::StrCat("parameter \"", parameter->name, "\" has the unknown type \"",
                       std::string(type), "\"",
                       NearestNameHint(type, {"integer", "float", "point2", "vector2", "point3",
                                              "vector3", "normal", "spectrum", "rgb", "blackbody",
                                              "bool", "string", "texture"})));
  return false;
}

void PbrtParser::ParseValues(Parameter* parameter, bool* is_good) {
  Token token = Next();
  const bool is_list = token.kind == Token::Kind::kLeftBracket;
  if (is_list) token = Next();
  while (token.kind != Token::Kind::kRightBracket) {
    const bool is_directive =
        token.kind == Token::Kind::kWord && token.text.front() >= 'A' && token.text.front() <= 'Z';
    if (token.kind == Token::Kind::kEnd || token.kind == Token::Kind::kLeftBracket ||
        is_directive) {
      if (*is_good) {
        ErrorAt(token, absl::StrCat("parameter \"", parameter->name, "\" has no ",
                                    is_list ? "] before " : "value before ", Shown(token)));
      }
      *is_good = false;
      if (token.kind != Token::Kind::kEnd) tokens_->Unget();
      return;
    }
    if (*is_good) *is_good = AppendValue(token, parameter);
    if (!is_list) break;
    token = Next();
  }
  if (!is_list && token.kind == Token::Kind::kRightBracket) {
    ErrorAt(token, absl::StrCat("parameter \"", parameter->name, "\" has no value before ]"));
    *is_good = false;
  }
  if (*is_good) *is_good = CheckComponents(*parameter);
}

bool PbrtParser::CheckComponents(const Parameter& parameter) {
  const size_t components = ComponentCount(parameter.type);
  if (parameter.floats.size() % components == 0) return true;
  diagnostics_->Error(
      parameter.location,
      absl::StrCat("parameter \"", parameter.name, "\" of type ",
                   std::string(ParameterTypeName(parameter.type)), " needs a multiple of ",
                   components, " numbers but has ", parameter.floats.size()));
  return false;
}

namespace {

// ParseFloat for a coordinate, which also keeps what the rounding took. Call before the value joins
// the floats.
bool ParseCoordinate(std::string_view text, float* rounded, std::vector<float>* remainders,
                     size_t count) {
  double value = 0;
  if (!ParseDouble(text, &value)) return false;
  *rounded = static_cast<float>(value);
  // Rounding twice differs from rounding once only where the first result is a tie of the second,
  // or where float loses more digits or its range.
  constexpr uint64_t kDropped = (uint64_t{1} << 29) - 1, kTie = uint64_t{1} << 28;
  const bool is_tie = (std::bit_cast<uint64_t>(value) & kDropped) == kTie;
  if ((is_tie || !std::isnormal(*rounded)) && !ParseFloat(text, rounded)) return false;
  const auto remainder = static_cast<float>(value - static_cast<double>(*rounded));
  if (remainders->empty() && remainder == 0) return true;
  remainders->resize(count);
  remainders->push_back(remainder);
  return true;
}

}  // namespace

bool PbrtParser::AppendValue(const Token& token, Parameter* parameter) {
  const ParameterType type = parameter->type;
  if (token.kind == Token::Kind::kString) return AppendString(token, parameter);
  if (token.kind == Token::Kind::kWord) {
    if (HasFloats(type)) {
      float value = 0;
      const bool is_parsed = type == ParameterType::kPoint3
                                 ? ParseCoordinate(token.text, &value, &parameter->remainders,
                                                   parameter->floats.size())
                                 : ParseFloat(token.text, &value);
      if (is_parsed) {
        parameter->floats.push_back(value);
        return ChargeMemory(*parameter);
      }
    } else if (type == ParameterType::kInteger) {
      int32_t value = 0;
      if (ParseInteger(token.text, &value)) {
        parameter->integers.push_back(value);
        return ChargeMemory(*parameter);
      }
    } else if (type == ParameterType::kBool && (token.text == "true" || token.text == "false")) {
      parameter->bools.push_back(token.text == "true" ? 1 : 0);
      return ChargeMemory(*parameter);
    }
  }
  ErrorAt(token, absl::StrCat("parameter \"", parameter->name, "\": ", Shown(token), " is not a ",
                              type == ParameterType::kInteger ? "32-bit integer"
                              : type == ParameterType::kBool  ? "bool (true or false)"
                              : HasFloats(type)               ? "number that a 32-bit float holds"
                                                              : "string in quotation marks"));
  return false;
}

bool PbrtParser::AppendString(const Token& token, Parameter* parameter) {
  if (HasStrings(parameter->type)) {
    parameter->strings.emplace_back(token.text);
    return ChargeMemory(*parameter);
  }
  ErrorAt(token, absl::StrCat("parameter \"", parameter->name, "\" of type ",
                              std::string(ParameterTypeName(parameter->type)), " has the string ",
                              Shown(token), " where a value without quotation marks belongs"));
  return false;
}

bool PbrtParser::ChargeMemory(const Parameter& parameter) {
  // Strings are at most kTokenBytesMax long; counting them at their usual size keeps this cheap.
  constexpr uint64_t kStringBytes = 64;
  const uint64_t bytes = (parameter.floats.size() + parameter.remainders.size()) * sizeof(float) +
                         parameter.integers.size() * sizeof(int32_t) + parameter.bools.size() +
                         parameter.strings.size() * kStringBytes;
  if (bytes <= limits_.memory_bytes_max) return true;
  diagnostics_->MemoryError(
      parameter.location,
      absl::StrCat("parameter \"", parameter.name, "\" takes more than ",
                   FormatMemory(limits_.memory_bytes_max), ", which is ", limits_.memory_limit));
  return false;
}

}  // namespace sheaf
