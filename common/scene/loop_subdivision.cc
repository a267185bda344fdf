// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/loop_subdivision.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/math/elementary.h"

namespace sheaf {
namespace {

constexpr uint32_t kNoFace = UINT32_MAX;

struct Face {
  std::array<uint32_t, 3> vertex;
  std::array<uint32_t, 3> neighbour;  // Across the edge from vertex[i] to vertex[i + 1].
};

// A triangle mesh with its adjacency. Positions are double while the surface is refined.
struct ControlMesh {
  std::vector<Vec3d> positions;
  std::vector<Face> faces;
  std::vector<uint32_t> edge_of_corner;  // 3 * face + i: number of the edge that starts there.
  uint32_t edge_count = 0;
  std::vector<uint32_t> face_of_vertex;  // Some face at the vertex; kNoFace for unused vertices.
};

size_t CornerOf(const Face& face, uint32_t vertex) {
  return face.vertex[0] == vertex ? 0 : (face.vertex[1] == vertex ? 1 : 2);
}
size_t OppositeCorner(const Face& face, uint32_t a, uint32_t b) {
  return 3 - CornerOf(face, a) - CornerOf(face, b);
}
constexpr size_t Next(size_t i) { return i == 2 ? 0 : i + 1; }
constexpr size_t Previous(size_t i) { return i == 0 ? 2 : i - 1; }

// The vertices around a vertex, in order. A closed ring runs clockwise seen from the front; at a
// boundary it runs counter-clockwise from one end to the other.
struct Ring {
  std::vector<uint32_t> vertices;
  size_t face_count = 0;
  bool is_boundary = false;
};

void GatherRing(const ControlMesh& mesh, uint32_t vertex, Ring* ring) {
  ring->vertices.clear();
  ring->face_count = 0;
  ring->is_boundary = false;
  const uint32_t start = mesh.face_of_vertex[vertex];
  if (start == kNoFace) return;
  uint32_t face = start;
  do {
    const Face& f = mesh.faces[face];
    const size_t corner = CornerOf(f, vertex);
    ring->vertices.push_back(f.vertex[Next(corner)]);
    ++ring->face_count;
    if (f.neighbour[corner] == kNoFace) {
      ring->is_boundary = true;
      break;
    }
    face = f.neighbour[corner];
  } while (face != start);
  if (!ring->is_boundary) return;
  // `face` is the last on the clockwise side: walk back from there.
  ring->vertices.assign(1, ring->vertices.back());
  ring->face_count = 0;
  while (face != kNoFace) {
    const Face& f = mesh.faces[face];
    const size_t corner = CornerOf(f, vertex);
    ring->vertices.push_back(f.vertex[Previous(corner)]);
    ++ring->face_count;
    face = f.neighbour[Previous(corner)];
  }
}

struct EdgeRecord {
  uint32_t low, high, corner;
};

absl::Status EdgeError(const EdgeRecord& edge, std::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat("the edge between vertices ", edge.low, " and ",
                                                 edge.high, " ", std::string(why)));
}

// Fills in neighbors, edges and face_of_vertex from the faces' vertices.
absl::Status Connect(ControlMesh* mesh) {
  const size_t corner_count = 3 * mesh->faces.size();
  std::vector<EdgeRecord> edges;
  edges.reserve(corner_count);
  mesh->face_of_vertex.assign(mesh->positions.size(), kNoFace);
  for (size_t corner = 0; corner < corner_count; ++corner) {
    const Face& face = mesh->faces[corner / 3];
    const uint32_t a = face.vertex[corner % 3], b = face.vertex[Next(corner % 3)];
    edges.push_back({std::min(a, b), std::max(a, b), static_cast<uint32_t>(corner)});
    mesh->face_of_vertex[a] = static_cast<uint32_t>(corner / 3);
  }
  std::sort(edges.begin(), edges.end(), [](const EdgeRecord& p, const EdgeRecord& q) {
    return std::tie(p.low, p.high, p.corner) < std::tie(q.low, q.high, q.corner);
  });
  mesh->edge_of_corner.resize(corner_count);
  mesh->edge_count = 0;
  for (size_t i = 0; i < edges.size();) {
    size_t end = i + 1;
    while (end < edges.size() && edges[end].low == edges[i].low &&
           edges[end].high == edges[i].high) {
      ++end;
    }
    if (edges[i].low == edges[i].high) return EdgeError(edges[i], "joins a vertex with itself");
    if (end - i > 2) return EdgeError(edges[i], "belongs to more than two triangles");
    Face& first = mesh->faces[edges[i].corner / 3];
    first.neighbour[edges[i].corner % 3] = kNoFace;
    if (end - i == 2) {
      Face& second = mesh->faces[edges[i + 1].corner / 3];
      if (first.vertex[edges[i].corner % 3] == second.vertex[edges[i + 1].corner % 3]) {
        return EdgeError(edges[i], "lies between triangles that wind in different directions");
      }
      first.neighbour[edges[i].corner % 3] = edges[i + 1].corner / 3;
      second.neighbour[edges[i + 1].corner % 3] = edges[i].corner / 3;
    }
    for (size_t j = i; j < end; ++j) mesh->edge_of_corner[edges[j].corner] = mesh->edge_count;
    ++mesh->edge_count;
    i = end;
  }
  return absl::OkStatus();
}

// Two fans of triangles that touch only in a vertex have no common ring.
absl::Status CheckFans(const ControlMesh& mesh) {
  std::vector<uint32_t> face_counts(mesh.positions.size(), 0);
  for (const Face& face : mesh.faces) {
    for (const uint32_t vertex : face.vertex) ++face_counts[vertex];
  }
  Ring ring;
  for (uint32_t vertex = 0; vertex < mesh.positions.size(); ++vertex) {
    GatherRing(mesh, vertex, &ring);
    if (ring.face_count == face_counts[vertex]) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("vertex ", vertex, " joins triangles that share no edge there"));
  }
  return absl::OkStatus();
}

