// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightTries: the light samples of a training, from which regions learn how to choose lights:
// where lights are hidden, and where less or more comes from them than estimates say.
//
// The result is a function of the set of tries alone, in integers: neither their order nor the
// number of threads matters. Scaling the scene's lengths or its light by a power of two changes no
// bit: a try holds ratios of like quantities.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/base/mutex.h"
#include "worker/render/geometry/bounds.h"
#include "worker/render/guiding/guiding_field.h"
#include "worker/render/guiding/guiding_sink.h"
#include "worker/render/guiding/light_rows.h"
#include "worker/render/light/choice/light_visibility.h"

namespace sheaf::render {

// A training ends once it has this many tries. It looks after every kLightPathsAtOnce paths, so it
// has at most that many times kTrainingVerticesMax more: 56 MB.
inline constexpr size_t kLightTriesMax = size_t{1} << 20;
inline constexpr uint64_t kLightPathsAtOnce = uint64_t{1} << 13;
// A region with more tries is halved.
inline constexpr double kLightRegionTries = 256;

// Add may be called from many threads; the other functions, when they are done.
class LightTries {
 public:
  // choice outlives *this. Tries are samples of lights that were chosen by it without a row.
  explicit LightTries(const LightChoice& choice) : choice_(choice) {}

  void Add(const TriedLight& tried);
  size_t size() const;
  // Regions of the box that have learned no directions, halved where many tries are. At most
  // kGuidingRegionsMax.
  GuidingField MakeRegions(const Bounds& box) const;
  // The rows that the regions learn.
  LightVisibility Learn(const GuidingField& regions) const;

 private:
  struct Located {
    GuidingPoint from;
    LightTry what;
  };
  static constexpr size_t kShards = 16;
  struct Shard {
    mutable Mutex mutex;
    std::vector<Located> tries ABSL_GUARDED_BY(mutex);
  };
  // Calls visit(located) for each.
  template <typename Visit>
  void ForEach(const Visit& visit) const;

  const LightChoice& choice_;
  std::array<Shard, kShards> shards_;
};

}  // namespace sheaf::render
