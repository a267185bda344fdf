// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/option_parameters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/pbrt/statements/supported_names.h"
#include "common/scene/settings/techniques.h"
#include "common/scene/spectrum/primaries.h"
#include "common/scene/spectrum/sensor.h"

namespace sheaf {
namespace {

bool IsOneOf(const std::string& name, std::initializer_list<const char*> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// A parameter of an integrator that says how it works, and its type in pbrt-v4.
struct MethodParameter {
  const char* name = nullptr;
  ParameterType type = ParameterType::kInteger;
};

// pbrt-v4's integrators whose method is not Sheaf's. Source of names, parameters and their meaning:
// src/pbrt/cpu/integrators.cpp of pbrt-v4.
struct OtherIntegrator {
  const char* name;
  const char* mean;  // The facts about the image, compared with pbrt-v4's.
  std::array<MethodParameter, 5> parameters;
};
constexpr char kSameMean[] = "the mean is the same";
constexpr OtherIntegrator kOtherIntegrators[] = {
    {"simplepath",
     kSameMean,
     {{{"samplelights", ParameterType::kBool}, {"samplebsdf", ParameterType::kBool}}}},
    {"simplevolpath", kSameMean, {}},
    {"randomwalk",
     "the image also has the light of mirrors and of lights without size, which pbrt-v4 leaves "
     "out",
     {}},
    {"lightpath",
     "the image also has the light of mirrors and of the sky, which pbrt-v4 leaves out",
     {}},
    {"bdpt",
     kSameMean,
     {{{"visualizestrategies", ParameterType::kBool}, {"visualizeweights", ParameterType::kBool}}}},
    {"mlt",
     "the mean is the same, and samples are independent; the sampler gives their number",
     {{{"bootstrapsamples", ParameterType::kInteger},
       {"chains", ParameterType::kInteger},
       {"mutationsperpixel", ParameterType::kInteger},
       {"largestepprobability", ParameterType::kFloat},
       {"sigma", ParameterType::kFloat}}}},
    {"sppm",
     "light in mirrors and behind smooth glass is merged within two pixels, all other light is "
     "without bias; the layer merge.bias estimates it; maxdepth limits whole paths, not their "
     "parts from the camera and from the light",
     {{{"photonsperiteration", ParameterType::kInteger},
       {"radius", ParameterType::kFloat},
       {"seed", ParameterType::kInteger}}}},
};

const char* MethodOf(TechniqueSet techniques) {
  if (techniques.Has(Technique::kMerging)) {
    return "paths from the camera and from lights, merged where the camera sees light by mirrors "
           "and smooth glass";
  }
  if (techniques.Has(Technique::kLightPathsAlone)) {
    return "paths from lights, and from the camera where those find no light";
  }
  return HasLightPaths(techniques) ? "paths from the camera and from lights"
                                   : "paths from the camera, with sampled lights";
}

// Notes that the parameters are not used. Those of another type than pbrt-v4's are reported.
void IgnoreMethod(const OtherIntegrator& integrator, ParameterList& parameters) {
  for (const MethodParameter& parameter : integrator.parameters) {
    if (parameter.name == nullptr) continue;
    if (parameters.FindTyped(parameter.name, parameter.type) == nullptr) continue;
    parameters.NoteWithoutEffect(parameter.name,
                                 "it concerns how this integrator works in pbrt-v4");
  }
}

void GetCrop(ParameterList& parameters, FilmDescription* film) {
  const Parameter* crop = parameters.FindTyped("cropwindow", ParameterType::kFloat);
  const Parameter* bounds = parameters.FindTyped("pixelbounds", ParameterType::kInteger);
  if (bounds != nullptr) {
    const std::vector<int32_t>& b = bounds->integers;
    if (b.size() != 4 || b[0] >= b[1] || b[2] >= b[3]) {
      parameters.ErrorAt(*bounds, "needs 4 values x0 x1 y0 y1 with x0 < x1 and y0 < y1");
      return;
    }
    film->has_pixel_bounds = true;
    std::copy(b.begin(), b.end(), film->pixel_bounds);
  }
  if (crop == nullptr) return;
  if (bounds != nullptr) {
    parameters.diagnostics().Warning(
        crop->location,
        absl::StrCat(parameters.owner(), ": pixelbounds is given too and overrides cropwindow"));
  }
  std::vector<float> c = crop->floats;
  if (c.size() == 4) {
    // pbrt-v4 accepts either order.
    if (c[0] > c[1]) std::swap(c[0], c[1]);
    if (c[2] > c[3]) std::swap(c[2], c[3]);
  }
  if (c.size() != 4 || !(std::max(c[0], 0.f) < std::min(c[1], 1.f)) ||
      !(std::max(c[2], 0.f) < std::min(c[3], 1.f))) {
    parameters.ErrorAt(*crop, "needs 4 fractions x0 x1 y0 y1 that keep a part of the frame");
    return;
  }
  std::copy(c.begin(), c.end(), film->crop_window);
}

// Adds the extra outputs of pbrt-v4's gbuffer: position, both normals and uv.
void GetGeometryBuffer(ParameterList& parameters, FilmDescription* film) {
  for (const Aov aov : {Aov::kPosition, Aov::kGeometricNormal, Aov::kShadingNormal, Aov::kUv}) {
    film->outputs.Add(aov);
  }
  const std::string space = parameters.GetString("coordinatesystem", "camera");
  if (space != "camera" && space != "world") {
    parameters.ErrorAt(*parameters.Find("coordinatesystem"),
                       absl::StrCat("\"", space, "\" is unknown; use camera or world"));
  }
  film->outputs.camera_space = space == "camera";
}

// The sensor of the film, and the maximum of its responses to one sample.
void GetSensor(ParameterList& parameters, FilmDescription* film) {
  film->sensor = parameters.GetString("sensor", "cie1931");
  if (film->sensor == "cie1931") {
    film->sensor.clear();
  } else if (!IsSensor(film->sensor)) {
    std::vector<std::string> names = SensorNames();
    names.insert(names.begin(), "cie1931");
    parameters.ErrorAt(
        *parameters.Find("sensor"),
        absl::StrCat("\"", film->sensor, "\" is unknown", SupportedNamesHint(film->sensor, names)));
    film->sensor.clear();
  }
  const float clamp = parameters.GetFloat("maxcomponentvalue", INFINITY);
  if (!(clamp > 0)) {
    parameters.ErrorAt(*parameters.Find("maxcomponentvalue"), "must be greater than 0");
  } else if (std::isfinite(clamp)) {
    film->max_component_value = clamp;
    parameters.diagnostics().Note(
        parameters.Find("maxcomponentvalue")->location,
        absl::StrCat(
            parameters.owner(),
            ": parameter \"maxcomponentvalue\" clamps bright samples, as in pbrt-v4: the image is "
            "biased, darker where bright samples are rare; remove it for an unbiased image"));
  }
}

}  // namespace

void SetFilm(const std::string& type, ParameterList& parameters, FilmDescription* film,
             PendingFrame* frame) {
  if (type == "gbuffer") {
    GetGeometryBuffer(parameters, film);
  } else if (type == "spectral") {
    for (const char* name : {"nbuckets", "lambdamin", "lambdamax"}) parameters.Find(name);
    parameters.diagnostics().Warning(parameters.location(),
                                     absl::StrCat(parameters.owner(),
                                                  ": the image is written in red, green and blue; "
                                                  "Sheaf writes no channels of wavelengths"));
  } else if (type != "rgb") {
    parameters.Error(absl::StrCat(parameters.owner(), " is unknown",
                                  SupportedNamesHint(type, {"rgb", "gbuffer"}),
                                  ", and every image has albedo, normal and depth"));
    return;
  }
  film->width_px = parameters.GetInteger("xresolution", 1280);
  film->height_px = parameters.GetInteger("yresolution", 720);
  if (film->width_px < 1 || film->height_px < 1) {
    parameters.Error(absl::StrCat(parameters.owner(), ": a frame of ", film->width_px, " x ",
                                  film->height_px, " pixels is empty"));
  }
  GetCrop(parameters, film);
  film->filename = parameters.GetString("filename", "");
  frame->iso = parameters.GetFloat("iso", 100);
  if (!(frame->iso > 0)) parameters.ErrorAt(*parameters.Find("iso"), "must be greater than 0");
  GetSensor(parameters, film);
  film->white_balance_k = parameters.GetFloat("whitebalance", 0);
  if (film->white_balance_k != 0 &&
      !(film->white_balance_k >= kWhiteBalanceMinK && film->white_balance_k <= kWhiteBalanceMaxK)) {
    parameters.ErrorAt(*parameters.Find("whitebalance"),
                       absl::StrCat("is outside [", kWhiteBalanceMinK, ", ", kWhiteBalanceMaxK,
                                    "] kelvin; give 0 for none"));
  }
  frame->diagonal_mm = parameters.GetFloat("diagonal", 35);
  if (const Parameter* diagonal = parameters.Find("diagonal"); diagonal != nullptr) {
    frame->has_diagonal = true;
    frame->diagonal_location = diagonal->location;
    if (!(frame->diagonal_mm > 0)) parameters.ErrorAt(*diagonal, "must be greater than 0");
  }
  parameters.GetBool("savefp16", true);
  parameters.NoteWithoutEffect("savefp16", "Sheaf writes 32-bit floats");
  parameters.ReportUnused();
}

void SetFilter(const std::string& type, ParameterList& parameters, FilterDescription* filter) {
  float radius = 0;
  if (type == "box") {
    filter->kind = FilterDescription::Kind::kBox;
    radius = 0.5f;
  } else if (type == "triangle") {
    filter->kind = FilterDescription::Kind::kTriangle;
    radius = 2;
  } else if (type == "gaussian") {
    filter->kind = FilterDescription::Kind::kGaussian;
    radius = 1.5f;
    filter->sigma = parameters.GetFloat("sigma", 0.5f);
    if (!(filter->sigma > 0))
      parameters.ErrorAt(*parameters.Find("sigma"), "must be greater than 0");
  } else if (type == "mitchell") {
    filter->kind = FilterDescription::Kind::kMitchell;
    radius = 2;
    filter->b = parameters.GetFloat("B", 1.f / 3);
    filter->c = parameters.GetFloat("C", 1.f / 3);
  } else if (type == "sinc") {
    filter->kind = FilterDescription::Kind::kSinc;
    radius = 4;
    filter->tau = parameters.GetFloat("tau", 3);
    if (!(filter->tau > 0)) parameters.ErrorAt(*parameters.Find("tau"), "must be greater than 0");
  } else {
    parameters.Error(absl::StrCat(
        parameters.owner(), " is not supported",
        SupportedNamesHint(type, {"box", "triangle", "gaussian", "mitchell", "sinc"})));
    return;
  }
  filter->radius_x_px = parameters.GetFloat("xradius", radius);
  filter->radius_y_px = parameters.GetFloat("yradius", radius);
  for (const char* name : {"xradius", "yradius"}) {
    const float value = name[0] == 'x' ? filter->radius_x_px : filter->radius_y_px;
    if (!(value > 0)) parameters.ErrorAt(*parameters.Find(name), "must be greater than 0");
  }
  parameters.ReportUnused();
}

void SetSampler(const std::string& type, ParameterList& parameters, SamplingDescription* sampling) {
  sampling->sampler = type;
  bool is_alike = false;  // Owen-scrambled Sobol' points in pbrt-v4, too: no note.
  if (type == "stratified") {
    const int64_t samples =
        int64_t{parameters.GetInteger("xsamples", 4)} * parameters.GetInteger("ysamples", 4);
    parameters.GetBool("jitter", true);
    if (samples < 1 || samples > (int64_t{1} << 30)) {
      parameters.Error(absl::StrCat(parameters.owner(), ": ", samples,
                                    " samples per pixel are not "
                                    "between 1 and 2^30"));
      return;
    }
    sampling->samples_per_pixel = static_cast<int32_t>(samples);
  } else if (IsOneOf(type,
                     {"zsobol", "sobol", "paddedsobol", "halton", "independent", "pmj02bn"})) {
    sampling->samples_per_pixel = parameters.GetInteger("pixelsamples", 16);
    const std::string randomization = parameters.GetString("randomization", "");
    is_alike = type.ends_with("sobol") && IsOneOf(randomization, {"", "fastowen", "owen"});
    if (sampling->samples_per_pixel < 1) {
      parameters.ErrorAt(*parameters.Find("pixelsamples"), "must be at least 1");
    }
  } else {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  " is unknown; pbrt-v4 has zsobol, sobol, "
                                  "paddedsobol, halton, independent, stratified and pmj02bn"));
    return;
  }
  if (parameters.Has("seed")) {
    sampling->seed = static_cast<uint64_t>(int64_t{parameters.GetInteger("seed", 0)});
  }
  if (!is_alike) {
    parameters.diagnostics().Note(parameters.location(),
                                  absl::StrCat(parameters.owner(),
                                               ": Sheaf always uses Owen-scrambled "
                                               "Sobol' points; only the number of samples and the "
                                               "seed are taken from the file"));
  }
  parameters.ReportUnused();
}

