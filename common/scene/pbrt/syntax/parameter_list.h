// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ParameterList: the typed parameters after a directive ("float radius" 2), retrieved by name. The
// list remembers which names were requested, so that an unused parameter becomes an error that
// lists the valid names.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/scene_description.h"
#include "common/scene/spectrum/primaries.h"
#include "common/scene/vertex_rounding.h"

namespace sheaf {

enum class ParameterType {
  kInteger,
  kFloat,
  kPoint2,
  kVector2,
  kPoint3,
  kVector3,
  kNormal,
  kSpectrum,
  kRgb,
  kBlackbody,
  kBool,
  kString,
  kTexture,
};
// "float", "point3" ...; the spelling used in errors.
std::string_view ParameterTypeName(ParameterType type);
// False if name is not a type of the format. "point", "vector" and "normal3" are spellings of three
// components.
bool ParameterTypeFromName(std::string_view name, ParameterType* type);
// 2 for point2, 3 for rgb, otherwise 1.
size_t ComponentCount(ParameterType type);

struct Parameter {
  ParameterType type = ParameterType::kFloat;
  std::string name;
  SourceLocation location;
  // The values are in the vector that fits the type; a spectrum has floats or one string.
  std::vector<float> floats;
  // For a point3: the parts that rounding to float took; empty if it took nothing.
  std::vector<float> remainders;
  std::vector<int32_t> integers;
  std::vector<std::string> strings;
  std::vector<uint8_t> bools;
  Primaries primaries = Primaries::kSrgb;  // For an rgb: those active where it is written.
  bool is_used = false;

  size_t ValueCount() const {
    return floats.size() + integers.size() + strings.size() + bools.size();
  }
};

class ParameterList {
 public:
  // own come with the directive at `location` called `owner` ('shape "sphere"'). defaults come from
  // Attribute directives; they apply where own has no value, and may stay unused. The latest
  // default wins.
  ParameterList(std::string owner, SourceLocation location, std::vector<Parameter> own,
                std::vector<Parameter> defaults, Diagnostics* diagnostics);

  SourceLocation location() const { return location_; }
  Diagnostics& diagnostics() { return *diagnostics_; }
  const std::string& owner() const { return owner_; }
  void set_owner(std::string owner) { owner_ = std::move(owner); }

  // One value, or fallback if the parameter is absent. A wrong type or count is reported, and the
  // fallback returned.
  float GetFloat(const std::string& name, float fallback);
  int32_t GetInteger(const std::string& name, int32_t fallback);
  bool GetBool(const std::string& name, bool fallback);
  std::string GetString(const std::string& name, const std::string& fallback);
  Vec3d GetPoint3(const std::string& name, Vec3d fallback);
  Vec3f GetVector3(const std::string& name, Vec3f fallback);
  // All values; empty if the parameter is absent.
  std::vector<float> GetFloats(const std::string& name);
  std::vector<std::string> GetStrings(const std::string& name);
  std::vector<Vec2f> GetPoints2(const std::string& name);
  std::vector<Vec3f> GetTriples(const std::string& name, ParameterType type);
  // Vertices, for VertexRounding.
  VertexRounding GetVertices(const std::string& name);

  // All parameters, defaults included, as a text that differs from that of any other list.
  std::string Written() const;

  // The parameter of any type (it counts as used), or nullptr.
  Parameter* Find(const std::string& name);
  bool Has(const std::string& name) { return Find(name) != nullptr; }
  // The parameter, if present and of this type with values; a wrong type is reported.
  Parameter* FindTyped(const std::string& name, ParameterType type);

  // Notes that the parameter, if present, has no effect, and why.
  void NoteWithoutEffect(const std::string& name, std::string_view why);
  // Marks every parameter as used. For directives that are noted as a whole.
  void IgnoreAll();

  void Error(std::string_view text) { diagnostics_->Error(location_, text); }
  void ErrorAt(const Parameter& parameter, std::string_view text);
  void Note(std::string_view text) { diagnostics_->Note(location_, text); }
  // Reports unused parameters. Call once, after the last Get.
  void ReportUnused();

 private:
  Parameter* FindCounted(const std::string& name, ParameterType type, size_t count);

  std::string owner_;
  SourceLocation location_;
  std::vector<Parameter> own_;
  std::vector<Parameter> defaults_;
  std::vector<std::string> asked_;
  Diagnostics* diagnostics_;
};

}  // namespace sheaf
