// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmbreeScene: the nearest surface along a ray, and whether anything is in the way. The only way to
// Embree (3.13 and 4.x); its types stay in the embree_*.cc files.
//
// Same bits every time, whoever made the processor (docs/adr/0043). The device is pinned to AVX2,
// in which all processors agree but for approximate reciprocals. Those decide where Embree looks,
// with room to spare, and not what it finds: which triangles a ray meets has no division in it, how
// far they are and where they are met is reckoned here, and of several hits at one distance the one
// of the smallest id is the nearest, whatever order they are found in.
//
// Where a mesh holds needles its hits are met again in double (needle.h). Quadrics, bilinear
// patches, curves and placed groups are user geometry, so that they are met in double precision and
// the same under every version of Embree.
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

class EmbreeScene {
 public:
  // kSkipSource keeps rays from meeting the triangle they leave, and says where they meet others;
  // kNone is for measuring what that costs: whether there is a hit, but not where.
  enum class Filters { kSkipSource, kNone };
  // `geometry` must outlive the result: its buffers are not copied. build_threads 0: all of them.
  // Errors: kResourceExhausted where memory runs out, kInternal with Embree's words otherwise.
  static absl::StatusOr<std::unique_ptr<EmbreeScene>> Build(const SceneGeometry& geometry,
                                                            uint32_t build_threads,
                                                            Filters filters = Filters::kSkipSource);
  ~EmbreeScene();

  // Thread safety: const members may be called concurrently.
  bool Intersect(const Ray& ray, RawHit* hit) const;
  bool Occluded(const Ray& ray) const;
  // Traces the rays and does nothing else; returns how many met something. The bare tracer that
  // benchmarks compare with.
  uint64_t Replay(const std::vector<RecordedRay>& rays) const;

  uint64_t memory_bytes() const;

 private:
  EmbreeScene();
  bool IntersectOnce(const Ray& ray, RawHit* hit) const;
  // Whether the camera is in a closed room, as far as probes tell.
  bool EveryProbeMeets() const;
  // Looks again for a ray that cannot truly end in the open (leak_guard.h); finite segments may.
  bool MeetsWhenNudged(const Ray& ray, RawHit* hit) const;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sheaf::render
