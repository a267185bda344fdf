// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/manifest_codec.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "sheaf/v1/content.pb.h"

namespace sheaf {

std::string EncodeManifest(const Manifest& manifest) {
  SHEAF_CHECK(CheckManifest(manifest).ok());
  v1::SceneManifest message;
  message.set_main_file(manifest.main_file);
  for (const ManifestFile& file : manifest.files) {
    v1::SceneFile* out = message.add_files();
    out->set_name(file.name);
    out->mutable_digest()->set_sha256_hex(file.digest.sha256_hex);
    out->mutable_digest()->set_size_bytes(file.digest.size_bytes);
    out->set_on_demand(file.is_on_demand);
  }
  message.mutable_world_to_camera()->Assign(manifest.world_to_camera.begin(),
                                            manifest.world_to_camera.end());
  message.mutable_world_to_ndc()->Assign(manifest.world_to_ndc.begin(),
                                         manifest.world_to_ndc.end());
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    SHEAF_CHECK(message.SerializeToCodedStream(&coded));
  }
  return bytes;
}

absl::StatusOr<Manifest> DecodeManifest(const std::string& bytes) {
  if (bytes.size() > kManifestBytesMax) {
    return absl::InvalidArgumentError(
        absl::StrCat("scene manifest: ", bytes.size(), " bytes, the limit is ", kManifestBytesMax));
  }
  v1::SceneManifest message;
  if (!message.ParseFromString(bytes)) {
    return absl::InvalidArgumentError("scene manifest: the blob is not a manifest");
  }
  Manifest manifest;
  manifest.main_file = message.main_file();
  manifest.files.reserve(static_cast<size_t>(message.files_size()));
  for (const v1::SceneFile& file : message.files()) {
    manifest.files.push_back(
        {file.name(), {file.digest().sha256_hex(), file.digest().size_bytes()}, file.on_demand()});
  }
  manifest.world_to_camera.assign(message.world_to_camera().begin(),
                                  message.world_to_camera().end());
  manifest.world_to_ndc.assign(message.world_to_ndc().begin(), message.world_to_ndc().end());
  if (absl::Status status = CheckManifest(manifest); !status.ok()) return status;
  return manifest;
}

}  // namespace sheaf
