// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Camera directives.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/scene/formats/lens_reader.h"
#include "common/scene/pbrt/statements/option_parameters.h"
#include "common/scene/pbrt/statements/supported_names.h"

namespace sheaf {
namespace {

constexpr int32_t kBladesMax = 64;
constexpr size_t kShutterNumbersMax = 2 * 1024;

// An extension of Sheaf: a name, or pairs of time and openness.
void GetShutterShape(ParameterList& parameters, CameraDescription* camera) {
  const Parameter* given = parameters.Find("shuttershape");
  if (given == nullptr) return;
  if (given->type == ParameterType::kString) {
    const std::string name = parameters.GetString("shuttershape", "box");
    if (name == "triangle") {
      camera->shutter_shape = {{0, 0}, {0.5f, 1}, {1, 0}};
    } else if (name == "trapezoid") {
      camera->shutter_shape = {{0, 0}, {0.25f, 1}, {0.75f, 1}, {1, 0}};
    } else if (name != "box") {
      parameters.ErrorAt(
          *given, absl::StrCat("\"", name,
                               "\" is unknown; use box, triangle, trapezoid or pairs of numbers"));
    }
    return;
  }
  const std::vector<float> pairs = parameters.GetFloats("shuttershape");
  bool valid = pairs.size() >= 4 && pairs.size() % 2 == 0 && pairs.size() <= kShutterNumbersMax;
  bool opens = false;
  for (size_t i = 0; valid && i < pairs.size(); i += 2) {
    valid = pairs[i + 1] >= 0 && std::isfinite(pairs[i + 1]) &&
            (i == 0 ? pairs[i] == 0 : pairs[i] > pairs[i - 2]);
    opens |= pairs[i + 1] > 0;
    camera->shutter_shape.push_back({pairs[i], pairs[i + 1]});
  }
  if (!valid || !opens || pairs[pairs.size() - 2] != 1) {
    parameters.ErrorAt(*given,
                       absl::StrCat("needs pairs of time, ascending from 0 to 1, and openness, at "
                                    "least 0 and not always 0; at most ",
                                    kShutterNumbersMax / 2, " pairs"));
    camera->shutter_shape.clear();
  }
}

void GetShutter(ParameterList& parameters, CameraDescription* camera) {
  camera->shutter_open = parameters.GetFloat("shutteropen", 0);
  camera->shutter_close = parameters.GetFloat("shutterclose", 1);
  if (camera->shutter_close < camera->shutter_open) {
    parameters.diagnostics().Warning(
        parameters.location(),
        absl::StrCat(parameters.owner(), ": shutterclose is before shutteropen; they are swapped"));
    std::swap(camera->shutter_open, camera->shutter_close);
  }
  if (camera->shutter_close == camera->shutter_open) {
    parameters.diagnostics().Note(
        parameters.location(),
        absl::StrCat(parameters.owner(), ": the shutter opens and closes at ", camera->shutter_open,
                     ": the image shows the scene at that time"));
  }
  GetShutterShape(parameters, camera);
}

void GetWindow(ParameterList& parameters, CameraDescription* camera, PendingFrame* frame) {
  frame->frame_aspect_ratio = parameters.GetFloat("frameaspectratio", 0);
  if (parameters.Has("frameaspectratio") && !(frame->frame_aspect_ratio > 0)) {
    parameters.ErrorAt(*parameters.Find("frameaspectratio"), "must be greater than 0");
    frame->frame_aspect_ratio = 0;
  }
  const Parameter* parameter = parameters.FindTyped("screenwindow", ParameterType::kFloat);
  if (parameter == nullptr) return;
  const std::vector<float>& w = parameter->floats;
  if (w.size() != 4 || !(w[0] < w[1]) || !(w[2] < w[3])) {
    parameters.ErrorAt(*parameter, "needs 4 values x0 x1 y0 y1 with x0 < x1 and y0 < y1");
    return;
  }
  frame->has_screen_window = true;
  std::copy(w.begin(), w.end(), camera->screen_window);
}

void GetLens(ParameterList& parameters, CameraDescription* camera) {
  camera->lens_radius = parameters.GetFloat("lensradius", 0);
  camera->focal_distance = parameters.GetFloat("focaldistance", 1e6f);
  if (!(camera->lens_radius >= 0)) {
    parameters.ErrorAt(*parameters.Find("lensradius"), "is negative");
  }
  if (!(camera->focal_distance > 0)) {
    parameters.ErrorAt(*parameters.Find("focaldistance"), "must be greater than 0");
  }
  camera->blade_count = parameters.GetInteger("blades", 0);
  if (camera->blade_count != 0 && (camera->blade_count < 3 || camera->blade_count > kBladesMax)) {
    parameters.ErrorAt(*parameters.Find("blades"),
                       absl::StrCat("must be 0, for a round lens, or from 3 to ", kBladesMax));
    camera->blade_count = 0;
  }
  camera->blade_rotation_degrees = parameters.GetFloat("bladerotation", 0);
  if (camera->blade_count == 0) {
    parameters.NoteWithoutEffect("bladerotation", "the lens is round; give \"integer blades\"");
  } else if (camera->lens_radius == 0) {
    parameters.NoteWithoutEffect("blades", "a pinhole has no blades; give \"float lensradius\"");
  }
}

// An extension of Sheaf; Mitsuba 3 names the planes near_clip and far_clip.
void GetClipPlanes(ParameterList& parameters, CameraDescription* camera) {
  constexpr float kNone = std::numeric_limits<float>::infinity();
  camera->near_clip = parameters.GetFloat("nearclip", 0);
  camera->far_clip = parameters.GetFloat("farclip", kNone);
  if (!(camera->near_clip >= 0)) {
    parameters.ErrorAt(*parameters.Find("nearclip"), "is negative");
    camera->near_clip = 0;
  }
  if (!(camera->far_clip > camera->near_clip)) {
    const Parameter* far = parameters.Find("farclip");
    parameters.ErrorAt(far != nullptr ? *far : *parameters.Find("nearclip"),
                       "leaves nothing to see; give nearclip less than farclip");
    camera->near_clip = 0;
    camera->far_clip = kNone;
  }
}

void GetAperture(ParameterList& parameters, SceneFiles& files, LensDescription* lens) {
  using Aperture = LensDescription::Aperture;
  const std::string aperture = parameters.GetString("aperture", "");
  if (aperture.empty()) return;
  static constexpr std::pair<const char*, Aperture> kShapes[] = {{"gaussian", Aperture::kGaussian},
                                                                 {"square", Aperture::kSquare},
                                                                 {"pentagon", Aperture::kPentagon},
                                                                 {"star", Aperture::kStar}};
  for (const auto& [name, shape] : kShapes) {
    if (aperture != name) continue;
    lens->aperture = shape;
    return;
  }
  lens->aperture = Aperture::kImage;
  lens->aperture_file = CanonicalFileName(aperture);
  if (const auto path = files.LocalPath(lens->aperture_file); !path.ok()) {
    parameters.ErrorAt(
        *parameters.Find("aperture"),
        absl::StrCat("is not gaussian, square, pentagon or star, and not a readable image: ",
                     path.status().message()));
  }
}

void GetRealistic(ParameterList& parameters, SceneFiles& files, LensDescription* lens) {
  lens->aperture_diameter_mm = parameters.GetFloat("aperturediameter", 1);
  lens->focus_distance_m = parameters.GetFloat("focusdistance", 10);
  for (const char* name : {"aperturediameter", "focusdistance"}) {
    const float value = name[0] == 'a' ? lens->aperture_diameter_mm : lens->focus_distance_m;
    if (!(value > 0)) parameters.ErrorAt(*parameters.Find(name), "must be greater than 0");
  }
  GetAperture(parameters, files, lens);
  const std::string file = parameters.GetString("lensfile", "");
  if (file.empty()) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  " needs a lens; give \"string lensfile\" its prescription"));
    return;
  }
  lens->file = CanonicalFileName(file);
  const Parameter& place = *parameters.Find("lensfile");
  const absl::StatusOr<std::string> path = files.PathToRead(lens->file);
  absl::StatusOr<std::vector<LensSurface>> surfaces =
      path.ok() ? ReadLens(lens->file, *path) : path.status();
  if (!surfaces.ok()) {
    parameters.ErrorAt(place, absl::StrCat("cannot be read: ", surfaces.status().message()));
    return;
  }
  lens->surfaces = *std::move(surfaces);
  double stop_mm = 0;
  for (size_t i = 0; i < lens->surfaces.size(); ++i) {
    if (IsStop(*lens, i)) stop_mm = std::max(stop_mm, lens->surfaces[i].aperture_diameter_mm);
  }
  if (stop_mm == 0) {
    for (const char* name : {"aperturediameter", "aperture"}) {
      parameters.NoteWithoutEffect(name, "the lens file has no stop, a surface of radius 0 in air");
    }
  } else if (lens->aperture_diameter_mm > static_cast<float>(stop_mm)) {
    parameters.diagnostics().Warning(
        parameters.location(),
        absl::StrCat(parameters.owner(), ": aperturediameter ", lens->aperture_diameter_mm,
                     " mm is more than the lens has; its ", stop_mm, " mm are used"));
  }
}

