// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VisitFields(view, visit) calls visit(field, member) for every field of a view: each is described
// once, beside its struct. Messages (view/messages), the JSON of the HTTP port and of the command
// line (view/json), and the types of the page (dashboard/src/views.ts) follow. A new field of a
// view needs a member and a line here, its value (farm/queries) and, unless only HTTP shows it, a
// field of its message.
#pragma once

#include <optional>
#include <type_traits>

#include "common/film/error/rare_layers.h"
#include "common/film/tile_geometry.h"
#include "common/scene/settings/frame_settings_fields.h"
#include "coordinator/core/job/job.h"
#include "coordinator/core/job/stop_rule.h"
#include "coordinator/forecast/refinement_price.h"

namespace sheaf::coordinator {

struct ViewField {
  // In JSON and, unless in_message differs, in the message. Those of durations end in "_seconds",
  // and messages leave that out.
  const char* name;
  // The path of the message's field: "spec.scene.sha256_hex". Empty: its name.
  const char* in_message = "";
  // kInMessageElsewhere: the field is not in the view's own message, and code writes it.
  enum class Shown { kEverywhere, kOnlyHttp, kNotHttp, kOnlyMessages, kInMessageElsewhere };
  Shown shown = Shown::kEverywhere;
  // JSON has null for 0 and empty texts, which stand for unknown values or for no limit.
  bool null_if_empty = false;
  const char* prefix = "";  // The collection of a name, "jobs/", before the member's value.
  // For a frame's settings: those of this kind, which JSON has among the frame's fields.
  SettingField::Shown settings = SettingField::Shown::kNowhere;
};

// The view or its const version: one function visits fields to write and fields to read.
template <typename T, typename View>
concept MaybeConst = std::is_same_v<std::remove_const_t<T>, View>;

// ViewName: the view's name among the types of the page.
inline const char* ViewName(const PixelRect&) { return "Rect"; }
template <MaybeConst<PixelRect> View, typename Visitor>
void VisitFields(View& rect, const Visitor& visit) {
  visit(ViewField{"x0_px"}, rect.x0);
  visit(ViewField{"y0_px"}, rect.y0);
  visit(ViewField{"x1_px"}, rect.x1);
  visit(ViewField{"y1_px"}, rect.y1);
}

inline const char* ViewName(const StopRule&) { return "StopRule"; }
template <MaybeConst<StopRule> View, typename Visitor>
void VisitFields(View& rule, const Visitor& visit) {
  visit(ViewField{.name = "target_error", .null_if_empty = true}, rule.target_error);
  visit(ViewField{"time_max_seconds"}, rule.time_max);
  visit(ViewField{"cpu_max_seconds"}, rule.cpu_max);
  visit(ViewField{"certified"}, rule.certified);
}

inline const char* ViewName(const Partition&) { return "Partition"; }
template <MaybeConst<Partition> View, typename Visitor>
void VisitFields(View& partition, const Visitor& visit) {
  visit(ViewField{"tile_size_px"}, partition.tile_size_px);
  visit(ViewField{"pass_sample_count"}, partition.pass_sample_count);
  visit(ViewField{"lease_pass_count"}, partition.lease_pass_count);
  visit(ViewField{"cell_size_px"}, partition.cell_size_px);
}

inline const char* ViewName(const LayerCount&) { return "UnreliableLayer"; }
template <MaybeConst<LayerCount> View, typename Visitor>
void VisitFields(View& count, const Visitor& visit) {
  visit(ViewField{"layer"}, count.layer);
  visit(ViewField{"tile_count"}, count.tile_count);
}

inline const char* ViewName(const EffectCost&) { return "EffectCost"; }
template <MaybeConst<EffectCost> View, typename Visitor>
void VisitFields(View& effect, const Visitor& visit) {
  visit(ViewField{"name"}, effect.name);
  visit(ViewField{"problem"}, effect.problem);
  visit(ViewField{"ablation"}, effect.ablation);
  visit(ViewField{"time_fraction"}, effect.time_fraction);
  visit(ViewField{"time_fraction_error"}, effect.time_fraction_error);
  visit(ViewField{"mean_change"}, effect.mean_change);
  visit(ViewField{"mean_change_error"}, effect.mean_change_error);
  visit(ViewField{"relative_mse"}, effect.relative_mse);
  visit(ViewField{"variance_ratio"}, effect.variance_ratio);
}

inline const char* ViewName(const Estimate&) { return "Estimate"; }
template <MaybeConst<Estimate> View, typename Visitor>
void VisitFields(View& estimate, const Visitor& visit) {
  visit(ViewField{"value"}, estimate.value);
  visit(ViewField{"low"}, estimate.low);
  visit(ViewField{"high"}, estimate.high);
}

inline const char* ViewName(const RefinementPrice&) { return "RefinePrice"; }
template <MaybeConst<RefinementPrice> View, typename Visitor>
void VisitFields(View& price, const Visitor& visit) {
  visit(ViewField{"target_error"}, price.target_error);
  visit(ViewField{"reached"}, price.reached);
  visit(ViewField{"relative_mse"}, price.relative_mse);
  visit(ViewField{"samples_per_pixel"}, price.samples_per_pixel);
  visit(ViewField{"cpu_seconds"}, price.cpu_seconds);
  visit(ViewField{"wall_seconds"}, price.wall_seconds);
}

// Whether VisitFields describes the type.
template <typename T>
concept HasFields = requires(T& view) {
  VisitFields(view, [](const ViewField&, const auto&) {});
};

}  // namespace sheaf::coordinator