double Beta(size_t valence) {
  return valence == 3 ? 3.0 / 16 : 3.0 / (8 * static_cast<double>(valence));
}

Vec3d WeightRing(const ControlMesh& mesh, uint32_t vertex, const Ring& ring, double weight) {
  Vec3d sum = mesh.positions[vertex] * (1 - static_cast<double>(ring.vertices.size()) * weight);
  for (const uint32_t other : ring.vertices) sum += mesh.positions[other] * weight;
  return sum;
}

Vec3d WeightBoundary(const ControlMesh& mesh, uint32_t vertex, const Ring& ring, double weight) {
  return mesh.positions[vertex] * (1 - 2 * weight) +
         (mesh.positions[ring.vertices.front()] + mesh.positions[ring.vertices.back()]) * weight;
}

// The position of an old vertex in the next level.
Vec3d RefineVertex(const ControlMesh& mesh, uint32_t vertex, const Ring& ring) {
  if (ring.vertices.empty()) return mesh.positions[vertex];
  if (ring.is_boundary) return WeightBoundary(mesh, vertex, ring, 1.0 / 8);
  const size_t valence = ring.vertices.size();
  return WeightRing(mesh, vertex, ring, Beta(valence));
}

// The position of an old vertex after infinitely many levels.
Vec3d LimitVertex(const ControlMesh& mesh, uint32_t vertex, const Ring& ring) {
  if (ring.vertices.empty()) return mesh.positions[vertex];
  // Boundaries are refined as cubic splines, and this is their limit. (pbrt uses 1/5, which belongs
  // to other rules: the outline would depend on the number of levels.)
  if (ring.is_boundary) return WeightBoundary(mesh, vertex, ring, 1.0 / 6);
  const size_t valence = ring.vertices.size();
  return WeightRing(mesh, vertex, ring,
                    1 / (static_cast<double>(valence) + 3 / (8 * Beta(valence))));
}

Vec3d BoundaryTangent(const ControlMesh& mesh, uint32_t vertex, const Ring& ring) {
  const auto at = [&](size_t i) { return mesh.positions[ring.vertices[i]]; };
  const Vec3d p = mesh.positions[vertex];
  const size_t valence = ring.vertices.size();
  if (valence == 2) return at(0) + at(1) - p * 2.0;
  if (valence == 3) return at(1) - p;
  if (valence == 4) return at(1) * 2.0 + at(2) * 2.0 - at(0) - at(3) - p * 2.0;
  const double theta = std::numbers::pi / static_cast<double>(valence - 1);
  Vec3d sum = (at(0) + at(valence - 1)) * Sin(theta);
  for (size_t i = 1; i + 1 < valence; ++i) {
    sum += at(i) * ((2 * Cos(theta) - 2) * Sin(static_cast<double>(i) * theta));
  }
  return -sum;
}

// Normal of the limit surface, not normalized; mesh.positions are on the limit.
Vec3d LimitNormal(const ControlMesh& mesh, uint32_t vertex, const Ring& ring) {
  if (ring.vertices.empty()) return {0, 0, 1};
  if (ring.is_boundary) {
    const Vec3d along =
        mesh.positions[ring.vertices.back()] - mesh.positions[ring.vertices.front()];
    return Cross(along, BoundaryTangent(mesh, vertex, ring));
  }
  Vec3d s, t;
  const double step = 2 * std::numbers::pi / static_cast<double>(ring.vertices.size());
  for (size_t i = 0; i < ring.vertices.size(); ++i) {
    const double angle = step * static_cast<double>(i);
    s += mesh.positions[ring.vertices[i]] * Cos(angle);
    t += mesh.positions[ring.vertices[i]] * Sin(angle);
  }
  return Cross(s, t);
}

