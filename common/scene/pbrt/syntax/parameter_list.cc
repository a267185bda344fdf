// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/syntax/parameter_list.h"

#include <algorithm>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

struct TypeName {
  const char* name;
  ParameterType type;
};
// Errors use the first spelling of each type.
constexpr TypeName kTypeNames[] = {
    {"integer", ParameterType::kInteger}, {"float", ParameterType::kFloat},
    {"point2", ParameterType::kPoint2},   {"vector2", ParameterType::kVector2},
    {"point3", ParameterType::kPoint3},   {"vector3", ParameterType::kVector3},
    {"normal", ParameterType::kNormal},   {"spectrum", ParameterType::kSpectrum},
    {"rgb", ParameterType::kRgb},         {"blackbody", ParameterType::kBlackbody},
    {"bool", ParameterType::kBool},       {"string", ParameterType::kString},
    {"texture", ParameterType::kTexture}, {"point", ParameterType::kPoint3},
    {"vector", ParameterType::kVector3},  {"normal3", ParameterType::kNormal},
};

std::vector<Vec3f> ToTriples(const std::vector<float>& floats) {
  std::vector<Vec3f> triples(floats.size() / 3);
  for (size_t i = 0; i < triples.size(); ++i) {
    triples[i] = {floats[3 * i], floats[3 * i + 1], floats[3 * i + 2]};
  }
  return triples;
}

}  // namespace

std::string_view ParameterTypeName(ParameterType type) {
  for (const TypeName& entry : kTypeNames) {
    if (entry.type == type) return entry.name;
  }
  return "unknown";
}

bool ParameterTypeFromName(std::string_view name, ParameterType* type) {
  for (const TypeName& entry : kTypeNames) {
    if (name != entry.name) continue;
    *type = entry.type;
    return true;
  }
  return false;
}

size_t ComponentCount(ParameterType type) {
  switch (type) {
    case ParameterType::kPoint2:
    case ParameterType::kVector2:
      return 2;
    case ParameterType::kPoint3:
    case ParameterType::kVector3:
    case ParameterType::kNormal:
    case ParameterType::kRgb:
      return 3;
    default:
      return 1;
  }
}

ParameterList::ParameterList(std::string owner, SourceLocation location, std::vector<Parameter> own,
                             std::vector<Parameter> defaults, Diagnostics* diagnostics)
    : owner_(std::move(owner)),
      location_(location),
      own_(std::move(own)),
      defaults_(std::move(defaults)),
      diagnostics_(diagnostics) {}

void ParameterList::ErrorAt(const Parameter& parameter, std::string_view text) {
  diagnostics_->Error(parameter.location, absl::StrCat(owner_, ": parameter \"", parameter.name,
                                                       "\" ", std::string(text)));
}

std::string ParameterList::Written() const {
  std::string text;
  const auto add = [&text](const auto& values) {
    absl::StrAppend(&text, values.size(), ":");
    for (const auto& value : values) {
      if constexpr (std::is_same_v<std::decay_t<decltype(value)>, std::string>) {
        absl::StrAppend(&text, value.size(), ":", value);
      } else {
        text.append(reinterpret_cast<const char*>(&value), sizeof(value));
      }
    }
  };
  for (const std::vector<Parameter>* list : {&own_, &defaults_}) {
    absl::StrAppend(&text, list->size(), ":");
    for (const Parameter& p : *list) {
      add(std::vector<std::string>{p.name});
      absl::StrAppend(&text, static_cast<int>(p.type), ":", static_cast<int>(p.primaries), ":");
      add(p.floats);
      add(p.remainders);
      add(p.integers);
      add(p.strings);
      add(p.bools);
    }
  }
  return text;
}

Parameter* ParameterList::Find(const std::string& name) {
  if (std::find(asked_.begin(), asked_.end(), name) == asked_.end()) asked_.push_back(name);
  const auto matches = [&](const Parameter& parameter) { return parameter.name == name; };
  if (const auto found = std::find_if(own_.begin(), own_.end(), matches); found != own_.end()) {
    found->is_used = true;
    return &*found;
  }
  const auto found = std::find_if(defaults_.rbegin(), defaults_.rend(), matches);
  return found == defaults_.rend() ? nullptr : &*found;
}

Parameter* ParameterList::FindTyped(const std::string& name, ParameterType type) {
  Parameter* parameter = Find(name);
  if (parameter == nullptr) return nullptr;
  if (parameter->type != type) {
    ErrorAt(*parameter, absl::StrCat("must be of type ", std::string(ParameterTypeName(type)),
                                     ", not ", std::string(ParameterTypeName(parameter->type))));
    return nullptr;
  }
  return parameter;
}

