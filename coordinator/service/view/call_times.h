// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CallTimes: durations of calls, by callee and outcome: a histogram for each.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/service/view/histogram.h"

namespace sheaf::coordinator {

// Histograms of an object; calls beyond them are counted as "other".
inline constexpr size_t kCallSeriesMax = 250;

// Thread safety: all members may be called concurrently.
class CallTimes {
 public:
  // name: the metric's; label: "method" or "route". Both outlive the object.
  CallTimes(const char* name, const char* help, const char* label)
      : name_(name), help_(help), label_(label) {}

  // Makes the histogram of these calls, so that the first call already is an increase.
  void Expect(const std::string& what, const std::string& code);
  void Note(const std::string& what, const std::string& code, absl::Duration duration);
  void AddMetrics(std::vector<MetricView>* metrics) const;

 private:
  using Key = std::pair<std::string, std::string>;  // What, code.
  Histogram& HistogramOf(const std::string& what, const std::string& code);

  const char* const name_;
  const char* const help_;
  const char* const label_;
  mutable Mutex mutex_;
  std::map<Key, std::unique_ptr<Histogram>> histograms_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::coordinator
