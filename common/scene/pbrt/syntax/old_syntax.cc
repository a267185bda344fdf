// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/syntax/old_syntax.h"

#include <algorithm>
#include <array>
#include <iterator>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

struct OldName {
  const char* directive;
  const char* name;
};
// From pbrt-v3's file format and the renaming done by pbrt --upgrade.
constexpr OldName kOldTypes[] = {
    {"Material", "uber"},
    {"Material", "matte"},
    {"Material", "plastic"},
    {"Material", "metal"},
    {"Material", "glass"},
    {"Material", "mirror"},
    {"Material", "substrate"},
    {"Material", "translucent"},
    {"Material", "disney"},
    {"Material", "fourier"},
    {"Material", "kdsubsurface"},
    {"Film", "image"},
    {"Camera", "environment"},
    {"Integrator", "whitted"},
    {"Integrator", "directlighting"},
    {"Sampler", "lowdiscrepancy"},
    {"Sampler", "02sequence"},
    {"Sampler", "maxmindist"},
    {"Sampler", "random"},
    {"MakeNamedMedium", "heterogeneous"},
};
constexpr OldName kOldParameters[] = {
    {"Material", "Kd"},
    {"Material", "Ks"},
    {"Material", "Kr"},
    {"Material", "Kt"},
    {"Material", "bumpmap"},
    {"Material", "opacity"},
    {"LightSource", "mapname"},
    {"PixelFilter", "xwidth"},
    {"PixelFilter", "ywidth"},
    {"Film", "maxsampleluminance"},
    {"Integrator", "rrthreshold"},
    {"Texture", "trilinear"},
    {"Shape", "st"},
    {"Shape", "nlevels"},
};

template <size_t n>
bool Holds(const OldName (&names)[n], std::string_view directive, std::string_view name) {
  return std::any_of(std::begin(names), std::end(names), [&](const OldName& old) {
    return directive == old.directive && name == old.name;
  });
}

}  // namespace

std::string OldSyntaxIn(std::string_view directive, const std::string& type,
                        const std::vector<Parameter>& parameters) {
  const bool is_named = directive == "MakeNamedMaterial" || directive == "MakeNamedMedium";
  if (directive == "MakeNamedMaterial") directive = "Material";
  if (!is_named && Holds(kOldTypes, directive, type)) {
    return absl::StrCat(std::string(directive), " \"", type, "\"");
  }
  for (const Parameter& parameter : parameters) {
    const bool is_type = parameter.name == "type" && parameter.strings.size() == 1;
    if (is_type && Holds(kOldTypes, directive, parameter.strings[0])) {
      return absl::StrCat("\"string type\" \"", parameter.strings[0], "\"");
    }
    if (Holds(kOldParameters, directive, parameter.name)) {
      return absl::StrCat("parameter \"", parameter.name, "\" of ", std::string(directive));
    }
  }
  return "";
}

bool IsOldParameterType(std::string_view type) { return type == "color" || type == "xyz"; }

std::string OldSyntaxAdvice(std::string_view sign) {
  return absl::StrCat(
      "this is pbrt-v3 (", std::string(sign),
      "), and Sheaf reads pbrt-v4; pbrt-v4's own program rewrites such a file: pbrt --upgrade "
      "old.pbrt > new.pbrt, which updates the names of materials, textures, film and lights; maps "
      "of infinite lights then need imgtool makeequiarea");
}

}  // namespace sheaf
