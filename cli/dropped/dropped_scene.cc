// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/dropped/dropped_scene.h"

#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <new>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "cli/dropped/scene_choice.h"
#include "cli/dropped/zip_files.h"
#include "cli/job/prepared_job.h"
#include "common/base/memory_room.h"
#include "common/base/status.h"
#include "common/process/child_process.h"
#include "sheaf/v1/submission.pb.h"
#include "worker/sandbox/confinement.h"

namespace sheaf::cli {
namespace {

namespace fs = std::filesystem;

constexpr size_t kRequestBytesMax = size_t{1} << 20;
// In the folder of the submission.
constexpr char kFiles[] = "files";
constexpr char kScratch[] = "scratch";
constexpr char kUnpacked[] = "scratch/unpacked";

// The first process of a process namespace ignores signals without a handler, SIGABRT too.
void EndAsAborted(int number) { ::_exit(kExitBySignal + number); }

void PrepareProcess() {
  worker::EndWithParent();
  ::close_range(STDERR_FILENO + 1, ~0U, 0);
  ::signal(SIGPIPE, SIG_IGN);
  ::signal(SIGXFSZ, SIG_IGN);  // Writing fails with EFBIG instead.
  ::signal(SIGABRT, EndAsAborted);
}

absl::StatusOr<std::string> ReadAll(int file, size_t bytes_max) {
  std::string bytes;
  char piece[16 << 10];
  while (true) {
    const ssize_t size = ::read(file, piece, sizeof piece);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return StatusFromErrno(errno, "reading the request");
    if (size == 0) return bytes;
    bytes.append(piece, static_cast<size_t>(size));
    if (bytes.size() > bytes_max) return absl::ResourceExhaustedError("the request is too large");
  }
}

bool WriteAllTo(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes.remove_prefix(static_cast<size_t>(written));
  }
  return true;
}

absl::Status ConfineTo(const v1::PrepareRequest& request, worker::Protections* missing) {
  worker::Confinement confinement;
  confinement.protections = worker::Protections(request.protections());
  confinement.memory_bytes_max = request.memory_bytes_max();
  const std::string files = absl::StrCat(request.folder(), "/", kFiles);
  confinement.files.push_back({files, files});
  confinement.writable_folder = absl::StrCat(request.folder(), "/", kScratch);
  confinement.file_bytes_max = request.written_bytes_max();
  if (absl::Status status = worker::Confine(confinement, missing); !status.ok()) return status;
  // Paths are relative from here on, so that messages show the dropped names.
  if (::chdir(request.folder().c_str()) != 0) return StatusFromErrno(errno, "entering the folder");
  ::setenv("TMPDIR", kScratch, 1);  // For DerivedFiles.
  // Looking up the user's home may take a socket, which ends the process.
  ::setenv("HOME", confinement.writable_folder.c_str(), 1);
  return absl::OkStatus();
}

// The path of a zip file that was dropped alone; empty if there is none.
std::string ZipAlone() {
  std::string path;
  int count = 0;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(kFiles, error)) {
    ++count;
    path = entry.path().string();
  }
  return count == 1 && absl::AsciiStrToLower(fs::path(path).extension().string()) == ".zip" ? path
                                                                                            : "";
}

// The folder with the files, unpacked if necessary.
absl::StatusOr<std::string> FolderOf(const v1::PrepareRequest& request) {
  const std::string zip = ZipAlone();
  if (zip.empty()) return std::string(kFiles);
  std::error_code error;
  fs::create_directory(kUnpacked, error);
  if (error) return StatusFromErrno(error.value(), "making a folder to unpack into");
  const ZipLimits limits{request.written_bytes_max(), request.written_files_max()};
  if (absl::Status status = UnpackZip(zip, kUnpacked, limits); !status.ok()) return status;
  return std::string(kUnpacked);
}

JobArguments ArgumentsOf(const v1::PrepareRequest& request, const std::string& scene) {
  JobArguments arguments;
  arguments.scene = scene;
  arguments.title = request.title();
  if (request.samples() > 0) arguments.settings.samples = request.samples();
  arguments.stop.target_error = request.target_error();
  return arguments;
}

void AddJob(const JobArguments& arguments, const PreparedJob& job, v1::PrepareReply* reply) {
  *reply->mutable_job() = MakeCreateJobRequest(arguments, job);
  for (const auto& [hex, source] : job.blobs) {
    v1::PreparedBlob& blob = *reply->add_blobs();
    blob.mutable_digest()->set_sha256_hex(source.digest.sha256_hex);
    blob.mutable_digest()->set_size_bytes(source.digest.size_bytes);
    source.path.empty() ? blob.set_content(source.bytes) : blob.set_path(source.path);
  }
  for (const std::string& note : job.diagnostics) reply->add_notes(note);
}

// job keeps the files that the reply names.
absl::Status Prepare(const v1::PrepareRequest& request, absl::StatusOr<PreparedJob>* job,
                     v1::PrepareReply* reply) {
  const absl::StatusOr<std::string> folder = FolderOf(request);
  if (!folder.ok()) return folder.status();
  absl::StatusOr<SceneChoice> choice = FindScene(*folder, request.scene());
  if (!choice.ok()) return choice.status();
  if (choice->path.empty()) {
    reply->mutable_scenes()->Assign(choice->scenes.begin(), choice->scenes.end());
    return absl::OkStatus();
  }
  JobArguments arguments = ArgumentsOf(request, choice->path);
  if (absl::Status status = CheckJobArguments(arguments); !status.ok()) return status;
  arguments.keep_camera_paths = true;  // The coordinator's machine renders nothing.
  *job = PrepareJob(arguments);
  if (!job->ok()) return job->status();
  AddJob(arguments, **job, reply);
  return absl::OkStatus();
}

absl::Status ConfineAndPrepare(const v1::PrepareRequest& request, absl::StatusOr<PreparedJob>* job,
                               v1::PrepareReply* reply) {
  worker::Protections missing;
  if (absl::Status status = ConfineTo(request, &missing); !status.ok()) {
    reply->set_missing_protection(missing.bits());
    return status;
  }
  try {
    return Prepare(request, job, reply);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(absl::StrCat("reading the scene needs more than ",
                                                     FormatMemory(request.memory_bytes_max()),
                                                     " of memory; use sheaf submit instead"));
  }
}

}  // namespace

int RunDroppedScene() {
  PrepareProcess();
  const absl::StatusOr<std::string> bytes = ReadAll(STDIN_FILENO, kRequestBytesMax);
  v1::PrepareRequest request;
  if (!bytes.ok() || !request.ParseFromString(*bytes)) return 1;
  v1::PrepareReply reply;
  absl::StatusOr<PreparedJob> job = absl::UnknownError("");
  const absl::Status status = ConfineAndPrepare(request, &job, &reply);
  reply.set_code(static_cast<int>(status.code()));
  reply.set_message(std::string(status.message()));
  const bool sent = WriteAllTo(STDOUT_FILENO, reply.SerializeAsString());
  ::_exit(sent ? 0 : 1);  // The files of the job stay for the coordinator, which removes them.
}

}  // namespace sheaf::cli
