// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathHistory: the scattering events of a path so far, in the detail that LightPathKind needs.
// Paths of variants without outputs have a NoHistory, which costs nothing.
#pragma once

#include <algorithm>
#include <cstdint>

#include "common/film/light_path_kind.h"

namespace sheaf::render {

class PathHistory {
 public:
  void AddSurface(bool is_specular) {
    specular_last_ = is_specular;
    if (is_specular) {
      has_specular_ = true;
    } else {
      rough_ = Increased(rough_);
    }
  }
  void AddMedium(bool is_subsurface) {
    specular_last_ = false;
    if (is_subsurface) {
      subsurface_ = true;
    } else {
      media_ = Increased(media_);
    }
  }
  // The kind of light that the path's ray hits.
  LightPathKind KindAtHit() const {
    if (subsurface_) return LightPathKind::kSubsurface;
    if (media_ > 0) {
      const bool once = media_ == 1 && rough_ == 0 && !specular_last_;
      return once ? LightPathKind::kVolumeSingle : LightPathKind::kVolumeMultiple;
    }
    if (rough_ == 0)
      return has_specular_ ? LightPathKind::kSpecularEmission : LightPathKind::kEmission;
    if (specular_last_) return LightPathKind::kCaustic;
    return rough_ == 1 ? LightPathKind::kDirect : LightPathKind::kIndirect;
  }
  // The kind of light that a path from a light brings to the camera, whose vertices were added in
  // reverse. is_specular_first: its first vertex, at which the light arrives, is specular.
  LightPathKind KindFromLight(bool is_specular_first) const {
    PathHistory reversed = *this;
    reversed.specular_last_ = is_specular_first;
    return reversed.KindAtHit();
  }
  // The kind of a light that is sampled from a rough surface, or from a point in a medium.
  LightPathKind KindFromSurface() const {
    PathHistory next = *this;
    next.AddSurface(false);
    return next.KindAtHit();
  }
  LightPathKind KindFromMedium() const {
    PathHistory next = *this;
    next.AddMedium(false);
    return next.KindAtHit();
  }

 private:
  // Counts above 2 are not distinguished.
  static uint8_t Increased(uint8_t count) { return std::min<uint8_t>(count + 1, 2); }

  uint8_t rough_ = 0, media_ = 0;
  bool has_specular_ = false, specular_last_ = false, subsurface_ = false;
};

struct NoHistory {
  void AddSurface(bool) {}
  void AddMedium(bool) {}
  LightPathKind KindAtHit() const { return {}; }
  LightPathKind KindFromLight(bool) const { return {}; }
  LightPathKind KindFromSurface() const { return {}; }
  LightPathKind KindFromMedium() const { return {}; }
};

}  // namespace sheaf::render
