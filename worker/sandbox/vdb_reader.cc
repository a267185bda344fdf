// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf-vdb-reader: reads one .vdb file for a program that is not confined itself. Its standard
// input is the file, and kChildSocket its only other link (common/volume/vdb_wire.h). It confines
// itself before it loads OpenVDB and reads the first byte of the file.
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/process/child_process.h"
#include "common/volume/vdb_library.h"
#include "common/volume/vdb_wire.h"
#include "worker/sandbox/confinement.h"

namespace sheaf::worker {
namespace {

using volume::VdbReply;
using volume::VdbRequest;
using volume::VdbVerb;

// The first process of a process namespace ignores signals without a handler.
void EndBySignal(int number) { ::_exit(kExitBySignal + number); }

void PrepareProcess() {
  EndWithParent();
  ::close_range(kChildSocket + 1, ~0U, 0);
  // The output of OpenVDB is not read: a full pipe must not stop it.
  for (const int output : {STDOUT_FILENO, STDERR_FILENO}) ::fcntl(output, F_SETFL, O_NONBLOCK);
  ::signal(SIGPIPE, SIG_IGN);
  for (const int number : {SIGABRT, SIGXCPU}) ::signal(number, EndBySignal);
  // A terminal sends these to all processes; the program decides what they mean.
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) ::signal(number, SIG_IGN);
}

// The payload follows.
bool BeginReply(const absl::Status& status, size_t payload_bytes) {
  const std::string text = std::string(status.message().substr(0, volume::kVdbTextBytesMax));
  VdbReply reply;
  reply.code = static_cast<int32_t>(status.code());
  reply.text_bytes = static_cast<uint32_t>(text.size());
  reply.payload_bytes = payload_bytes;
  return volume::SendAll(kChildSocket, &reply, sizeof(reply)) &&
         volume::SendAll(kChildSocket, text.data(), text.size());
}
bool Reply(const absl::Status& status, const void* payload, size_t payload_bytes) {
  if (!status.ok()) return BeginReply(status, 0);
  return BeginReply(status, payload_bytes) && volume::SendAll(kChildSocket, payload, payload_bytes);
}

absl::Status LimitCpu(uint64_t seconds) {
  constexpr rlim_t kEndSeconds = 5;  // The signal of the soft limit can be told from other ends.
  rlimit limit{};
  ::getrlimit(RLIMIT_CPU, &limit);
  limit.rlim_max = std::min<rlim_t>(limit.rlim_max, seconds + kEndSeconds);
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, seconds);
  return ::setrlimit(RLIMIT_CPU, &limit) == 0
             ? absl::OkStatus()
             : absl::UnavailableError("the processor time cannot be limited");
}

bool ConfineThis(const VdbRequest& request) {
  Confinement confinement;
  confinement.protections = Protections(request.protections & Protections::All().bits());
  confinement.memory_bytes_max = request.memory_bytes_max;
  absl::Status status = LimitCpu(request.cpu_seconds_max);
  Protections missing;
  if (status.ok()) status = Confine(confinement, &missing);
  // The program then starts another, with what is there.
  if (!missing.empty()) status = absl::OkStatus();
  const uint32_t bits = missing.bits();
  return Reply(status, &bits, sizeof(bits)) && status.ok() && missing.empty();
}

bool List(const VdbRequest& request, const std::string& file_name) {
  const auto library = volume::LoadVdbLibrary();
  if (!library.ok()) return Reply(library.status(), nullptr, 0);
  const auto entries = (*library)->list(file_name, STDIN_FILENO, request.limits);
  if (!entries.ok()) return Reply(entries.status(), nullptr, 0);
  const std::string bytes = volume::EncodeVdbList(*entries);
  if (bytes.size() > volume::kVdbListBytesMax) {
    return Reply(absl::ResourceExhaustedError(absl::StrCat(
                     file_name, ": the names of its grids take ", bytes.size(),
                     " bytes, more than ", volume::kVdbListBytesMax, " (kVdbListBytesMax)")),
                 nullptr, 0);
  }
  return Reply(absl::OkStatus(), bytes.data(), bytes.size());
}

bool Read(const VdbRequest& request, const std::string& file_name) {
  const auto library = volume::LoadVdbLibrary();
  if (!library.ok()) return Reply(library.status(), nullptr, 0);
  const auto image = (*library)->read(file_name, STDIN_FILENO, request.index, request.limits);
  return image.ok() ? Reply(absl::OkStatus(), image->data(), image->size())
                    : Reply(image.status(), nullptr, 0);
}

bool Surface(const VdbRequest& request, const std::string& file_name) {
  const auto library = volume::LoadVdbLibrary();
  if (!library.ok()) return Reply(library.status(), nullptr, 0);
  const auto surface =
      (*library)->surface(file_name, STDIN_FILENO, request.index, request.isovalue, request.limits);
  if (!surface.ok()) return Reply(surface.status(), nullptr, 0);
  const volume::SurfaceCounts counts{surface->positions.size(), surface->triangles.size()};
  const auto send = [](const auto& values) {
    return volume::SendAll(kChildSocket, values.data(), values.size() * sizeof(values[0]));
  };
  return BeginReply(absl::OkStatus(), sizeof(counts) + surface->SizeBytes()) &&
         volume::SendAll(kChildSocket, &counts, sizeof(counts)) && send(surface->positions) &&
         send(surface->normals) && send(surface->triangles);
}

// Until the program closes the socket, or sends what it never sends.
bool ServeOne() {
  VdbRequest request;
  if (!volume::ReceiveAll(kChildSocket, &request, sizeof(request))) return false;
  if (request.version != volume::kVdbWireVersion ||
      request.file_name_bytes > volume::kVdbFileNameBytesMax) {
    Reply(absl::FailedPreconditionError("sheaf-vdb-reader is of another version than this program; "
                                        "install all of Sheaf (see its README)"),
          nullptr, 0);
    return false;
  }
  std::string file_name(request.file_name_bytes, '\0');
  if (!volume::ReceiveAll(kChildSocket, file_name.data(), file_name.size())) return false;
  switch (request.verb) {
    case VdbVerb::kConfine:
      return ConfineThis(request);
    case VdbVerb::kList:
      return List(request, file_name);
    case VdbVerb::kRead:
      return Read(request, file_name);
    case VdbVerb::kSurface:
      return Surface(request, file_name);
  }
  return false;
}

}  // namespace
}  // namespace sheaf::worker

int main() {
  sheaf::worker::PrepareProcess();
  while (sheaf::worker::ServeOne()) {
  }
  return 0;
}
