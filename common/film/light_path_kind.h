// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightPathKind: classifies the path of light from an emitter to the camera. Every contribution to
// an image is of one kind. "Rough" is every surface that is not a perfect mirror or smooth glass.
// Source: the notation is Heckbert's, of whose kinds these are unions: Heckbert 1990, "Adaptive
// Radiosity Textures for Bidirectional Ray Tracing".
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace sheaf {

enum class LightPathKind : uint8_t {
  kEmission,          // E L
  kSpecularEmission,  // E S+ L
  kDirect,            // E S* D L
  kIndirect,          // E (S | D)* D L with two D or more
  kCaustic,           // E (S | D)* D S+ L
  kVolumeSingle,      // As kDirect, scattered by a medium instead of a surface.
  kVolumeMultiple,    // All other light scattered by a medium.
  kSubsurface,        // Through the interior beneath a surface.
  kVolumeEmission,    // Emitted by media, along any path.
  kCount
};
inline constexpr size_t kLightPathKindCount = static_cast<size_t>(LightPathKind::kCount);

struct LightPathName {
  const char* name;  // Name of the layer in images; part of stored jobs: append, never rename.
  const char* meaning;
};
inline constexpr std::array<LightPathName, kLightPathKindCount> kLightPathNames{{
    {"emission", "lights and sky that the camera sees"},
    {"specular-emission", "lights and sky seen in mirrors and through smooth glass"},
    {"direct", "light scattered by one rough surface"},
    {"indirect", "light scattered several times by rough surfaces"},
    {"caustic", "light cast by mirrors or smooth glass onto a rough surface"},
    {"volume-single", "light scattered once by a medium"},
    {"volume-multiple", "light scattered several times by media, or by media and surfaces"},
    {"subsurface", "light scattered beneath a surface"},
    {"volume-emission", "emission of media"},
}};

}  // namespace sheaf
