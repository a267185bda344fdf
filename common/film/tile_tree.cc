// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/tile_tree.h"

#include <bit>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"

namespace sheaf {
namespace {

std::string BlockText(SampleBlock block) {
  return absl::StrCat("samples [", block.first, ", ", block.End(), ")");
}

// The smallest block that starts at 0 and contains the samples before `end`.
SampleBlock PrefixBlock(uint64_t end) { return {0, std::bit_ceil(end)}; }

}  // namespace

absl::Status TileTree::Insert(FilmTile part) {
  if (!(part.rect() == rect_)) {
    return absl::InvalidArgumentError(
        "the part covers other pixels than the tile it was inserted in");
  }
  const SampleBlock block = part.block();
  const auto after = nodes_.upper_bound(block.first);
  if (after != nodes_.begin()) {
    const SampleBlock before = std::prev(after)->second.block();
    if (Contains(before, block)) {
      return absl::AlreadyExistsError(absl::StrCat(BlockText(block), " are already merged"));
    }
    if (before.End() > block.first) {
      return absl::InvalidArgumentError(absl::StrCat(
          BlockText(block), " overlap ", BlockText(before), ", which are already merged"));
    }
  }
  if (after != nodes_.end() && after->first < block.End()) {
    return absl::InvalidArgumentError(absl::StrCat(BlockText(block), " overlap ",
                                                   BlockText(after->second.block()),
                                                   ", which are already merged"));
  }
  FilmTile node = std::move(part);
  while (true) {
    const auto found = nodes_.find(Sibling(node.block()).first);
    if (found == nodes_.end() || !(found->second.block() == Sibling(node.block()))) break;
    const FilmTile sibling = std::move(found->second);
    nodes_.erase(found);
    node = sibling.block().first < node.block().first ? MergeSiblings(sibling, node)
                                                      : MergeSiblings(node, sibling);
  }
  const uint64_t first = node.block().first;
  nodes_.emplace(first, std::move(node));
  return absl::OkStatus();
}

// Two complete halves are one node, so a block that is covered lies inside a single node.
bool TileTree::Covers(SampleBlock block) const {
  const auto after = nodes_.upper_bound(block.first);
  return after != nodes_.begin() && Contains(std::prev(after)->second.block(), block);
}

uint64_t TileTree::SampleCount() const {
  uint64_t count = 0;
  for (const auto& [first, node] : nodes_) count += node.block().count;
  return count;
}

// A node without a right half equals its left half: the loop folds nodes from the right end up the
// tree.
FilmTile TileTree::Root() const& {
  SHEAF_CHECK(!nodes_.empty());
  return SumWithLast(nodes_.rbegin()->second);
}

FilmTile TileTree::Root() && {
  SHEAF_CHECK(!nodes_.empty());
  FilmTile sum = SumWithLast(std::move(nodes_.rbegin()->second));
  nodes_.clear();
  return sum;
}

FilmTile TileTree::SumWithLast(FilmTile sum) const {
  SHEAF_CHECK(sum.block().End() == SampleCount());
  for (auto node = std::next(nodes_.rbegin()); node != nodes_.rend(); ++node) {
    sum = AddTiles(node->second, sum, Parent(node->second.block()));
  }
  return sum;
}

FilmTile TileTree::PreviewSum() const {
  SHEAF_CHECK(!nodes_.empty());
  const SampleBlock block = PrefixBlock(nodes_.rbegin()->second.block().End());
  auto node = nodes_.begin();
  FilmTile sum = node->second;
  for (++node; node != nodes_.end(); ++node) sum = AddTiles(sum, node->second, block);
  return sum;
}

}  // namespace sheaf
