// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/objects/s3_xml.h"

#include <tinyxml2.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

using tinyxml2::XMLElement;

constexpr bool kCompact = true;  // Without spaces between elements.

std::string TextOf(const XMLElement* parent, const char* name) {
  const XMLElement* child = parent == nullptr ? nullptr : parent->FirstChildElement(name);
  const char* text = child == nullptr ? nullptr : child->GetText();
  return text == nullptr ? "" : text;
}

// Calls visit for each child of this name.
template <typename Visit>
void ForEach(const XMLElement* parent, const char* name, const Visit& visit) {
  for (const XMLElement* child = parent->FirstChildElement(name); child != nullptr;
       child = child->NextSiblingElement(name)) {
    visit(child);
  }
}

// The root element, of this name. Errors: kUnavailable.
absl::StatusOr<const XMLElement*> Parse(const std::string& xml, const char* root_name,
                                        tinyxml2::XMLDocument* document) {
  const bool parsed = document->Parse(xml.data(), xml.size()) == tinyxml2::XML_SUCCESS;
  const XMLElement* const root = parsed ? document->RootElement() : nullptr;
  if (root != nullptr && root->Name() == std::string_view(root_name)) return root;
  return absl::UnavailableError(absl::StrCat("the server's answer is no ", root_name,
                                             " of S3; is the endpoint an S3 server?"));
}

absl::StatusOr<StoredObject> ObjectOf(const XMLElement* contents) {
  StoredObject object;
  object.key = TextOf(contents, "Key");
  std::string error;
  const bool is_valid = !object.key.empty() &&
                        absl::SimpleAtoi(TextOf(contents, "Size"), &object.size_bytes) &&
                        absl::ParseTime(absl::RFC3339_full, TextOf(contents, "LastModified"),
                                        &object.written, &error);
  if (is_valid) return object;
  return absl::UnavailableError("the server's list has an entry without key, size or time");
}

}  // namespace

S3Error ParseS3Error(const std::string& xml) {
  tinyxml2::XMLDocument document;
  const absl::StatusOr<const XMLElement*> root = Parse(xml, "Error", &document);
  if (!root.ok()) return {};
  return {TextOf(*root, "Code"), TextOf(*root, "Message")};
}

absl::StatusOr<S3Page> ParseS3Page(const std::string& xml) {
  tinyxml2::XMLDocument document;
  const absl::StatusOr<const XMLElement*> root = Parse(xml, "ListBucketResult", &document);
  if (!root.ok()) return root.status();
  S3Page page;
  absl::Status status;
  ForEach(*root, "Contents", [&](const XMLElement* contents) {
    absl::StatusOr<StoredObject> object = ObjectOf(contents);
    status.Update(object.status());
    if (object.ok()) page.objects.push_back(*std::move(object));
  });
  if (!status.ok()) return status;
  ForEach(*root, "CommonPrefixes",
          [&](const XMLElement* common) { page.prefixes.push_back(TextOf(common, "Prefix")); });
  if (TextOf(*root, "IsTruncated") == "true") {
    page.next_token = TextOf(*root, "NextContinuationToken");
    if (page.next_token.empty()) {
      return absl::UnavailableError("the server's list is truncated without a continuation token");
    }
  }
  return page;
}

absl::StatusOr<std::string> ParseUploadId(const std::string& xml) {
  tinyxml2::XMLDocument document;
  const absl::StatusOr<const XMLElement*> root =
      Parse(xml, "InitiateMultipartUploadResult", &document);
  if (!root.ok()) return root.status();
  std::string id = TextOf(*root, "UploadId");
  if (id.empty()) return absl::UnavailableError("the server names no UploadId");
  return id;
}

absl::StatusOr<std::vector<std::string>> ParseFailedRemovals(const std::string& xml) {
  tinyxml2::XMLDocument document;
  const absl::StatusOr<const XMLElement*> root = Parse(xml, "DeleteResult", &document);
  if (!root.ok()) return root.status();
  std::vector<std::string> failed;
  ForEach(*root, "Error", [&failed](const XMLElement* error) {
    if (TextOf(error, "Code") == "NoSuchKey") return;
    failed.push_back(absl::StrCat(TextOf(error, "Key"), ": ", TextOf(error, "Code"), ": ",
                                  TextOf(error, "Message")));
  });
  return failed;
}

std::string FormatCompletedUpload(const std::vector<std::string>& etags) {
  tinyxml2::XMLPrinter printer(nullptr, kCompact);
  printer.OpenElement("CompleteMultipartUpload", kCompact);
  for (size_t i = 0; i < etags.size(); ++i) {
    printer.OpenElement("Part", kCompact);
    printer.OpenElement("PartNumber", kCompact);
    printer.PushText(static_cast<int64_t>(i + 1));
    printer.CloseElement(kCompact);
    printer.OpenElement("ETag", kCompact);
    printer.PushText(etags[i].c_str());
    printer.CloseElement(kCompact);
    printer.CloseElement(kCompact);
  }
  printer.CloseElement(kCompact);
  return printer.CStr();
}

std::string FormatRemovals(const std::vector<std::string>& keys) {
  tinyxml2::XMLPrinter printer(nullptr, kCompact);
  printer.OpenElement("Delete", kCompact);
  printer.OpenElement("Quiet", kCompact);
  printer.PushText("true");
  printer.CloseElement(kCompact);
  for (const std::string& key : keys) {
    printer.OpenElement("Object", kCompact);
    printer.OpenElement("Key", kCompact);
    printer.PushText(key.c_str());
    printer.CloseElement(kCompact);
    printer.CloseElement(kCompact);
  }
  printer.CloseElement(kCompact);
  return printer.CStr();
}

}  // namespace sheaf
