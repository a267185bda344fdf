// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The shapes of emitters, for the files of LightEmission: their area and the side that emits.
#pragma once

#include <cstdint>

#include "common/math/elementary.h"
#include "worker/render/light/light_table_impl.h"

namespace sheaf::render {

inline double AreaOf(const TriangleEmitter& t) {
  const Vec3d v0 = ToDouble(t.v0);
  return 0.5 * Length(Cross(ToDouble(t.v1) - v0, ToDouble(t.v2) - v0));
}
inline double AreaOf(const SphereEmitter& s) { return 4 * kPi * s.radius * s.radius; }
inline double AreaOf(const DiskEmitter& d) {
  return kPi * (d.radius - d.inner_radius) * (d.radius + d.inner_radius);
}

inline bool IsInward(const TriangleEmitter&) { return false; }
inline bool IsInward(const SphereEmitter& s) { return s.inward; }
inline bool IsInward(const DiskEmitter&) { return false; }

// Calls f with the emitter. Requires: emitter < impl.first_delta().
template <typename F>
auto WithEmitter(const LightTable::Impl& impl, uint32_t emitter, const F& f) {
  if (emitter < impl.first_sphere()) return f(impl.triangles[emitter]);
  if (emitter < impl.first_disk()) return f(impl.spheres[emitter - impl.first_sphere()]);
  return f(impl.disks[emitter - impl.first_disk()]);
}

}  // namespace sheaf::render
