// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/vdb_process.h"

#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "common/base/memory_room.h"
#include "common/base/printable.h"
#include "common/process/child_process.h"
#include "common/process/module.h"
#include "common/volume/vdb_wire.h"

namespace sheaf::volume {
namespace {

// Between the end of its socket and the end of the process.
constexpr absl::Duration kEndTimeMax = absl::Seconds(10);

// The protections that this system permits, as far as is known. Bits of the reader's own.
std::atomic<uint32_t> permitted_protections = UINT32_MAX;

std::string DescribeEnd(const ProcessEnd& end) {
  switch (end.signal) {
    case 0:
      return absl::StrCat("OpenVDB ended with exit code ", end.exit_code);
    case SIGXCPU:
      return absl::StrCat("OpenVDB took more than ", kVdbReaderCpuSecondsMax,
                          " s of processor time (cpu_seconds_max)");
    case SIGKILL:
      return "OpenVDB was killed, perhaps for its memory";
    default:
      return absl::StrCat("OpenVDB crashed (", ::strsignal(end.signal), ")");
  }
}

// The reader and its answers: a stream, each of whose sizes is checked before it is used.
class Reader {
 public:
  static absl::StatusOr<Reader> Start(const std::string& file_name, const FileBytes& file) {
    const std::string program = FindInFolders(ModuleFolders(), kVdbReaderProgram);
    if (program.empty()) {
      return absl::FailedPreconditionError(
          absl::StrCat(".vdb files cannot be read: ", kVdbReaderProgram, " is missing beside this ",
                       "program; install all of Sheaf (see its README)"));
    }
    auto child = ChildProcess::Start(program, {kVdbReaderProgram}, SIGKILL, file.descriptor());
    if (!child.ok()) return child.status();
    return Reader(file_name, *std::move(child));
  }

  absl::Status Send(VdbRequest request) {
    const std::string file_name = file_name_.substr(0, kVdbFileNameBytesMax);
    request.file_name_bytes = static_cast<uint32_t>(file_name.size());
    std::string bytes(reinterpret_cast<const char*>(&request), sizeof(request));
    bytes += file_name;
    // Fits into the socket's buffer.
    const ssize_t sent = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    return sent == static_cast<ssize_t>(bytes.size()) ? absl::OkStatus() : Ended();
  }
  // The payload follows.
  absl::StatusOr<uint64_t> ReceiveReply(uint64_t payload_bytes_max) {
    VdbReply reply;
    if (!ReceiveAll(socket_.get(), &reply, sizeof(reply))) return Ended();
    if (reply.text_bytes > kVdbTextBytesMax || reply.payload_bytes > payload_bytes_max) {
      return Malformed();
    }
    std::string text(reply.text_bytes, '\0');
    if (!Receive(text.data(), text.size())) return Ended();
    text = Printable(text);
    switch (static_cast<absl::StatusCode>(reply.code)) {
      case absl::StatusCode::kOk:
        return reply.payload_bytes;
      case absl::StatusCode::kInvalidArgument:
        return absl::InvalidArgumentError(text);
      case absl::StatusCode::kResourceExhausted:
        return absl::ResourceExhaustedError(text);
      case absl::StatusCode::kFailedPrecondition:
        return absl::FailedPreconditionError(text);
      case absl::StatusCode::kUnavailable:
        return absl::UnavailableError(text);
      default:
        return absl::DataLossError(text);
    }
  }
  bool Receive(void* bytes, size_t size_bytes) {
    return ReceiveAll(socket_.get(), bytes, size_bytes);
  }

  absl::Status Malformed() const {
    return absl::DataLossError(
        absl::StrCat(file_name_, ": OpenVDB gave a malformed answer: the file is damaged"));
  }
  // The reason why the process has ended, which it has or does now.
  absl::Status Ended() {
    const ProcessEnd end = child_->Wait(kEndTimeMax);
    return absl::DataLossError(absl::StrCat(file_name_, ": ", DescribeEnd(end),
                                            " in a process of its own: the file is damaged; "
                                            "write it again"));
  }

 private:
  Reader(std::string file_name, std::unique_ptr<ChildProcess> child)
      : file_name_(std::move(file_name)), child_(std::move(child)), socket_(child_->TakeSocket()) {}

  std::string file_name_;
  std::unique_ptr<ChildProcess> child_;
  FileDescriptor socket_;
};

class VdbFileInProcess : public VdbFile {
 public:
  VdbFileInProcess(Reader reader, const VolumeLimits& limits)
      : reader_(std::move(reader)), limits_(limits) {}

