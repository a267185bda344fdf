// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The table of compiled variants.
#include "worker/render/integrator/variants.h"

#include <iterator>

#include "common/base/check.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

#define SHEAF_VARIANT_ENTRY(name, traits) &RenderRow<(traits)>,
constexpr RenderRowFunction kRows[] = {SHEAF_RENDER_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY

#define SHEAF_VARIANT_ENTRY(name, traits) &RenderRow<(traits), PathKind::kCameraBesideLight>,
constexpr RenderRowFunction kRowsBesideLight[] = {SHEAF_LIGHT_PATH_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY
#define SHEAF_VARIANT_ENTRY(name, traits) &GatherRow<(traits)>,
constexpr GatherRowFunction kGatherRows[] = {SHEAF_LIGHT_PATH_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY
#define SHEAF_VARIANT_ENTRY(name, traits) &TraceLightRow<(traits)>,
constexpr LightRowFunction kLightRows[] = {SHEAF_LIGHT_PATH_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY
#define SHEAF_VARIANT_ENTRY(name, traits) &TrainPaths<(traits)>,
constexpr TrainingFunction kTrainings[] = {SHEAF_RENDER_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY
#define SHEAF_VARIANT_ENTRY(name, traits) &TrainPaths<(traits), PathKind::kCameraBesideLight>,
constexpr TrainingFunction kTrainingsBesideLight[] = {
    SHEAF_LIGHT_PATH_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY
#define SHEAF_VARIANT_ENTRY(name, traits) &TrainLightPaths<(traits)>,
constexpr LightTrainingFunction kLightTrainings[] = {
    SHEAF_LIGHT_PATH_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY

}  // namespace

RenderRowFunction RowFunctionOf(size_t variant) {
  SHEAF_CHECK(variant < std::size(kRows));
  return kRows[variant];
}

RenderRowFunction RowBesideLightOf(size_t variant) {
  SHEAF_CHECK(variant < std::size(kRowsBesideLight));
  return kRowsBesideLight[variant];
}

GatherRowFunction GatherRowFunctionOf(size_t variant) {
  SHEAF_CHECK(variant < std::size(kGatherRows));
  return kGatherRows[variant];
}

LightRowFunction LightRowFunctionOf(size_t variant) {
  SHEAF_CHECK(variant < std::size(kLightRows));
  return kLightRows[variant];
}

TrainingFunction TrainingFunctionOf(size_t variant) {
  SHEAF_CHECK(variant < std::size(kTrainings));
  return kTrainings[variant];
}

TrainingFunction TrainingBesideLightOf(size_t variant) {
  SHEAF_CHECK(variant < std::size(kTrainingsBesideLight));
  return kTrainingsBesideLight[variant];
}

LightTrainingFunction LightTrainingFunctionOf(size_t variant) {
  SHEAF_CHECK(variant < std::size(kLightTrainings));
  return kLightTrainings[variant];
}

}  // namespace sheaf::render
