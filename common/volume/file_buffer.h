// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FileBuffer: the bytes of an open file for a std::istream, read by position, so that neither its
// path nor its own position matters.
#pragma once

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <ios>
#include <streambuf>
#include <vector>

namespace sheaf::volume {

class FileBuffer : public std::streambuf {
 public:
  explicit FileBuffer(int file) : file_(file), buffer_(kBufferBytes) {
    struct stat state {};
    if (::fstat(file, &state) == 0) size_ = state.st_size;
  }

 protected:
  int_type underflow() override {
    const std::streamsize got = ReadAt(end_, buffer_.data(), kBufferBytes);
    if (got <= 0) return traits_type::eof();
    end_ += got;
    setg(buffer_.data(), buffer_.data(), buffer_.data() + got);
    return traits_type::to_int_type(*gptr());
  }
  std::streamsize xsgetn(char* out, std::streamsize count) override {
    std::streamsize done = 0;
    while (done < count) {
      if (gptr() == egptr() && count - done >= kBufferBytes) {
        const std::streamsize got = ReadAt(end_, out + done, count - done);
        if (got <= 0) break;
        end_ += got;
        done += got;
        continue;
      }
      if (gptr() == egptr() && traits_type::eq_int_type(underflow(), traits_type::eof())) break;
      const std::streamsize part = std::min<std::streamsize>(count - done, egptr() - gptr());
      std::copy_n(gptr(), part, out + done);
      setg(eback(), gptr() + part, egptr());
      done += part;
    }
    return done;
  }
  pos_type seekoff(off_type offset, std::ios_base::seekdir from, std::ios_base::openmode) override {
    const off_type at = end_ - (egptr() - gptr());
    const off_type base = from == std::ios_base::beg ? 0 : from == std::ios_base::cur ? at : size_;
    off_type to = 0;
    if (__builtin_add_overflow(base, offset, &to) || to < 0 || to > size_) {
      return pos_type(off_type(-1));
    }
    if (to >= end_ - (egptr() - eback()) && to <= end_) {
      setg(eback(), egptr() - (end_ - to), egptr());
    } else {
      end_ = to;
      setg(buffer_.data(), buffer_.data(), buffer_.data());
    }
    return to;
  }
  pos_type seekpos(pos_type to, std::ios_base::openmode mode) override {
    return seekoff(to, std::ios_base::beg, mode);
  }

 private:
  static constexpr std::streamsize kBufferBytes = 1 << 16;

  std::streamsize ReadAt(off_type at, char* out, std::streamsize count) const {
    constexpr std::streamsize kReadBytesMax = 1 << 30;
    const auto size = static_cast<size_t>(std::min(count, kReadBytesMax));
    while (true) {
      const ssize_t got = ::pread(file_, out, size, at);
      if (got >= 0 || errno != EINTR) return got;
    }
  }

  const int file_;
  off_type size_ = 0;
  off_type end_ = 0;  // The position in the file after the buffered bytes.
  std::vector<char> buffer_;
};

}  // namespace sheaf::volume
