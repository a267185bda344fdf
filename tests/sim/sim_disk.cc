// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/sim_disk.h"

#include <algorithm>
#include <cerrno>
#include <utility>

namespace sheaf::sim {
namespace {

constexpr uint64_t kSectorBytes = 512;
constexpr uint64_t kPageBytes = 4096;

// Calls visit with each component of the path.
template <typename Visit>
void ForComponents(std::string_view path, const Visit& visit) {
  while (!path.empty()) {
    const size_t end = std::min(path.find('/'), path.size());
    const std::string_view name = path.substr(0, end);
    path.remove_prefix(std::min(end + 1, path.size()));
    if (!name.empty() && name != ".") visit(std::string(name));
  }
}

// How much a process has written that is killed while it writes. The kernel looks for its end after
// each page that it copies.
uint64_t WrittenBytes(uint64_t offset, uint64_t bytes) {
  const uint64_t page_end = (offset + bytes / 2) / kPageBytes * kPageBytes;
  return page_end > offset ? page_end - offset : 0;
}

}  // namespace

SimDisk::SimDisk() : root_(MakeNode(/*is_folder=*/true)) {}

SimDisk::NodePtr SimDisk::MakeNode(bool is_folder) {
  auto node = std::make_shared<Node>();
  node->is_folder = is_folder;
  node->inode = ++last_inode_;
  node->version = ++last_version_;
  return node;
}

std::string SimDisk::PathOf(const Node& node) {
  const NodePtr parent = node.parent.lock();
  return parent == nullptr ? "" : PathOf(*parent) + "/" + node.name;
}

int SimDisk::Find(const std::string& path, NodePtr* node) const {
  NodePtr at = root_;
  int error = 0;
  ForComponents(path, [&](const std::string& name) {
    if (error != 0) return;
    if (!at->is_folder) {
      error = ENOTDIR;
      return;
    }
    const auto entry = at->entries.find(name);
    if (entry == at->entries.end()) {
      error = ENOENT;
    } else {
      at = NodePtr(entry->second);
    }
  });
  if (error == 0) *node = std::move(at);
  return error;
}

int SimDisk::FindFolder(const std::string& path, NodePtr* folder, std::string* name) const {
  const size_t slash = path.find_last_of('/');
  *name = path.substr(slash + 1);
  if (const int error = Find(path.substr(0, slash), folder); error != 0) return error;
  return (*folder)->is_folder ? 0 : ENOTDIR;
}

int SimDisk::Pass(Operation operation, const std::string& path, bool grows) {
  if (stopped_) return EIO;
  const int result = gate_ ? gate_(operation, path, grows) : 0;
  if (result == kStopsMachine) stopped_ = true;
  return result;
}

void SimDisk::SetEntry(const NodePtr& folder, const std::string& name, NodePtr node,
                       bool by_rename) {
  folder->entry_changes.push_back({name, node, by_rename});
  folder->version = ++last_version_;
  if (node == nullptr) {
    folder->entries.erase(name);
    return;
  }
  node->parent = folder;
  node->name = name;
  folder->entries[name] = std::move(node);
}

int SimDisk::Open(const std::string& path, bool create, bool truncate, bool exclusive,
                  NodePtr* node) {
  NodePtr found;
  const int error = Find(path, &found);
  if (error == 0 && create && exclusive) return EEXIST;
  if (error == 0) {
    *node = found;
    return truncate && !found->bytes.empty() ? Truncate(found, 0) : 0;
  }
  if (error != ENOENT || !create) return error;
  NodePtr folder;
  std::string name;
  if (const int e = FindFolder(path, &folder, &name); e != 0) return e;
  if (const int e = Pass(Operation::kCreate, path, /*grows=*/true); e != 0) {
    return e == kStopsMachine ? EIO : e;
  }
  *node = MakeNode(/*is_folder=*/false);
  SetEntry(folder, name, *node, /*by_rename=*/false);
  return 0;
}

void SimDisk::Apply(const FileChange& change, std::string* bytes) {
  if (change.truncates) {
    bytes->resize(change.offset);
    return;
  }
  if (bytes->size() < change.offset + change.bytes.size()) {
    bytes->resize(change.offset + change.bytes.size());
  }
  std::copy(change.bytes.begin(), change.bytes.end(),
            bytes->begin() + static_cast<int64_t>(change.offset));
}

int SimDisk::Write(const NodePtr& node, uint64_t offset, std::string_view bytes) {
  const bool grows = offset + bytes.size() > node->bytes.size();
  const int passed = Pass(Operation::kWrite, PathOf(*node), grows);
  if (passed != 0 && passed != kStopsMachine) return passed;
  if (passed == kStopsMachine) bytes = bytes.substr(0, WrittenBytes(offset, bytes.size()));
  FileChange change{offset, std::string(bytes), /*truncates=*/false};
  Apply(change, &node->bytes);
  node->changes.push_back(std::move(change));
  node->version = ++last_version_;
  return passed == 0 ? 0 : EIO;
}

int SimDisk::Truncate(const NodePtr& node, uint64_t size) {
  const bool grows = size > node->bytes.size();
  if (const int e = Pass(Operation::kTruncate, PathOf(*node), grows); e != 0) {
    return e == kStopsMachine ? EIO : e;
  }
  node->mappings.clear();  // No file is truncated while it is mapped: only SQLite's is, at a start.
  FileChange change{size, "", /*truncates=*/true};
  Apply(change, &node->bytes);
  node->changes.push_back(std::move(change));
  node->version = ++last_version_;
  return 0;
}

// Makes the node's entry durable where it was created and not renamed, and those of all folders
// above it.
void SimDisk::MakeEntryDurable(const NodePtr& node) {
  const NodePtr parent = node->parent.lock();
  if (parent == nullptr) return;
  std::vector<EntryChange>& changes = parent->entry_changes;
  const auto created = std::find_if(changes.begin(), changes.end(), [&](const EntryChange& c) {
    return c.node == node && c.name == node->name && !c.by_rename;
  });
  if (created != changes.end()) {
    parent->durable_entries[node->name] = node;
    // The name's earlier meaning can no longer come back.
    const auto end = created + 1;
    changes.erase(std::remove_if(changes.begin(), end,
                                 [&](const EntryChange& c) { return c.name == node->name; }),
                  end);
  }
  MakeEntryDurable(parent);
}

int SimDisk::Sync(const NodePtr& node) {
  if (node->changes.empty() && node->entry_changes.empty()) {
    if (stopped_) return EIO;
    MakeEntryDurable(node);
    return 0;
  }
  const int passed = Pass(Operation::kSync, PathOf(*node), /*grows=*/false);
  if (passed != 0) return EIO;
  for (const FileChange& change : node->changes) Apply(change, &node->durable_bytes);
  node->changes.clear();
  if (node->is_folder) {
    node->durable_entries = node->entries;
    node->entry_changes.clear();
  }
  MakeEntryDurable(node);
  return 0;
}

int SimDisk::SyncAll() { return stopped_ ? EIO : SyncBelow(root_); }

int SimDisk::SyncBelow(const NodePtr& node) {
  for (const auto& [name, child] : node->entries) {
    if (const int error = SyncBelow(child); error != 0) return error;
  }
  return node->changes.empty() && node->entry_changes.empty() ? 0 : Sync(node);
}

int SimDisk::Rename(const std::string& from, const std::string& to) {
  NodePtr node, source, target;
  std::string source_name, target_name;
  if (const int e = Find(from, &node); e != 0) return e;
  if (const int e = FindFolder(from, &source, &source_name); e != 0) return e;
  if (const int e = FindFolder(to, &target, &target_name); e != 0) return e;
  if (const int e = Pass(Operation::kRename, to, /*grows=*/false); e != 0) {
    return e == kStopsMachine ? EIO : e;
  }
  SetEntry(target, target_name, node, /*by_rename=*/true);
  SetEntry(source, source_name, nullptr, /*by_rename=*/true);
  return 0;
}

int SimDisk::Remove(const std::string& path, bool folder) {
  NodePtr node, parent;
  std::string name;
  if (const int e = Find(path, &node); e != 0) return e;
  if (folder && !node->is_folder) return ENOTDIR;
  if (!folder && node->is_folder) return EISDIR;
  if (folder && !node->entries.empty()) return ENOTEMPTY;
  if (const int e = FindFolder(path, &parent, &name); e != 0) return e;
  if (const int e = Pass(Operation::kRemove, path, /*grows=*/false); e != 0) {
    return e == kStopsMachine ? EIO : e;
  }
  SetEntry(parent, name, nullptr, /*by_rename=*/false);
  return 0;
}

int SimDisk::MakeFolder(const std::string& path) {
  NodePtr found, parent;
  std::string name;
  if (Find(path, &found) == 0) return EEXIST;
  if (const int e = FindFolder(path, &parent, &name); e != 0) return e;
  if (const int e = Pass(Operation::kCreate, path, /*grows=*/true); e != 0) {
    return e == kStopsMachine ? EIO : e;
  }
  SetEntry(parent, name, MakeNode(/*is_folder=*/true), /*by_rename=*/false);
  return 0;
}

int SimDisk::Restart(bool power_lost, Random* random) {
  stopped_ = false;
  return power_lost ? LosePower(root_, random) : 0;
}

int SimDisk::LosePower(const NodePtr& node, Random* random) {
  int lost = 0;
  std::string bytes = node->durable_bytes;
  const size_t kept = random->Below(node->changes.size() + 1);
  lost += static_cast<int>(node->changes.size() - kept);
  const bool torn = random->Chance(0.5);
  for (size_t i = 0; i < kept; ++i) {
    const FileChange& change = node->changes[i];
    if (change.truncates || !torn) {
      Apply(change, &bytes);
      continue;
    }
    for (uint64_t at = 0; at < change.bytes.size(); at += kSectorBytes) {
      if (random->Chance(0.3)) continue;
      Apply({change.offset + at, change.bytes.substr(at, kSectorBytes), false}, &bytes);
    }
  }
  node->durable_bytes = node->bytes = std::move(bytes);
  node->changes.clear();
  node->mappings.clear();
  node->version = ++last_version_;
  if (!node->is_folder) return lost;
  const size_t entries_kept = random->Below(node->entry_changes.size() + 1);
  lost += static_cast<int>(node->entry_changes.size() - entries_kept);
  for (size_t i = 0; i < entries_kept; ++i) {
    const EntryChange& change = node->entry_changes[i];
    if (change.node == nullptr) {
      node->durable_entries.erase(change.name);
    } else {
      node->durable_entries[change.name] = change.node;
    }
  }
  node->entry_changes.clear();
  node->entries = node->durable_entries;
  for (const auto& [name, child] : node->entries) {
    child->parent = node;
    child->name = name;
    lost += LosePower(child, random);
  }
  return lost;
}

}  // namespace sheaf::sim
