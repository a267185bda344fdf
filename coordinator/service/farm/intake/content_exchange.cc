// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/intake/content_exchange.h"

#include <random>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/printable.h"

namespace sheaf::coordinator {
namespace {

// Counts of a worker that has not reported for this long are dropped; it has ended.
constexpr absl::Duration kCountsKept = absl::Hours(24);

struct CountField {
  uint64_t ContentCounts::*value;
  const char* source;
};
constexpr CountField kBlobFields[] = {{&ContentCounts::cache_blobs, "cache"},
                                      {&ContentCounts::peer_blobs, "peer"},
                                      {&ContentCounts::coordinator_blobs, "coordinator"}};
constexpr CountField kByteFields[] = {{&ContentCounts::cache_bytes, "cache"},
                                      {&ContentCounts::peer_bytes, "peer"},
                                      {&ContentCounts::coordinator_bytes, "coordinator"}};

// Workers that report so seldom are gone, and have nothing in memory.
constexpr absl::Duration kResidentKept = absl::Seconds(30);

struct CountMetric {
  uint64_t ContentCounts::*value;
  const char* name;
  const char* help;
};
constexpr CountField kPageFields[] = {{&ContentCounts::volume_pages_found, "found"},
                                      {&ContentCounts::volume_pages_read, "read"}};
constexpr CountMetric kVolumeMetrics[] = {
    {&ContentCounts::volume_read_bytes, "sheaf_volume_read_bytes_total",
     "Bytes of pages of volumes that workers read from their disks."},
    {&ContentCounts::volume_pages_evicted, "sheaf_volume_pages_evicted_total",
     "Pages of volumes that made room for others."},
    {&ContentCounts::volume_part_bytes, "sheaf_volume_part_bytes_total",
     "Bytes of the parts of page files that scenes opened."}};

std::string MakeDirectoryId() {
  std::random_device random;
  return absl::StrCat(absl::Hex(random(), absl::kZeroPad8), absl::Hex(random(), absl::kZeroPad8));
}

}  // namespace

ContentExchange::ContentExchange(const BlobStore* blobs)
    : chunks_(blobs), directory_id_(MakeDirectoryId()) {}

void ContentExchange::AddCounts(const std::string& worker_id, const ContentCounts& counts,
                                SteadyTime now) {
  if (last_.size() >= kDirectoryWorkersMax && !last_.contains(worker_id)) {
    std::erase_if(last_,
                  [now](const auto& entry) { return now - entry.second.time > kCountsKept; });
    if (last_.size() >= kDirectoryWorkersMax) return;
  }
  LastCounts& last = last_[worker_id];
  std::vector<uint64_t ContentCounts::*> values{&ContentCounts::served_bytes};
  for (const CountField& field : kBlobFields) values.push_back(field.value);
  for (const CountField& field : kByteFields) values.push_back(field.value);
  for (const CountField& field : kPageFields) values.push_back(field.value);
  for (const CountMetric& metric : kVolumeMetrics) values.push_back(metric.value);
  for (const auto value : values) {
    // Reports may overtake each other: an older one adds nothing.
    if (counts.*value <= last.counts.*value) continue;
    sums_.*value += counts.*value - last.counts.*value;
    last.counts.*value = counts.*value;
  }
  last.counts.volume_resident_bytes = counts.volume_resident_bytes;
  last.time = now;
}

void ContentExchange::AddVolumeMetrics(std::vector<MetricView>* metrics) const {
  using Kind = MetricView::Kind;
  for (const CountField& field : kPageFields) {
    metrics->push_back({"sheaf_volume_pages_total",
                        "Pages of volumes that workers looked up: found in memory, or read.",
                        Kind::kCounter, "result", field.source,
                        static_cast<double>(sums_.*field.value)});
  }
  for (const CountMetric& metric : kVolumeMetrics) {
    metrics->push_back({metric.name, metric.help, Kind::kCounter, "", "",
                        static_cast<double>(sums_.*metric.value)});
  }
  double resident_bytes = 0;
  for (const auto& [worker, last] : last_) {
    if (SteadyTime::Now() - last.time > kResidentKept) continue;
    resident_bytes += static_cast<double>(last.counts.volume_resident_bytes);
  }
  metrics->push_back({"sheaf_volume_resident_bytes",
                      "Pages of volumes in the memory of workers, by their last parts.",
                      Kind::kGauge, "", "", resident_bytes});
}

void ContentExchange::Report(const ContentReport& report, SteadyTime now) {
  {
    const MutexLock lock(&mutex_);
    directory_.Report(report.worker, report.held, report.fetching, now);
    AddCounts(report.worker.worker_id, report.counts, now);
    for (const PeerTroubleReport& trouble : report.troubles) {
      ++troubles_[static_cast<size_t>(trouble.kind)];
      directory_.NoteTrouble(trouble.peer_id, trouble.blob, trouble.kind, report.worker.worker_id,
                             now);
    }
  }
  for (const PeerTroubleReport& trouble : report.troubles) {
    if (trouble.kind != PeerTroubleKind::kWrongBytes) continue;
    LogWarning(absl::StrCat("worker ", Printable(report.worker.worker_id), " says that worker ",
                            Printable(trouble.peer_id), " sent wrong bytes as blob ",
                            Printable(trouble.blob),
                            "; it got the blob elsewhere. If others report this too, check that "
                            "machine's disk and memory"));
  }
}

PeerAnswer ContentExchange::Locate(const std::string& blob, const std::string& worker_id,
                                   bool serves, const std::set<std::string>& tried,
                                   SteadyTime now) {
  const MutexLock lock(&mutex_);
  return directory_.Locate(blob, worker_id, serves, tried, now);
}

void ContentExchange::AddMetrics(std::vector<MetricView>* metrics) const {
  using Kind = MetricView::Kind;
  const MutexLock lock(&mutex_);
  for (const CountField& field : kBlobFields) {
    metrics->push_back({"sheaf_content_blobs_total",
                        "Files of scenes that workers loaded, by where they found them.",
                        Kind::kCounter, "source", field.source,
                        static_cast<double>(sums_.*field.value)});
  }
  for (const CountField& field : kByteFields) {
    metrics->push_back({"sheaf_content_bytes_total", "Their bytes.", Kind::kCounter, "source",
                        field.source, static_cast<double>(sums_.*field.value)});
  }
  for (size_t kind = 0; kind < troubles_.size(); ++kind) {
    metrics->push_back({"sheaf_content_peer_troubles_total",
                        "Fetches from another worker that failed, by cause.", Kind::kCounter,
                        "kind", PeerTroubleKindName(static_cast<PeerTroubleKind>(kind)),
                        static_cast<double>(troubles_[kind])});
  }
  const auto add = [metrics](const char* name, const char* help, Kind kind, double value) {
    metrics->push_back({name, help, kind, "", "", value});
  };
  add("sheaf_content_peer_served_bytes_total", "Bytes of blobs that workers sent to workers.",
      Kind::kCounter, static_cast<double>(sums_.served_bytes));
  add("sheaf_content_received_bytes_total", "Bytes of blobs that clients uploaded.", Kind::kCounter,
      static_cast<double>(received_bytes_));
  add("sheaf_content_reused_bytes_total",
      "Bytes of uploaded blobs that were taken from stored ones instead.", Kind::kCounter,
      static_cast<double>(reused_bytes_));
  add("sheaf_content_sent_bytes_total", "Bytes of blobs that the coordinator sent.", Kind::kCounter,
      static_cast<double>(sent_bytes_));
  add("sheaf_content_peers", "Workers that serve blobs to workers.", Kind::kGauge,
      static_cast<double>(directory_.CountServing(SteadyTime::Now())));
  AddVolumeMetrics(metrics);
}

}  // namespace sheaf::coordinator