ControlMesh Refine(const ControlMesh& mesh) {
  ControlMesh refined;
  const auto vertex_count = static_cast<uint32_t>(mesh.positions.size());
  refined.positions.resize(vertex_count + mesh.edge_count);
  Ring ring;
  for (uint32_t vertex = 0; vertex < vertex_count; ++vertex) {
    GatherRing(mesh, vertex, &ring);
    refined.positions[vertex] = RefineVertex(mesh, vertex, ring);
  }
  refined.faces.reserve(4 * mesh.faces.size());
  for (size_t i = 0; i < mesh.faces.size(); ++i) {
    const Face& face = mesh.faces[i];
    std::array<uint32_t, 3> middle;
    for (size_t j = 0; j < 3; ++j) {
      const uint32_t a = face.vertex[j], b = face.vertex[Next(j)];
      middle[j] = vertex_count + mesh.edge_of_corner[3 * i + j];
      Vec3d& p = refined.positions[middle[j]];
      p = (mesh.positions[a] + mesh.positions[b]) * 0.5;
      const uint32_t other = face.neighbour[j];
      if (other == kNoFace) continue;
      const Face& across = mesh.faces[other];
      const uint32_t opposite = across.vertex[OppositeCorner(across, a, b)];
      p = p * 0.75 + (mesh.positions[face.vertex[Previous(j)]] + mesh.positions[opposite]) * 0.125;
    }
    for (size_t j = 0; j < 3; ++j) {
      refined.faces.push_back({{face.vertex[j], middle[j], middle[Previous(j)]}, {}});
    }
    refined.faces.push_back({middle, {}});
  }
  return refined;
}

TriangleMesh PushToLimit(ControlMesh mesh) {
  TriangleMesh result;
  Ring ring;
  std::vector<Vec3d> limit(mesh.positions.size());
  for (uint32_t vertex = 0; vertex < limit.size(); ++vertex) {
    GatherRing(mesh, vertex, &ring);
    limit[vertex] = LimitVertex(mesh, vertex, ring);
  }
  mesh.positions = std::move(limit);
  result.positions.reserve(mesh.positions.size());
  result.normals.reserve(mesh.positions.size());
  for (uint32_t vertex = 0; vertex < mesh.positions.size(); ++vertex) {
    GatherRing(mesh, vertex, &ring);
    result.positions.push_back(ToFloat(mesh.positions[vertex]));
    const Vec3d normal = LimitNormal(mesh, vertex, ring);
    const double length = Length(normal);
    // A degenerate vertex has no tangent plane; any direction will do.
    result.normals.push_back(length > 0 ? ToFloat(normal / length) : Vec3f{0, 0, 1});
  }
  result.indices.reserve(3 * mesh.faces.size());
  for (const Face& face : mesh.faces) {
    result.indices.insert(result.indices.end(), face.vertex.begin(), face.vertex.end());
  }
  return result;
}

}  // namespace

absl::StatusOr<TriangleMesh> SubdivideLoop(const std::vector<Vec3f>& positions,
                                           const std::vector<uint32_t>& indices, int32_t levels,
                                           uint64_t triangles_max) {
  SHEAF_CHECK(levels >= 0 && indices.size() % 3 == 0);
  // Corners are numbered in 32 bits.
  const uint64_t count_max = std::min(triangles_max, uint64_t{kNoFace} / 4);
  uint64_t triangle_count = indices.size() / 3;
  for (int32_t level = 0; level < levels && triangle_count <= count_max && triangle_count > 0;
       ++level) {
    triangle_count *= 4;
  }
  if (triangle_count > count_max) {
    return absl::ResourceExhaustedError(
        absl::StrCat(levels, " levels make more than ", count_max, " triangles (triangles_max)"));
  }
  ControlMesh mesh;
  mesh.positions.reserve(positions.size());
  for (const Vec3f& position : positions) mesh.positions.push_back(ToDouble(position));
  for (size_t i = 0; i < indices.size(); i += 3) {
    mesh.faces.push_back({{indices[i], indices[i + 1], indices[i + 2]}, {}});
  }
  if (absl::Status status = Connect(&mesh); !status.ok()) return status;
  if (absl::Status status = CheckFans(mesh); !status.ok()) return status;
  for (int32_t level = 0; level < levels; ++level) {
    mesh = Refine(mesh);
    const absl::Status status = Connect(&mesh);
    SHEAF_CHECK(status.ok());  // Refining a valid mesh gives a valid mesh.
  }
  return PushToLimit(std::move(mesh));
}

}  // namespace sheaf
