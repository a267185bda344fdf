// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmView: the farm's present state as plain values, for code that displays it (the HTTP port). It
// hides gRPC, protobuf and locks; every call returns a consistent copy.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/film/film.h"
#include "coordinator/core/policy/owner_bytes.h"
#include "coordinator/core/policy/usage.h"
#include "coordinator/service/view/job_view.h"
#include "coordinator/service/view/worker_view.h"

namespace sheaf::coordinator {

// Maximum pixels of a preview; larger images are averaged over squares of 2 x 2, 3 x 3 and so on.
inline constexpr int64_t kPreviewPixelCountMax = int64_t{1} << 21;
// Maximum pixels of a thumbnail.
inline constexpr int64_t kThumbnailPixelCountMax = int64_t{1} << 14;
// An additional channel of previews: CPU time per pixel in seconds, averaged over the tile; 0 if
// unknown.
inline constexpr char kCpuChannel[] = "cpu";

// The cost of refining a job on the farm in its present state.
struct RefinementPrices {
  std::vector<RefinementPrice> prices;  // In the order of the targets.
  int32_t thread_count = 0;             // Threads of the workers that could render it.
  int32_t jobs_before_count = 0;        // Unfinished jobs of equal or higher priority.
};
inline const char* ViewName(const RefinementPrices&) { return "RefinePrices"; }
template <MaybeConst<RefinementPrices> View, typename Visitor>
void VisitFields(View& priced, const Visitor& visit) {
  visit(ViewField{"prices"}, priced.prices);
  visit(ViewField{"thread_count"}, priced.thread_count);
  visit(ViewField{"jobs_before_count"}, priced.jobs_before_count);
}

// The setting of a user, a show or a pool, and the threads that it holds.
struct ShareView {
  std::string subject;  // As FormatShareSubject writes it.
  bool is_set = false;
  ShareSetting setting;
  int32_t job_count = 0;     // Unfinished.
  int64_t threads_held = 0;  // By its leases, as HeldThreads counts.
};
inline const char* ViewName(const ShareView&) { return "Share"; }
template <MaybeConst<ShareView> View, typename Visitor>
void VisitFields(View& share, const Visitor& visit) {
  visit(ViewField{"subject"}, share.subject);
  visit(ViewField{"weight"}, share.setting.weight);
  visit(ViewField{.name = "threads_max", .null_if_empty = true}, share.setting.threads_max);
  visit(ViewField{"is_set"}, share.is_set);
  visit(ViewField{"job_count"}, share.job_count);
  visit(ViewField{"threads_held"}, share.threads_held);
}

// Items of one kind and job that are removed for one reason (coordinator/core/policy/retention.h).
struct RemovalView {
  std::string kind;    // "parts", "upload", "blob", "previews" or "job".
  std::string job_id;  // Empty: blobs and uploads.
  std::string reason = {};
  int64_t item_count = 0;
  uint64_t size_bytes = 0;
};
inline const char* ViewName(const RemovalView&) { return "Removal"; }
template <MaybeConst<RemovalView> View, typename Visitor>
void VisitFields(View& removal, const Visitor& visit) {
  visit(ViewField{"kind"}, removal.kind);
  visit(
      ViewField{.name = "job", .in_message = "job_name", .null_if_empty = true, .prefix = "jobs/"},
      removal.job_id);
  visit(ViewField{"reason"}, removal.reason);
  visit(ViewField{"item_count"}, removal.item_count);
  visit(ViewField{"size_bytes"}, removal.size_bytes);
}

// One value for /metrics, in Prometheus' terms.
struct MetricView {
  enum class Kind { kCounter, kGauge, kHistogram };
  std::string name;  // "sheaf_results_accepted_total".
  std::string help;  // One sentence.
  Kind kind = Kind::kCounter;
  std::string label_name, label_value;  // Both empty if the metric has no label.
  double value = 0;
  // Further labels, in the order of their names in the text; label_name comes first.
  std::vector<std::pair<std::string, std::string>> more_labels = {};
  // For a histogram's values: "_bucket", "_sum" or "_count", after the name.
  std::string suffix = {};
};

// A condition for accepting work.
struct ReadyCondition {
  std::string name;     // "database", "disk" or "certificate".
  absl::Status status;  // OK, or why it fails and what to do.
};

// A user's stored bytes, and their limit.
struct StoredView {
  std::string user;
  OwnerBytes bytes;
  uint64_t bytes_max = UINT64_MAX;  // UINT64_MAX: none.
};

// The usage of jobs, and the bytes kept now.
struct UsageReport {
  std::vector<UsageSum> sums;
  std::vector<StoredView> stored;  // Ascending by user.
};

// The image so far.
struct PreviewView {
  uint64_t version = 0;  // The FrameView::preview_version of the image.
  // The requested channels, linear; pixels without samples are 0. The viewer applies the display
  // transform.
  FrameImage image;
  bool complete = false;
};

// The marks of a job's frames that a reader has seen, by index.
using FrameMarks = std::vector<size_t>;

// Thread safety: all functions may be called from any thread. They wait for short locks only,
// except WaitForChange, Preview (which copies planes of an image) and PriceRefinement.
class FarmView {
 public:
  virtual ~FarmView() = default;

