// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmbreeScene: finds the nearest surface along a ray, and tests occlusion. The only interface to
// Embree (3.13 and 4.x); its types stay in the embree_*.cc files.
//
// Results are bit-identical on all processors (docs/adr/0043). The device is restricted to AVX2, in
// which processors agree except for approximate reciprocals. Those only affect where Embree
// searches, with a safety margin, not its results: the test whether a ray hits a triangle has no
// division, distances and positions are computed here. Where distances cannot tell hits apart they
// are compared in double, and surfaces at one place by their order in space (contact.h), in
// whatever order they are found.
//
// Embree widens triangles by about 2^-23, so that rays on shared edges meet one of the neighbors.
// Where there is no neighbor, a ray beside a triangle passes it (docs/adr/0104).
//
// Hits of meshes with needles are tested again in double (needle.h). Quadrics, bilinear patches,
// curves and placed groups are user geometry, so that they are intersected in double and equally
// under every version of Embree.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "worker/render/geometry/raw_hit.h"
#include "worker/render/geometry/ray_origin.h"
#include "worker/render/geometry/scene_geometry.h"

namespace sheaf::render {

struct RecordedRay {
  Ray ray;
  bool is_shadow = false;
};

// Whether light passes along a ray.
enum class Passage : uint8_t {
  kOpen,     // The ray meets nothing.
  kBlocked,  // It meets a surface that lets no ray pass.
  kUnknown,  // Its nearest hit tells.
};

class EmbreeScene {
 public:
  // kSkipSource makes rays skip the triangle they leave, and computes hit positions. kNone is for
  // measuring that cost: it finds whether there is a hit, but not where.
  enum class Filters { kSkipSource, kNone };
  // `geometry` must outlive the result: its buffers are not copied. build_threads 0: all available.
  // Errors: kResourceExhausted if memory runs out, otherwise kInternal with Embree's message.
  static absl::StatusOr<std::unique_ptr<EmbreeScene>> Build(const SceneGeometry& geometry,
                                                            uint32_t build_threads,
                                                            Filters filters = Filters::kSkipSource);
  ~EmbreeScene();
  // Call once, before rays are traced, if no light comes from outside the scene (leak_guard.h).
  void NoteOutsideIsDark();

  // Thread safety: const members may be called concurrently.
  bool Intersect(const Ray& ray, RawHit* hit) const;
  bool Occluded(const Ray& ray) const;
  // Occluded, in scenes with surfaces that let rays pass: asks without looking for the nearest hit.
  Passage PassageOf(const Ray& ray) const;
  // Traces the rays without any other work; returns the number of hits. The baseline of benchmarks.
  uint64_t Replay(const std::vector<RecordedRay>& rays) const;

  uint64_t memory_bytes() const;

 private:
  EmbreeScene();

  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sheaf::render
