// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Converts the plain values of FarmView field by field.
#include "coordinator/service/http/api/http_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/scene/settings/frame_settings_fields.h"

namespace sheaf::coordinator {
namespace {

using Json = nlohmann::ordered_json;

// User-supplied text may not be valid UTF-8; it is shown with replacement characters.
std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// Milliseconds suffice for display.
Json TimeJson(absl::Time time) {
  if (time == absl::InfiniteFuture() || time == absl::InfinitePast()) return nullptr;
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", time, absl::UTCTimeZone());
}

std::string FrameName(const std::string& job_id, int32_t frame_number) {
  return absl::StrCat("jobs/", job_id, "/frames/", frame_number);
}

Json RectJson(const PixelRect& rect) {
  return {{"x0_px", rect.x0}, {"y0_px", rect.y0}, {"x1_px", rect.x1}, {"y1_px", rect.y1}};
}

template <typename T>
Json SettingJson(const T& value) {
  return value;
}
Json SettingJson(const PixelRect& value) { return RectJson(value); }
Json SettingJson(const PixelLattice& value) { return value.All() ? 0 : value.stride_px; }
Json SettingJson(const FilmOutputs& value) { return FormatOutputs(value); }
Json SettingJson(ColorTransport value) { return ColorTransportName(value); }
Json SettingJson(Primaries value) { return PrimariesName(value); }
Json SettingJson(TechniqueSet value) { return value.Name(); }

// Adds the settings that are shown in this JSON object.
void AddSettings(const FrameSettings& settings, SettingField::Shown shown, Json* json) {
  VisitFrameSettings(settings, [&](const SettingField& field, const auto& value) {
    if (field.shown == shown) (*json)[field.name] = SettingJson(value);
  });
}

// Null while it is unknown.
Json SecondsLeftJson(double seconds) {
  return seconds >= 0 && std::isfinite(seconds) ? Json(seconds) : Json();
}

Json ProgressJson(const ProgressView& progress) {
  const bool error_known = progress.relative_mse > 0 && std::isfinite(progress.relative_mse);
  return {
      {"sample_count_done", progress.sample_count_done},
      {"sample_count_total", progress.sample_count_total},
      {"relative_mse", error_known ? Json(progress.relative_mse) : Json()},
      {"nonfinite_count", progress.nonfinite_count},
      {"ray_count", progress.ray_count},
      {"cpu_duration_seconds", progress.cpu_seconds},
      {"wall_duration_seconds", progress.wall_seconds},
      {"remaining_duration_seconds", SecondsLeftJson(progress.remaining_seconds)},
      {"remaining_duration_low_seconds", SecondsLeftJson(progress.remaining_low_seconds)},
      {"remaining_duration_high_seconds", SecondsLeftJson(progress.remaining_high_seconds)},
      {"remaining_duration_alone_seconds", SecondsLeftJson(progress.remaining_alone_seconds)},
  };
}

Json StopJson(const StopRule& rule) {
  const auto seconds = [](absl::Duration limit) {
    return limit == absl::InfiniteDuration() ? Json() : Json(absl::ToDoubleSeconds(limit));
  };
  return {
      {"target_error", rule.target_error > 0 ? Json(rule.target_error) : Json()},
      {"time_max_seconds", seconds(rule.time_max)},
      {"cpu_max_seconds", seconds(rule.cpu_max)},
  };
}

Json RoundsJson(const std::vector<RoundView>& rounds) {
  Json json = Json::array();
  for (const RoundView& round : rounds) {
    json.push_back({
        {"relative_mse", round.relative_mse},
        {"relative_mse_upper", round.relative_mse_upper},
        {"predicted_relative_mse", round.predicted_relative_mse},
        {"prediction_ratio", round.prediction_ratio},
        {"sample_count", round.sample_count},
        {"ray_count", round.ray_count},
        {"cpu_duration_seconds", round.cpu_seconds},
        {"wall_duration_seconds", round.wall_seconds},
        {"part_bytes", round.part_bytes},
        {"preview_version", round.preview_version},
    });
  }
  return json;
}

Json EstimateJson(const Estimate& estimate) {
  return {{"value", estimate.value}, {"low", estimate.low}, {"high", estimate.high}};
}

Json EffectsJson(const std::vector<EffectCost>& effects) {
  Json json = Json::array();
  for (const EffectCost& effect : effects) {
    json.push_back({
        {"name", effect.name},
        {"problem", effect.problem},
        {"ablation", effect.ablation},
        {"time_fraction", effect.time_fraction},
        {"time_fraction_error", effect.time_fraction_error},
        {"mean_change", effect.mean_change},
        {"mean_change_error", effect.mean_change_error},
        {"relative_mse", effect.relative_mse},
        {"variance_ratio", effect.variance_ratio},
    });
  }
  return json;
}

// Null if it is not known, or if nothing is required.
Json MemoryJson(uint64_t bytes) { return bytes > 0 ? Json(bytes) : Json(); }

Json PreviewFrameJson(const JobView& job) {
  if (!job.preview_frame) return nullptr;
  const PreviewFrame& frame = *job.preview_frame;
  return {{"name", FrameName(job.job_id, frame.frame_number)},
          {"preview_version", frame.preview_version},
          {"complete", frame.complete}};
}

Json DependenciesJson(const std::vector<DependencyView>& dependencies) {
  Json json = Json::array();
  for (const DependencyView& dependency : dependencies) {
    json.push_back({{"job_name", absl::StrCat("jobs/", dependency.job_id)},
                    {"by_frame", dependency.by_frame},
                    {"state", dependency.state}});
  }
  return json;
}

Json JobObject(const JobView& job) {
  return {
      {"name", absl::StrCat("jobs/", job.job_id)},
      {"title", job.title},
      {"pilot", job.pilot},
      {"state", JobStateName(job.state)},
      {"owner", job.owner},
      {"show", job.show},
      {"pool", job.requirements.pool},
      {"required_tags", job.requirements.tags},
      {"memory_min_bytes", MemoryJson(job.requirements.memory_min_bytes)},
      {"memory_expected_bytes", MemoryJson(job.requirements.memory_expected_bytes)},
      {"priority", job.priority},
      {"numeric_profile", job.numeric_profile},
      {"failure", job.failure},
      {"waiting_reason", job.waiting_reason},
      {"warning", job.warning},
      {"failure_count", job.failure_count},
      {"pinned", job.pinned},
      {"parts_removed_time", TimeJson(job.parts_removed_time)},
      {"create_time", TimeJson(job.create_time)},
      {"end_time", TimeJson(job.end_time)},
      {"frame_count", job.frame_count},
      {"frame_complete_count", job.frame_complete_count},
      {"incomplete_frame_count", job.frame_incomplete_count},
      {"training_frame_count", job.training_frame_count},
      {"unapproved_frame_count", job.unapproved_frame_count},
      {"dependencies", DependenciesJson(job.dependencies)},
      {"deadline_time", TimeJson(job.deadline.time)},
      {"held", job.held},
      {"preview_frame", PreviewFrameJson(job)},
      {"progress", ProgressJson(job.progress)},
  };
}

Json LayersJson(const std::vector<LayerCount>& counts) {
  Json json = Json::array();
  for (const LayerCount& count : counts) {
    json.push_back({{"layer", count.layer}, {"tile_count", count.tile_count}});
  }
  return json;
}

Json SetAsideJson(const std::vector<SetAsideView>& tasks) {
  Json json = Json::array();
  for (const SetAsideView& task : tasks) {
    Json failures = Json::array();
    for (const TaskFailure& failure : task.failures) {
      failures.push_back({{"kind", FailureKindName(failure.kind)},
                          {"worker", failure.worker_id},
                          {"count", failure.count},
                          {"message", failure.words}});
    }
    json.push_back({{"task", task.task}, {"why", task.why}, {"failures", std::move(failures)}});
  }
  return json;
}

}  // namespace

std::string JobJson(const JobView& job) { return Dump(JobObject(job)); }

std::string FrameJson(const std::string& job_id, const FrameView& frame) {
  Json json = {
      {"name", FrameName(job_id, frame.frame_number)},
      {"frame_number", frame.frame_number},
      {"scene_digest", frame.scene_digest},
      {"frame_digest", frame.frame_digest},
  };
  AddSettings(frame.settings, SettingField::Shown::kWithShape, &json);
  json.update(Json{
      {"resumed_image", frame.resumed.sha256_hex.empty() ? Json() : Json(frame.resumed.sha256_hex)},
      {"stop", StopJson(frame.stop)},
      {"stop_reason", frame.complete ? StopReasonName(frame.stop_reason) : ""},
      {"rounds", RoundsJson(frame.rounds)},
      {"tile_count", frame.tile_count},
      {"unreliable_tile_count", frame.unreliable_tile_count},
      {"unreliable_layers", LayersJson(frame.unreliable_layers)},
      {"flip", frame.flip > 0 ? Json(frame.flip) : Json()},
      {"correction_count", frame.correction_count},
      {"one_sequence_gain", frame.one_sequence_gain > 0 ? Json(frame.one_sequence_gain) : Json()},
  });
  AddSettings(frame.settings, SettingField::Shown::kWithSettings, &json);
  json.update(Json{
      {"training", frame.is_training},
      {"complete", frame.complete},
      {"incomplete", frame.incomplete},
      {"waiting_reason", frame.waiting_reason},
      {"set_aside_tasks", SetAsideJson(frame.set_aside)},
      {"set_aside_task_count", frame.set_aside_count},
      {"image_digest", frame.image_digest},
      {"preview_version", frame.preview_version},
      {"progress", ProgressJson(frame.progress)},
  });
  return Dump(json);
}

std::string RemovalJson(const RemovalView& removal) {
  return Dump({
      {"kind", removal.kind},
      {"job", removal.job_id.empty() ? Json() : Json(absl::StrCat("jobs/", removal.job_id))},
      {"reason", removal.reason},
      {"item_count", removal.item_count},
      {"size_bytes", removal.size_bytes},
  });
}

std::string FailureJson(const std::string& job_id, const FailureView& view) {
  const FailureRecord& failure = view.failure;
  return Dump({
      {"frame_name", FrameName(job_id, failure.frame_number)},
      {"frame_number", failure.frame_number},
      {"tile", RectJson(failure.tile)},
      {"task", TaskKindName(failure.task_kind)},
      {"first_sample", failure.block.first},
      {"sample_count", failure.block.count},
      {"worker", absl::StrCat("workers/", failure.worker_id)},
      {"kind", FailureKindName(failure.kind)},
      {"message", failure.message},
      {"time", TimeJson(failure.time)},
      {"command", view.command},
  });
}

std::string NameJson(const std::string& name) { return Dump({{"name", name}}); }

std::string WorkerJson(const WorkerView& worker) {
  Json leases = Json::array();
  for (const LeaseView& lease : worker.leases) {
    leases.push_back({
        {"frame_name", FrameName(absl::StrCat(lease.frame.job_id), lease.frame.frame_number)},
        {"pilot", IsPilot(lease.frame.job_id)},
        {"tile", RectJson(lease.tile)},
        {"task", TaskKindName(lease.kind)},
        {"first_sample", lease.block.first},
        {"sample_count", lease.block.count},
        {"phase", LeasePhaseName(lease.phase)},
        {"grant_time", TimeJson(lease.grant_time)},
    });
  }
  return Dump({
      {"name", absl::StrCat("workers/", worker.worker_id)},
      {"host", worker.host},
      {"state", WorkerStateName(worker.state)},
      {"thread_count", worker.thread_count},
      {"pool", worker.traits.pool},
      {"tags", worker.traits.tags},
      {"memory_bytes", MemoryJson(worker.traits.memory_bytes)},
      {"numeric_profile", worker.numeric_profile},
      {"lease_count", worker.lease_count},
      {"leases", std::move(leases)},
      {"warm_scene_count", worker.warm_scene_count},
      {"warm_scenes", worker.warm_scenes},
      {"scene_memory_bytes", MemoryJson(worker.scene_memory_bytes)},
      {"result_count", worker.result_count},
      {"samples_per_second", worker.samples_per_second},
      {"lease_granted_count", worker.lease_granted_count},
      {"lease_cold_count", worker.lease_cold_count},
      {"last_seen_time", TimeJson(worker.last_seen_time)},
      {"reason", worker.reason},
      {"drained", worker.drained},
      {"then_exit", worker.exits},
  });
}

std::string RefinementPricesJson(const RefinementPrices& priced) {
  Json prices = Json::array();
  for (const RefinementPrice& price : priced.prices) {
    prices.push_back({
        {"target_error", price.target_error},
        {"reached", price.reached},
        {"relative_mse", EstimateJson(price.relative_mse)},
        {"samples_per_pixel", EstimateJson(price.samples_per_pixel)},
        {"cpu_seconds", EstimateJson(price.cpu_seconds)},
        {"wall_seconds", priced.thread_count > 0 ? EstimateJson(price.wall_seconds) : Json()},
    });
  }
  return Dump({{"prices", std::move(prices)},
               {"thread_count", priced.thread_count},
               {"jobs_before_count", priced.jobs_before_count}});
}

std::string MetricJson(const MetricView& metric) {
  return Dump({
      {"name", metric.name},
      {"help", metric.help},
      {"kind", metric.kind == MetricView::Kind::kCounter ? "counter" : "gauge"},
      {"label_name", metric.label_name},
      {"label_value", metric.label_value},
      {"value", metric.value},
  });
}

std::string HealthJson() { return Dump(Json::object({{"healthy", true}})); }

std::string ReadyJson(const std::vector<ReadyCondition>& conditions) {
  bool is_ready = true;
  Json list = Json::array();
  for (const auto& [name, status] : conditions) {
    is_ready &= status.ok();
    list.push_back(
        {{"name", name}, {"ok", status.ok()}, {"reason", std::string(status.message())}});
  }
  return Dump({{"ready", is_ready}, {"conditions", std::move(list)}});
}

std::string UsageJson(const UsageReport& report) {
  Json rows = Json::array();
  for (const UsageSum& sum : report.sums) {
    const Usage& usage = sum.usage;
    rows.push_back({{"day", sum.day ? Json(FormatUsageDay(*sum.day)) : Json()},
                    {"user", sum.user},
                    {"show", sum.show},
                    {"job", sum.job},
                    {"result_count", usage.result_count},
                    {"sample_count", usage.sample_count},
                    {"ray_count", usage.ray_count},
                    {"cpu_seconds", absl::ToDoubleSeconds(usage.cpu_duration)},
                    {"repeated_count", usage.repeated_count},
                    {"repeated_cpu_seconds", absl::ToDoubleSeconds(usage.repeated_cpu_duration)},
                    {"lost_count", usage.lost_count},
                    {"lost_cpu_seconds", absl::ToDoubleSeconds(usage.lost_cpu_duration)},
                    {"upload_bytes", usage.upload_bytes},
                    {"part_bytes", usage.part_bytes},
                    {"image_bytes", usage.image_bytes}});
  }
  Json stored = Json::array();
  for (const StoredView& view : report.stored) {
    const bool has_limit = view.bytes_max != UINT64_MAX;
    stored.push_back({{"user", view.user},
                      {"total_bytes", view.bytes.Total()},
                      {"bytes_max", has_limit ? Json(view.bytes_max) : Json()},
                      {"part_bytes", view.bytes.part_bytes},
                      {"image_bytes", view.bytes.image_bytes},
                      {"preview_bytes", view.bytes.preview_bytes},
                      {"content_bytes", view.bytes.content_bytes}});
  }
  return Dump({{"usage", std::move(rows)}, {"stored", std::move(stored)}});
}

std::string ListJson(const std::string& key, const std::vector<std::string>& objects,
                     const std::string& next_page_token) {
  return absl::StrCat("{\"", key, "\":[", absl::StrJoin(objects, ","),
                      "],\"next_page_token\":", Dump(next_page_token), "}");
}

std::string JobWithFramesJson(const JobView& job, const std::vector<std::string>& frames,
                              const std::string& next_page_token) {
  std::string text = JobJson(job);
  text.pop_back();
  return absl::StrCat(text, ",\"effect_costs\":", Dump(EffectsJson(job.effect_costs)), ",",
                      ListJson("frames", frames, next_page_token).substr(1));
}

std::string SessionJson(const Caller& caller) {
  const std::string user = caller.identity ? caller.identity->id.name : "";
  return Dump({{"user", user}, {"role", caller.identity ? RoleName(caller.identity->role) : ""}});
}

}  // namespace sheaf::coordinator
