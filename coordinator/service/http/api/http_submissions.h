// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HttpSubmissions: scenes that users drop on the page.
//
//   GET  /api/v1/submissions              what is taken: {"why_not": "", "bytes_max": 4294967296,
//        "files_max": 20000, "piece_bytes_max": 2097152}; with why_not, nothing
//   POST /api/v1/submissions              begins one: {"name": "submissions/3", "state":
//   "receiving",
//        "file_count": 0, "received_bytes": 0, "scenes": [], "messages": "", "job": null}
//   POST /api/v1/submissions/ID/files?name=NAME&offset=N
//        adds the body to a file: {"size_bytes": 2097152}
//   POST /api/v1/submissions/ID:read?scene=NAME&title=TEXT&samples=N&target_error=E
//        reads and submits the scene; all parameters are optional
//   GET  /api/v1/submissions/ID           its state
//   POST /api/v1/submissions/ID:discard   forgets it and its files: {}
#pragma once

#include <vector>

#include "coordinator/service/http/server/http_message.h"
#include "coordinator/service/http/server/http_router.h"
#include "coordinator/service/view/submission_desk.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class HttpSubmissions {
 public:
  // desk: null: nothing is taken. It must outlive the object.
  explicit HttpSubmissions(SubmissionDesk* desk) : desk_(desk) {}

  // The routes above. They refer to this object.
  std::vector<HttpRoute> Routes() const;

 private:
  HttpResponse Offer() const;
  HttpResponse Begin(const HttpRequest& request) const;
  HttpResponse Append(const HttpRequest& request) const;
  HttpResponse Read(const HttpRequest& request) const;
  HttpResponse Find(const HttpRequest& request) const;
  HttpResponse Discard(const HttpRequest& request) const;

  SubmissionDesk* const desk_;
};

}  // namespace sheaf::coordinator
