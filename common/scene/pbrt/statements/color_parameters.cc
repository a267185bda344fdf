// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/color_parameters.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/scene/spectrum/primaries.h"
#include "common/scene/spectrum/spectrum.h"

namespace sheaf {
namespace {

std::string SetSamples(const std::vector<float>& numbers, ColorSpec* color) {
  if (numbers.empty() || numbers.size() % 2 != 0) {
    return absl::StrCat("needs pairs of wavelength in nm and value, but has ", numbers.size(),
                        " numbers");
  }
  color->kind = ColorSpec::Kind::kSampled;
  for (size_t i = 0; i < numbers.size(); i += 2) {
    if (i > 0 && numbers[i] <= color->wavelengths_nm.back()) {
      return absl::StrCat("has wavelengths that do not increase: ", numbers[i], " nm after ",
                          color->wavelengths_nm.back(), " nm");
    }
    color->wavelengths_nm.push_back(numbers[i]);
    color->values.push_back(numbers[i + 1]);
  }
  return "";
}

std::string SetNamed(const std::string& name, SceneFiles& files, ColorSpec* color) {
  color->name = name;
  if (IsNamedSpectrum(name)) {
    color->kind = ColorSpec::Kind::kNamed;
    return "";
  }
  const std::string file = CanonicalFileName(name);
  if (const auto path = files.LocalPath(file); !path.ok()) {
    return absl::StrCat("names no known spectrum, and ", path.status().message(),
                        NearestNameHint(name, NamedSpectra()));
  }
  const absl::StatusOr<const std::vector<float>*> numbers = files.SpectrumNumbers(file);
  const std::string error =
      numbers.ok() ? SetSamples(**numbers, color) : std::string(numbers.status().message());
  if (!error.empty()) return absl::StrCat("cannot use the spectrum file \"", name, "\": ", error);
  return "";
}

std::string SetRgb(const Parameter& parameter, ColorRole role, ColorSpec* color) {
  if (parameter.floats.size() != 3) {
    return absl::StrCat("needs 3 values but has ", parameter.floats.size());
  }
  const Rgb written{parameter.floats[0], parameter.floats[1], parameter.floats[2]};
  if (std::min({written.r, written.g, written.b}) < 0) {
    return "has a negative component; colors must be 0 or more";
  }
  if (role == ColorRole::kReflectance && MaxComponent(written) > 1) {
    return "has a component greater than 1; a surface cannot reflect more light than it receives";
  }
  const Rgb srgb = SrgbFromPrimaries(written, parameter.primaries, role);
  // Colors on the edge of the gamut may leave it by rounding.
  constexpr float kTolerance = 1e-4f;
  for (size_t i = 0; i < 3; ++i) {
    color->rgb[i] = std::max(srgb[i], 0.f);
    if (role == ColorRole::kReflectance) color->rgb[i] = std::min(color->rgb[i], 1.f);
    const float beyond = std::fabs(srgb[i] - color->rgb[i]);
    if (beyond > kTolerance * MaxComponent(written)) color->is_out_of_gamut = true;
  }
  if (color->is_out_of_gamut) color->true_rgb = srgb;
  return "";
}

std::string SetBlackbody(const Parameter& parameter, ColorSpec* color) {
  if (parameter.floats.size() != 1) {
    return absl::StrCat("needs one temperature in kelvin but has ", parameter.floats.size(),
                        " values");
  }
  color->kind = ColorSpec::Kind::kBlackbody;
  color->temperature_k = parameter.floats[0];
  // Below this, the visible part of Planck's law underflows double arithmetic.
  constexpr float kTemperatureMin = 100;
  if (!(color->temperature_k >= kTemperatureMin)) {
    return absl::StrCat("is a temperature below ", kTemperatureMin, " K, which gives no light");
  }
  return "";
}

}  // namespace

ColorSpec RgbColor(Rgb rgb) {
  ColorSpec color;
  color.rgb = rgb;
  return color;
}

ColorSpec GetColor(ParameterList& parameters, const std::string& name, ColorRole role,
                   const ColorSpec& fallback, SceneFiles& files) {
  const Parameter* parameter = parameters.Find(name);
  if (parameter == nullptr) return fallback;
  ColorSpec color;
  std::string error;
  switch (parameter->type) {
    case ParameterType::kRgb:
      error = SetRgb(*parameter, role, &color);
      break;
    case ParameterType::kBlackbody:
      error = SetBlackbody(*parameter, &color);
      break;
    case ParameterType::kSpectrum:
      if (parameter->strings.size() == 1 && parameter->floats.empty()) {
        error = SetNamed(parameter->strings[0], files, &color);
      } else if (parameter->strings.empty()) {
        error = SetSamples(parameter->floats, &color);
      } else {
        error = "needs either numbers or one name";
      }
      break;
    default:
      error = absl::StrCat("must be of type rgb, spectrum or blackbody, not ",
                           std::string(ParameterTypeName(parameter->type)));
  }
  if (!error.empty()) {
    parameters.ErrorAt(*parameter, error);
    return fallback;
  }
  color.rgb = SpectrumToRgb(color, role);
  if (color.is_out_of_gamut) {
    parameters.diagnostics().Note(
        parameter->location,
        absl::StrCat(parameters.owner(), ": \"", name,
                     "\" is outside the gamut of sRGB: spectral transport keeps it, RGB transport "
                     "takes the nearest color in the gamut, channel by channel"));
  }
  return color;
}

}  // namespace sheaf
