// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MadeTables: tables that this process has made already. A process compiles a scene several times:
// to check it, to compare techniques, and to render it; and a row takes milliseconds. A table is a
// pure function of its key, so that results do not depend on what is kept.
#pragma once

#include <cstddef>
#include <map>

#include "common/base/mutex.h"

namespace sheaf::render {

// kTablesMax: the limit of tables that are kept, the first ones; others are made each time. Thread
// safety: Get may be called concurrently.
template <typename Key, typename Table, size_t kTablesMax>
class MadeTables {
 public:
  // make: returns the table of the key.
  template <typename Make>
  Table Get(const Key& key, const Make& make) {
    {
      const MutexLock lock(&mutex_);
      if (const auto found = tables_.find(key); found != tables_.end()) return found->second;
    }
    Table table = make();
    const MutexLock lock(&mutex_);
    if (tables_.size() < kTablesMax) tables_.emplace(key, table);
    return table;
  }

 private:
  Mutex mutex_;
  std::map<Key, Table> tables_ ABSL_GUARDED_BY(mutex_);
};

// Limits for rows, which take up to some kilobytes, and for tables of twenty rows.
inline constexpr size_t kMadeRowsMax = 1024, kMadeTablesMax = 64;

}  // namespace sheaf::render