Parameter* ParameterList::FindCounted(const std::string& name, ParameterType type, size_t count) {
  Parameter* parameter = FindTyped(name, type);
  if (parameter == nullptr) return nullptr;
  if (parameter->ValueCount() != count) {
    ErrorAt(*parameter, absl::StrCat("needs ", count, count == 1 ? " value" : " values",
                                     " but has ", parameter->ValueCount()));
    return nullptr;
  }
  return parameter;
}

float ParameterList::GetFloat(const std::string& name, float fallback) {
  const Parameter* parameter = FindCounted(name, ParameterType::kFloat, 1);
  return parameter == nullptr ? fallback : parameter->floats[0];
}

int32_t ParameterList::GetInteger(const std::string& name, int32_t fallback) {
  const Parameter* parameter = FindCounted(name, ParameterType::kInteger, 1);
  return parameter == nullptr ? fallback : parameter->integers[0];
}

bool ParameterList::GetBool(const std::string& name, bool fallback) {
  const Parameter* parameter = FindCounted(name, ParameterType::kBool, 1);
  return parameter == nullptr ? fallback : parameter->bools[0] != 0;
}

std::string ParameterList::GetString(const std::string& name, const std::string& fallback) {
  const Parameter* parameter = FindCounted(name, ParameterType::kString, 1);
  return parameter == nullptr ? fallback : parameter->strings[0];
}

Vec3d ParameterList::GetPoint3(const std::string& name, Vec3d fallback) {
  const Parameter* parameter = FindCounted(name, ParameterType::kPoint3, 3);
  if (parameter == nullptr) return fallback;
  return {parameter->floats[0], parameter->floats[1], parameter->floats[2]};
}

Vec3f ParameterList::GetVector3(const std::string& name, Vec3f fallback) {
  const Parameter* parameter = FindCounted(name, ParameterType::kVector3, 3);
  return parameter == nullptr ? fallback : ToTriples(parameter->floats)[0];
}

std::vector<float> ParameterList::GetFloats(const std::string& name) {
  const Parameter* parameter = FindTyped(name, ParameterType::kFloat);
  return parameter == nullptr ? std::vector<float>() : parameter->floats;
}

std::vector<std::string> ParameterList::GetStrings(const std::string& name) {
  const Parameter* parameter = FindTyped(name, ParameterType::kString);
  return parameter == nullptr ? std::vector<std::string>() : parameter->strings;
}

std::vector<Vec2f> ParameterList::GetPoints2(const std::string& name) {
  const Parameter* parameter = FindTyped(name, ParameterType::kPoint2);
  if (parameter == nullptr) return {};
  std::vector<Vec2f> points(parameter->floats.size() / 2);
  for (size_t i = 0; i < points.size(); ++i) {
    points[i] = {parameter->floats[2 * i], parameter->floats[2 * i + 1]};
  }
  return points;
}

std::vector<Vec3f> ParameterList::GetTriples(const std::string& name, ParameterType type) {
  const Parameter* parameter = FindTyped(name, type);
  return parameter == nullptr ? std::vector<Vec3f>() : ToTriples(parameter->floats);
}

VertexRounding ParameterList::GetVertices(const std::string& name) {
  VertexRounding vertices;
  const Parameter* parameter = FindTyped(name, ParameterType::kPoint3);
  if (parameter == nullptr) return vertices;
  const std::vector<Vec3f> rounded = ToTriples(parameter->floats);
  // Numbers after the last that was rounded have no remainder.
  std::vector<float> remainders = parameter->remainders;
  if (!remainders.empty()) remainders.resize(parameter->floats.size());
  const std::vector<Vec3f> rest = ToTriples(remainders);
  vertices.Reserve(rounded.size());
  for (size_t i = 0; i < rounded.size(); ++i) {
    vertices.Add(rounded[i], rest.empty() ? Vec3f{} : rest[i]);
  }
  return vertices;
}

void ParameterList::NoteWithoutEffect(const std::string& name, std::string_view why) {
  if (const Parameter* parameter = Find(name)) {
    diagnostics_->Note(parameter->location, absl::StrCat(owner_, ": parameter \"", name,
                                                         "\" has no effect: ", std::string(why)));
  }
}

void ParameterList::IgnoreAll() {
  for (Parameter& parameter : own_) parameter.is_used = true;
}

void ParameterList::ReportUnused() {
  for (const Parameter& parameter : own_) {
    if (parameter.is_used) continue;
    ErrorAt(parameter, absl::StrCat("is unknown here", NearestNameHint(parameter.name, asked_)));
  }
}

}  // namespace sheaf
