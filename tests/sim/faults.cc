// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/faults.h"

#include <cmath>
#include <utility>

namespace sheaf::sim {
namespace {

struct FaultKind {
  const char* name;
  double chance_max;  // Each time that it could happen.
};

// In the order of Fault.
constexpr FaultKind kKinds[kFaultCount] = {
    {"request-lost", 0.2},      {"reply-lost", 0.2},
    {"doubled", 0.3},           {"late", 0.2},
    {"upload-cut", 0.4},        {"process-killed", 0.05},
    {"power-lost", 0.05},       {"stopped", 0.03},
    {"write-failed", 0.03},     {"sync-failed", 0.05},
    {"disk-full", 0.02},        {"file-damaged", 0.05},
    {"wall-clock-jumped", 0.1}, {"interleaved", 0.6},
    {"worker-killed", 0.04},    {"worker-frozen", 0.03},
    {"worker-slow", 0.3},       {"task-failed", 0.1},
    {"worker-lies", 0.5},       {"false-pixels", 0.8},
    {"stranger", 0.2},          {"worker-hoards", 0.5},
    {"worker-away", 0.05},      {"version-refused", 0.05},
};

// How many of all seeds have a kind.
constexpr double kKindFraction = 0.4;

template <size_t... kIndices>
std::array<Random, kFaultCount> MakeStreams(const Random& random,
                                            std::index_sequence<kIndices...> /*all*/) {
  return {random.Stream(kIndices)...};
}

}  // namespace

const char* FaultName(Fault fault) { return kKinds[static_cast<size_t>(fault)].name; }

Faults::Faults(uint64_t seed, uint32_t without)
    : streams_(MakeStreams(Random(seed).Stream(1), std::make_index_sequence<kFaultCount>())) {
  for (size_t kind = 0; kind < kFaultCount; ++kind) {
    Random& random = streams_[kind];
    const bool has_kind = random.Chance(kKindFraction);
    const double chance = kKinds[kind].chance_max * std::exp2(-4 * random.Unit());
    if (has_kind && (without >> kind & 1) == 0) chances_[kind] = chance;
  }
}

bool Faults::Happens(Fault fault) {
  const auto kind = static_cast<size_t>(fault);
  if (stopped_ || chances_[kind] == 0 || !streams_[kind].Chance(chances_[kind])) return false;
  ++counts_[kind];
  return true;
}

}  // namespace sheaf::sim
