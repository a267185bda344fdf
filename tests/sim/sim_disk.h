// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SimDisk: a file system in memory that knows what of it would survive a loss of power. Each file
// has its bytes as programs read them, and its durable bytes, which follow at fsync; each folder
// likewise has its entries. The rules are those of journaling file systems of Linux:
//
//     fsync of a file      its bytes are durable, and so are the entry that created it and the
//                          folders above it; an entry that a rename made is not
//     fsync of a folder    its entries are durable
//     syncfs               the same of every file and folder, one after the other, files before the
//                          folder that holds them: where it fails or the machine stops, those
//                          before are durable, and the others may be lost
//     anything else        may be lost: changes of a file from some point on, and before it single
//                          sectors; changes of a folder from some point on
//
// After an fsync that failed, the changes stay, and the next one writes them. (Linux may drop them
// and say so only once; a process that starts again then trusts a cache that the disk does not
// have. SQLite knows no remedy, and so the simulation does not ask for one.)
//
// The disk's owner sets a gate, which every change passes and may refuse, and by which the
// machine may stop at that change: then the disk refuses all changes until Restart.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "tests/sim/random.h"

namespace sheaf::sim {

class SimDisk {
 public:
  struct Node;
  using NodePtr = std::shared_ptr<Node>;
  struct FileChange {
    uint64_t offset = 0;
    std::string bytes;       // Written at the offset; or, where `truncates`,
    bool truncates = false;  // the file ends at the offset.
  };
  struct EntryChange {
    std::string name;
    NodePtr node;  // Null: the entry was removed.
    bool by_rename = false;
  };
  struct Node {
    bool is_folder = false;
    uint64_t inode = 0;
    uint64_t version = 0;  // Grows with each change: the time of modification.
    std::weak_ptr<Node> parent;
    std::string name;  // In the parent.
    std::string bytes, durable_bytes;
    std::vector<FileChange> changes;  // Not yet durable.
    std::map<std::string, NodePtr> entries, durable_entries;
    std::vector<EntryChange> entry_changes;
    std::map<uint64_t, std::unique_ptr<std::string>> mappings;  // Shared memory, by offset.
  };

  enum class Operation { kCreate, kWrite, kTruncate, kSync, kRename, kRemove };
  // A gate decides about a change: 0, it happens; an errno, it fails; kStopsMachine, the machine
  // stops during it.
  static constexpr int kStopsMachine = -1;
  // grows: whether the change needs space.
  using Gate = std::function<int(Operation operation, const std::string& path, bool grows)>;

  SimDisk();
  void set_gate(Gate gate) { gate_ = std::move(gate); }

  // All of these return 0 or an errno, and take absolute paths.
  int Open(const std::string& path, bool create, bool truncate, bool exclusive, NodePtr* node);
  int Find(const std::string& path, NodePtr* node) const;
  int Write(const NodePtr& node, uint64_t offset, std::string_view bytes);
  int Truncate(const NodePtr& node, uint64_t size);
  int Sync(const NodePtr& node);
  int SyncAll();
  int Rename(const std::string& from, const std::string& to);
  // folder: whether the entry must be a folder (rmdir) or a file (unlink).
  int Remove(const std::string& path, bool folder);
  int MakeFolder(const std::string& path);

  bool stopped() const { return stopped_; }
  // The machine starts again. power_lost: what was not durable is lost, as `random` has it;
  // otherwise only the process had ended. Returns how many changes were lost.
  int Restart(bool power_lost, Random* random);
  static std::string PathOf(const Node& node);

 private:
  // Asks the gate. Returns 0 or an errno; kStopsMachine where the change is done in part.
  int Pass(Operation operation, const std::string& path, bool grows);
  // Finds the folder of a path; name: its last component.
  int FindFolder(const std::string& path, NodePtr* folder, std::string* name) const;
  void SetEntry(const NodePtr& folder, const std::string& name, NodePtr node, bool by_rename);
  NodePtr MakeNode(bool is_folder);
  static void Apply(const FileChange& change, std::string* bytes);
  static void MakeEntryDurable(const NodePtr& node);
  int SyncBelow(const NodePtr& node);
  int LosePower(const NodePtr& node, Random* random);

  Gate gate_;
  NodePtr root_;
  uint64_t last_inode_ = 0;
  uint64_t last_version_ = 0;
  bool stopped_ = false;
};

}  // namespace sheaf::sim
