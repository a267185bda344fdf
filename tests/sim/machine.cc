// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/machine.h"

#include <sqlite3.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/base/check.h"

namespace sheaf::sim {
namespace {

constexpr size_t kRandomBytes = 4096;

// The last one is the current one.
std::vector<Machine*> machines;

}  // namespace

Machine::Machine(uint64_t seed) : random_bytes_(seed) {
  machines.push_back(this);
  SHEAF_CHECK(disk_.MakeFolder(kSimRoot) == 0);
  SimDisk::NodePtr node;
  SHEAF_CHECK(disk_.Open(kSimRandomDevice, /*create=*/true, false, false, &node) == 0);
  SHEAF_CHECK(disk_.Write(node, 0, std::string(kRandomBytes, 'r')) == 0 && disk_.Sync(node) == 0);
  sqlite3_randomness(0, nullptr);  // It reads the device again.
}

Machine::~Machine() {
  SHEAF_CHECK(machines.back() == this);
  machines.pop_back();
  sqlite3_randomness(0, nullptr);
}

Machine* Machine::Current() { return machines.empty() ? nullptr : machines.back(); }

int Machine::AddDescriptor(OpenFile file) {
  files_.emplace(next_descriptor_, std::move(file));
  return next_descriptor_++;
}

Machine::OpenFile* Machine::FindDescriptor(int descriptor) {
  const auto found = files_.find(descriptor);
  return found == files_.end() ? nullptr : &found->second;
}

void Machine::RemoveDescriptor(int descriptor) { files_.erase(descriptor); }

void* Machine::Map(const SimDisk::NodePtr& node, uint64_t offset, uint64_t size) {
  std::unique_ptr<std::string>& mapping = node->mappings[offset];
  if (mapping == nullptr) mapping = std::make_unique<std::string>(size, '\0');
  SHEAF_CHECK(mapping->size() == size);
  mapped_.insert(mapping->data());
  return mapping->data();
}

bool Machine::Unmap(const void* address) { return mapped_.erase(address) > 0; }

}  // namespace sheaf::sim