bool IntegratorIgnoresMedia(const std::string& integrator) {
  return IsOneOf(integrator, {"path", "simplepath", "lightpath", "randomwalk", "sppm"});
}

void SetIntegrator(const std::string& type, ParameterList& parameters,
                   SamplingDescription* sampling) {
  if (IsOneOf(type, {"ambientocclusion", "function"})) {
    parameters.Error(absl::StrCat(
        parameters.owner(),
        " is not supported, because it does not show the light of the scene; use volpath or path"));
    return;
  }
  const bool is_ours = IsOneOf(type, {"path", "volpath"});
  const auto other = std::find_if(std::begin(kOtherIntegrators), std::end(kOtherIntegrators),
                                  [&](const OtherIntegrator& o) { return type == o.name; });
  if (!is_ours && other == std::end(kOtherIntegrators)) {
    parameters.Error(absl::StrCat(parameters.owner(), " is unknown; use volpath or path"));
    return;
  }
  sampling->integrator = type;
  sampling->max_depth = parameters.GetInteger("maxdepth", 5);
  if (sampling->max_depth < 0) parameters.ErrorAt(*parameters.Find("maxdepth"), "is negative");
  if (parameters.GetBool("regularize", false)) {
    parameters.NoteWithoutEffect(
        "regularize", "Sheaf keeps smooth surfaces smooth, as the image would be biased otherwise");
  }
  for (const char* name : {"lightsampler", "lightsamplestrategy"}) {
    parameters.NoteWithoutEffect(name, "Sheaf has its own light sampling");
  }
  if (!is_ours) {
    IgnoreMethod(*other, parameters);
    const TechniqueSet techniques = TechniquesOfIntegrator(type);
    parameters.Note(absl::StrCat(parameters.owner(), " is read as --techniques ", techniques.Name(),
                                 ": ", MethodOf(techniques), "; ", other->mean));
  }
  parameters.ReportUnused();
}

void SettleFrame(const PendingFrame& frame, CameraDescription* camera, FilmDescription* film) {
  // An image is the average over the shutter interval, so a short interval does not darken it, and
  // one of length 0 gives a still. With a camera's sensor the scene is about exposures, and the
  // length counts, as in pbrt-v4.
  film->exposure_scale = frame.iso / 100;
  const float shutter = camera->shutter_close - camera->shutter_open;
  if (!film->sensor.empty() && shutter > 0) film->exposure_scale *= shutter;
  camera->lens.film_diagonal_mm = frame.diagonal_mm;
  if (frame.has_screen_window) return;
  const double aspect = frame.frame_aspect_ratio > 0
                            ? double{frame.frame_aspect_ratio}
                            : static_cast<double>(film->width_px) / film->height_px;
  const double x = aspect > 1 ? aspect : 1;
  const double y = aspect > 1 ? 1 : 1 / aspect;
  const double window[4] = {-x, x, -y, y};
  std::copy(std::begin(window), std::end(window), camera->screen_window);
}

}  // namespace sheaf