  absl::StatusOr<std::vector<VolumeFileEntry>> List() override {
    const auto size = Ask({.verb = VdbVerb::kList, .limits = limits_}, kVdbListBytesMax);
    if (!size.ok()) return size.status();
    std::string bytes(*size, '\0');
    if (!reader_.Receive(bytes.data(), bytes.size())) return reader_.Ended();
    auto entries = DecodeVdbList(bytes);
    if (!entries.ok() || entries->size() > static_cast<size_t>(limits_.grid_count_max)) {
      return reader_.Malformed();
    }
    return entries;
  }

  absl::StatusOr<VolumeBytes> Read(size_t index) override {
    const auto size =
        Ask({.verb = VdbVerb::kRead, .limits = limits_, .index = index}, limits_.grid_bytes_max);
    if (!size.ok()) return size.status();
    VolumeBytes image(*size);
    if (image.data() == nullptr) {
      return absl::ResourceExhaustedError(absl::StrCat("no memory for the ", *size, " bytes"));
    }
    if (!reader_.Receive(image.data(), image.size())) return reader_.Ended();
    return image;
  }

  absl::StatusOr<VolumeSurface> Surface(size_t index, float isovalue) override {
    const auto size =
        Ask({.verb = VdbVerb::kSurface, .limits = limits_, .index = index, .isovalue = isovalue},
            limits_.grid_bytes_max + sizeof(SurfaceCounts));
    if (!size.ok()) return size.status();
    SurfaceCounts counts;
    if (*size < sizeof(counts)) return reader_.Malformed();
    if (!reader_.Receive(&counts, sizeof(counts))) return reader_.Ended();
    if (counts.positions > *size || counts.triangle_indices > *size) return reader_.Malformed();
    VolumeSurface surface;
    surface.positions.resize(counts.positions);
    surface.normals.resize(counts.positions);
    surface.triangles.resize(counts.triangle_indices);
    if (surface.SizeBytes() != *size - sizeof(counts)) return reader_.Malformed();
    const auto receive = [&](auto& values) {
      return reader_.Receive(values.data(), values.size() * sizeof(values[0]));
    };
    if (!receive(surface.positions) || !receive(surface.normals) || !receive(surface.triangles)) {
      return reader_.Ended();
    }
    return surface;
  }

 private:
  absl::StatusOr<uint64_t> Ask(const VdbRequest& request, uint64_t payload_bytes_max) {
    if (absl::Status status = reader_.Send(request); !status.ok()) return status;
    return reader_.ReceiveReply(payload_bytes_max);
  }

  Reader reader_;
  const VolumeLimits limits_;
};

// Starts a reader with the protections. If one is not available, *missing has it.
absl::StatusOr<Reader> StartConfined(const std::string& file_name, const FileBytes& file,
                                     const VolumeLimits& limits, uint32_t protections,
                                     uint32_t* missing) {
  absl::StatusOr<Reader> reader = Reader::Start(file_name, file);
  if (!reader.ok()) return reader;
  VdbRequest request{.protections = protections, .cpu_seconds_max = kVdbReaderCpuSecondsMax};
  request.memory_bytes_max = std::min(VdbReaderMemoryBytesMax(limits), FindMemoryRoom().bytes);
  if (absl::Status status = reader->Send(request); !status.ok()) return status;
  const auto size = reader->ReceiveReply(sizeof(*missing));
  if (!size.ok()) return size.status();
  if (*size != sizeof(*missing)) return reader->Malformed();
  if (!reader->Receive(missing, sizeof(*missing))) return reader->Ended();
  return reader;
}

}  // namespace

absl::StatusOr<std::unique_ptr<VdbFile>> OpenVdbInProcess(const std::string& file_name,
                                                          const FileBytes& file,
                                                          const VolumeLimits& limits) {
  while (true) {
    const uint32_t protections = permitted_protections;
    uint32_t missing = 0;
    absl::StatusOr<Reader> reader = StartConfined(file_name, file, limits, protections, &missing);
    if (!reader.ok()) return reader.status();
    if ((missing & protections) == 0) {
      return std::make_unique<VdbFileInProcess>(*std::move(reader), limits);
    }
    // As far as the system permits: a process that lacks one is of no use, and the next goes
    // without.
    permitted_protections &= ~missing;
  }
}

}  // namespace sheaf::volume