// A spherical camera has neither lens nor screen. pbrt-v4 reads the parameters of both and ignores
// them.
void GetMapping(ParameterList& parameters, CameraDescription* camera) {
  const std::string mapping = parameters.GetString("mapping", "equalarea");
  if (mapping == "equalarea") {
    camera->kind = CameraDescription::Kind::kEqualArea;
  } else if (mapping == "equirectangular") {
    camera->kind = CameraDescription::Kind::kEquirectangular;
  } else {
    parameters.ErrorAt(*parameters.Find("mapping"),
                       absl::StrCat("\"", mapping, "\" is not supported",
                                    SupportedNamesHint(mapping, {"equalarea", "equirectangular"})));
  }
  for (const char* name : {"lensradius", "focaldistance"}) {
    parameters.FindTyped(name, ParameterType::kFloat);
    parameters.NoteWithoutEffect(name, "a spherical camera has no lens");
  }
  for (const char* name : {"frameaspectratio", "screenwindow"}) {
    parameters.FindTyped(name, ParameterType::kFloat);
    parameters.NoteWithoutEffect(name, "a spherical camera's image is the whole sphere");
  }
}

}  // namespace

void SetCamera(const std::string& type, ParameterList& parameters, SceneFiles& files,
               CameraDescription* camera, PendingFrame* frame) {
  if (type == "perspective") {
    camera->kind = CameraDescription::Kind::kPerspective;
    camera->fov_degrees = parameters.GetFloat("fov", 90);
    if (!(camera->fov_degrees > 0 && camera->fov_degrees < 180)) {
      parameters.Error(absl::StrCat(parameters.owner(), ": fov ", camera->fov_degrees,
                                    " is outside (0, 180) degrees"));
    }
  } else if (type == "orthographic") {
    camera->kind = CameraDescription::Kind::kOrthographic;
  } else if (type == "spherical") {
    GetMapping(parameters, camera);
  } else if (type == "realistic") {
    camera->kind = CameraDescription::Kind::kRealistic;
    GetRealistic(parameters, files, &camera->lens);
  } else {
    parameters.Error(absl::StrCat(
        parameters.owner(), " is not supported",
        SupportedNamesHint(type, {"perspective", "orthographic", "spherical", "realistic"})));
    return;
  }
  GetShutter(parameters, camera);
  GetClipPlanes(parameters, camera);
  if (!camera->IsSpherical() && !camera->IsRealistic()) {
    GetWindow(parameters, camera, frame);
    GetLens(parameters, camera);
  }
  parameters.ReportUnused();
}

}  // namespace sheaf
