// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Directives before WorldBegin: camera, film, filter, sampler and integrator, with pbrt-v4's
// defaults.
#pragma once

#include <string>

#include "common/scene/pbrt/statements/scene_files.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// Values of Camera and Film that affect each other, settled when both are known.
struct PendingFrame {
  bool has_screen_window = false;
  float frame_aspect_ratio = 0;  // 0: that of the film.
  float iso = 100;
  float diagonal_mm = 35;
  bool has_diagonal = false;
  SourceLocation diagonal_location;
};

// files: for the lens and aperture files of a realistic camera.
void SetCamera(const std::string& type, ParameterList& parameters, SceneFiles& files,
               CameraDescription* camera, PendingFrame* frame);
void SetFilm(const std::string& type, ParameterList& parameters, FilmDescription* film,
             PendingFrame* frame);
void SetFilter(const std::string& type, ParameterList& parameters, FilterDescription* filter);
void SetSampler(const std::string& type, ParameterList& parameters, SamplingDescription* sampling);
void SetIntegrator(const std::string& type, ParameterList& parameters,
                   SamplingDescription* sampling);
// Fills in the screen window from the film's aspect ratio, and the exposure from shutter and ISO.
void SettleFrame(const PendingFrame& frame, CameraDescription* camera, FilmDescription* film);

// True if the integrator, as pbrt-v4 defines it, ignores media.
bool IntegratorIgnoresMedia(const std::string& integrator);

}  // namespace sheaf
