// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/sim_user.h"

#include <algorithm>
#include <utility>

#include "common/base/digest.h"

namespace sheaf::sim {
namespace {

using coordinator::Farm;
using coordinator::FrameSpec;
using coordinator::JobPhase;
using coordinator::JobSpec;

constexpr absl::Duration kSubmitMax = absl::Seconds(40);
constexpr absl::Duration kWishMin = absl::Milliseconds(200), kWishMax = absl::Seconds(30);
constexpr absl::Duration kRetry = absl::Seconds(1);
constexpr int32_t kTilePx = 8;
constexpr uint64_t kSampleCounts[] = {16, 24, 48, 64};
constexpr double kTargetErrors[] = {0.3, 0.05, 0.01};

std::string SceneDigest(uint64_t number) { return Sha256Hex(absl::StrCat("scene ", number)); }

}  // namespace

SimUser::SimUser(World* world, Network* network, const Promises* promises, uint64_t number)
    : world_(*world),
      network_(*network),
      promises_(*promises),
      random_(world->random.Stream(1000 + number)),
      request_id_(absl::StrCat("request ", number)),
      spec_(MakeJob()) {}

JobSpec SimUser::MakeJob() {
  JobSpec spec;
  spec.title = request_id_;
  spec.priority = static_cast<int32_t>(random_.Between(-1, 1));
  spec.partition.tile_size_px = kTilePx;
  spec.partition.lease_pass_count = random_.Below(3);
  spec.partition.cell_size_px = random_.Chance(0.7) ? 4 : 0;
  const uint64_t frame_count = 1 + random_.Below(3);
  const bool poisoned = random_.Chance(0.05);
  for (uint64_t i = 0; i < frame_count; ++i) {
    FrameSpec frame;
    frame.frame_number = static_cast<int32_t>(i);
    const uint64_t scene = poisoned ? 99 : random_.Below(2);
    frame.scene = {SceneDigest(scene), 7};
    if (poisoned) world_.poisoned_scenes.insert(frame.scene.sha256_hex);
    frame.settings.width_px = 16;
    frame.settings.height_px = kTilePx;
    frame.settings.window = {0, 0, random_.Chance(0.5) ? 16 : 12, kTilePx};
    frame.settings.samples = kSampleCounts[random_.Below(std::size(kSampleCounts))];
    if (random_.Chance(0.4)) {
      frame.stop.target_error = kTargetErrors[random_.Below(std::size(kTargetErrors))];
      frame.settings.samples = 128;
    }
    const bool has_light = scene == 1 && frame.settings.window.x1 == 12;
    const bool is_guided = frame.settings.window.x1 == 12 && frame.settings.samples >= 48;
    if (has_light) frame.settings.techniques = TechniqueSet::kCameraAndLight;
    if (is_guided) {
      frame.settings.techniques =
          has_light ? TechniqueSet::kCameraAndLightGuided : TechniqueSet::kCameraGuided;
    }
    spec.frames.push_back(std::move(frame));
  }
  return spec;
}

void SimUser::Start() {
  world_.After(random_.Between(absl::ZeroDuration(), kSubmitMax),
               [self = shared_from_this()] { self->Submit(); });
}

void SimUser::Submit() {
  const auto self = shared_from_this();
  const auto serve = [self](Farm& farm) -> Network::Reply {
    const absl::StatusOr<uint64_t> id = farm.CreateJob(self->spec_, self->request_id_);
    self->world_.Trace("user ", self->request_id_, " submits: ",
                       id.ok() ? absl::StrCat("job ", *id) : std::string(id.status().message()));
    if (!id.ok()) return [self] { self->world_.After(kRetry, [self] { self->Submit(); }); };
    if (!self->world_.machine.disk().stopped() && !self->promises_.jobs().contains(*id)) {
      self->world_.Broken(absl::StrCat("job ", *id, " is acknowledged, but not durable"));
    }
    return [self, job_id = *id] {
      self->job_id_ = job_id;
      self->ScheduleWish();
    };
  };
  network_.Call("submit", serve,
                [self] { self->world_.After(kRetry, [self] { self->Submit(); }); });
}

void SimUser::ScheduleWish() {
  world_.After(random_.Between(kWishMin, kWishMax), [self = shared_from_this()] { self->Wish(); });
}

void SimUser::Wish() {
  if (is_asking_) return;
  if (lets_it_end_) return has_retried_ || has_cancelled_ ? Pause(false) : Retry();
  switch (random_.Below(12)) {
    case 0:
    case 1:
      return Pause(true);
    case 2:
    case 3:
    case 4:
      return Pause(false);
    case 5:
      return Cancel();
    case 6:
    case 7:
      return Prioritize();
    default:
      return Refine();
  }
}

void SimUser::LetItEnd() {
  lets_it_end_ = true;
  if (job_id_) Wish();
}

void SimUser::Pause(bool paused) {
  Ask(
      paused ? "pause" : "resume",
      [paused](Farm& farm, uint64_t id) { return paused ? farm.PauseJob(id) : farm.ResumeJob(id); },
      [paused](const PromisedJob& job) { return job.paused.IsCertainly(paused); });
}

void SimUser::Retry() {
  has_retried_ = true;
  Ask(
      "retry", [](Farm& farm, uint64_t id) { return farm.RetryTasks(id); },
      [](const PromisedJob& /*job*/) { return true; });
}

void SimUser::Cancel() {
  has_cancelled_ = true;
  Ask(
      "cancel", [](Farm& farm, uint64_t id) { return farm.CancelJob(id); },
      [](const PromisedJob& job) {
        return job.phase.IsCertainly(static_cast<int>(JobPhase::kCancelled));
      });
}

void SimUser::Prioritize() {
  const auto priority = static_cast<int32_t>(random_.Between(-5, 5));
  Ask(
      "prioritize",
      [priority](Farm& farm, uint64_t id) {
        return farm.SetJobPriority(id, {.priority = priority});
      },
      [priority](const PromisedJob& job) { return job.priority.IsCertainly(priority); });
}

void SimUser::Refine() {
  coordinator::Refinement refinement;
  if (random_.Chance(0.5)) refinement.samples = 16 * (1 + random_.Below(8));
  if (random_.Chance(0.5)) {
    refinement.stop.target_error = kTargetErrors[random_.Below(std::size(kTargetErrors))];
    refinement.samples = 128;
  }
  Ask(
      "refine",
      [refinement](Farm& farm, uint64_t id) {
        return farm.RefineJob(id, {.refinement = refinement});
      },
      [](const PromisedJob& /*job*/) { return true; });
}

void SimUser::Ask(const char* what, Request request, Durable durable) {
  is_asking_ = true;
  const auto self = shared_from_this();
  const auto serve = [=](Farm& farm) -> Network::Reply {
    const uint64_t id = *self->job_id_;
    const absl::Status status = request(farm, id);
    self->world_.Trace("user of job ", id, ": ", what, ": ", status.ToString());
    const bool is_certain = status.ok() && !self->world_.machine.disk().stopped();
    if (is_certain && !durable(self->promises_.jobs().at(id))) {
      self->world_.Broken(absl::StrCat(what, " of job ", id, " is acknowledged, but not durable"));
    }
    const bool again = absl::IsUnavailable(status) || absl::IsResourceExhausted(status);
    return [=] {
      self->is_asking_ = false;
      if (again) {
        self->world_.After(kRetry, [=] { self->Ask(what, request, durable); });
      } else {
        self->ScheduleWish();  // Also for a job that should end: an old request may arrive late.
      }
    };
  };
  network_.Call(what, serve,
                [=] { self->world_.After(kRetry, [=] { self->Ask(what, request, durable); }); });
}

}  // namespace sheaf::sim
