// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SimUser: a user who submits a job and then pauses, resumes, prioritizes, refines or cancels it,
// and repeats each request until it is answered. A request that the farm acknowledges must be
// durable.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "tests/sim/network.h"
#include "tests/sim/promises.h"
#include "tests/sim/world.h"

namespace sheaf::sim {

class SimUser : public std::enable_shared_from_this<SimUser> {
 public:
  SimUser(World* world, Network* network, const Promises* promises, uint64_t number);

  void Start();
  // Wants nothing more but that its job is not paused.
  void LetItEnd();
  // None until the farm has answered.
  std::optional<uint64_t> job_id() const { return job_id_; }
  bool has_cancelled() const { return has_cancelled_; }
  // Another user cancels its job.
  void NoteCancelled() { has_cancelled_ = true; }
  bool is_content() const { return job_id_ && !is_asking_; }

 private:
  using Request = std::function<absl::Status(coordinator::Farm& farm, uint64_t job_id)>;
  // Whether the promises hold what was asked for.
  using Durable = std::function<bool(const PromisedJob& job)>;

  coordinator::JobSpec MakeJob();
  void Submit();
  void ScheduleWish();
  void Wish();
  void Pause(bool paused);
  void Cancel();
  void Retry();
  void Refine();
  void Prioritize();
  void Ask(const char* what, Request request, Durable durable);

  World& world_;
  Network& network_;
  const Promises& promises_;
  Random random_;
  const std::string request_id_;
  coordinator::JobSpec spec_;
  std::optional<uint64_t> job_id_;
  bool has_cancelled_ = false;
  bool has_retried_ = false;  // At the end, so that nothing waits for workers that are gone.
  bool is_asking_ = false;
  bool lets_it_end_ = false;
};

}  // namespace sheaf::sim
