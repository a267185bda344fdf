// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/policy/peer_directory.h"

#include <algorithm>

namespace sheaf::coordinator {

const char* PeerTroubleKindName(PeerTroubleKind kind) {
  switch (kind) {
    case PeerTroubleKind::kUnreachable:
      return "unreachable";
    case PeerTroubleKind::kRefused:
      return "refused";
    case PeerTroubleKind::kWrongBytes:
      return "wrong_bytes";
    case PeerTroubleKind::kMissing:
      return "missing";
  }
  return "unreachable";
}

bool PeerDirectory::Serves(const Worker& worker, SteadyTime now) const {
  return !worker.contact.address.empty() && now - worker.last_seen <= kPeerSilenceMax &&
         worker.shunned_until <= now;
}

void PeerDirectory::ForgetSilentWorkers(SteadyTime now) {
  std::erase_if(workers_, [now](const auto& entry) {
    const Worker& worker = entry.second;
    return now - worker.last_seen > kPeerSilenceMax && worker.shunned_until <= now;
  });
}

void PeerDirectory::Report(const PeerContact& worker, const std::vector<std::string>& held,
                           const std::vector<std::string>& fetching, SteadyTime now) {
  if (!workers_.contains(worker.worker_id)) {
    ForgetSilentWorkers(now);
    if (workers_.size() >= kDirectoryWorkersMax) return;
  }
  Worker& known = workers_[worker.worker_id];
  known.contact = worker;
  known.last_seen = now;
  for (const std::string& name : held) {
    if (blobs_.size() >= kDirectoryBlobsMax && !blobs_.contains(name)) blobs_.clear();
    Blob& blob = blobs_[name];
    if (blob.fetch && blob.fetch->worker_id == worker.worker_id) blob.fetch.reset();
    if (std::ranges::find(blob.holders, worker.worker_id) != blob.holders.end()) continue;
    if (blob.holders.size() >= kHoldersPerBlobMax) blob.holders.erase(blob.holders.begin());
    blob.holders.push_back(worker.worker_id);
  }
  for (const std::string& name : fetching) {
    const auto blob = blobs_.find(name);
    if (blob == blobs_.end() || !blob->second.fetch) continue;
    if (blob->second.fetch->worker_id == worker.worker_id) blob->second.fetch->last_seen = now;
  }
}

PeerAnswer PeerDirectory::Locate(const std::string& name, const std::string& worker_id, bool serves,
                                 const std::set<std::string>& tried, SteadyTime now) {
  if (blobs_.size() >= kDirectoryBlobsMax && !blobs_.contains(name)) blobs_.clear();
  Blob& blob = blobs_[name];
  // Drops peers that are gone.
  std::erase_if(blob.holders, [&](const std::string& holder) {
    const auto worker = workers_.find(holder);
    return worker == workers_.end() || now - worker->second.last_seen > kPeerSilenceMax;
  });
  std::vector<Worker*> candidates;
  for (const std::string& holder : blob.holders) {
    Worker& worker = workers_.at(holder);
    const bool fits = holder != worker_id && !tried.contains(holder) && Serves(worker, now);
    if (fits) candidates.push_back(&worker);
  }
  if (!candidates.empty()) {
    std::ranges::stable_sort(candidates, {}, &Worker::offer_count);
    ++candidates.front()->offer_count;
    PeerAnswer answer;
    for (size_t i = 0; i < std::min(candidates.size(), kPeersAnsweredMax); ++i) {
      answer.peers.push_back(candidates[i]->contact);
    }
    return answer;
  }
  if (!serves) return {{}, true};
  const bool taken = blob.fetch && blob.fetch->worker_id != worker_id &&
                     now - blob.fetch->last_seen <= kFetchSilenceMax;
  if (taken) return {};
  blob.fetch = Fetch{worker_id, now};
  return {{}, true};
}

void PeerDirectory::NoteTrouble(const std::string& peer_id, const std::string& blob,
                                PeerTroubleKind kind, const std::string& accuser, SteadyTime now) {
  if (const auto found = blobs_.find(blob); found != blobs_.end()) {
    if (kind != PeerTroubleKind::kRefused) std::erase(found->second.holders, peer_id);
  }
  const auto worker = workers_.find(peer_id);
  if (worker == workers_.end() || kind != PeerTroubleKind::kWrongBytes) return;
  worker->second.accusers.insert(accuser);
  if (worker->second.accusers.size() < kAccusersMax) return;
  worker->second.accusers.clear();
  worker->second.shunned_until = now + kShunnedTime;
}

size_t PeerDirectory::CountServing(SteadyTime now) const {
  return static_cast<size_t>(std::ranges::count_if(
      workers_, [&](const auto& entry) { return Serves(entry.second, now); }));
}

}  // namespace sheaf::coordinator