  // Newest first, without frames; excludes pilots.
  virtual std::vector<JobView> ListJobs() const = 0;
  // With frames. Errors: kNotFound.
  virtual absl::StatusOr<JobView> FindJob(const std::string& job_id) const = 0;
  // Returns only the frames whose marks differ from these, and updates the marks. A frame's mark
  // changes if users would see a change other than elapsed time.
  virtual absl::StatusOr<JobView> FindJobChanges(const std::string& job_id,
                                                 FrameMarks* marks) const = 0;
  // The last failures of a job, newest first. Errors: kNotFound.
  virtual absl::StatusOr<std::vector<FailureView>> ListFailures(
      const std::string& job_id) const = 0;
  // The events of a job, oldest first. Errors: kNotFound; those of the store.
  virtual absl::StatusOr<std::vector<JobEvent>> ListEvents(const std::string& job_id) const = 0;
  // Estimates the cost of refining a job until its frames reach each of these errors. Takes up to
  // some tenths of a second. Errors: kNotFound; kFailedPrecondition (the job has not succeeded);
  // kInvalidArgument (no target, more than kPricedTargetsMax, or one out of range).
  virtual absl::StatusOr<RefinementPrices> PriceRefinement(
      const std::string& job_id, const std::vector<double>& target_errors) const = 0;
  // Ascending by id.
  virtual std::vector<WorkerView> ListWorkers() const = 0;
  // All counters and gauges; values of the same name are adjacent.
  virtual std::vector<MetricView> Metrics() const = 0;
  // The image so far, in the given channels of FrameImage only, as copying all would take long.
  // kCpuChannel must be requested alone; it covers the stored parts of the frame. Errors: kNotFound
  // (no such frame); kUnavailable (no samples yet, or no stored parts); kInternal (no such
  // channel).
  virtual absl::StatusOr<PreviewView> Preview(const std::string& job_id, int32_t frame_number,
                                              const std::vector<std::string>& channels) const = 0;
  // R, G and B of the image so far, shrunk to kThumbnailPixelCountMax. Errors: kNotFound;
  // kUnavailable (no samples yet, or no stored thumbnail).
  virtual absl::StatusOr<PreviewView> Thumbnail(const std::string& job_id,
                                                int32_t frame_number) const = 0;
  // A small copy of the image at the end of a round (from 0), with the channels of all layers.
  // Errors: kNotFound (no such frame, or no stored preview).
  virtual absl::StatusOr<PreviewView> RoundPreview(const std::string& job_id, int32_t frame_number,
                                                   int32_t round) const = 0;
  // The coordinator accepts work if all of them hold. Looks at the file system.
  virtual std::vector<ReadyCondition> Conditions() const = 0;

  // Increases whenever anything above changes.
  virtual uint64_t ChangeCount() const = 0;
  // Returns ChangeCount() as soon as it differs from `seen`, or after `timeout`.
  virtual uint64_t WaitForChange(uint64_t seen, absl::Duration timeout) const = 0;
};

}  // namespace sheaf::coordinator
