#include "protocol/base/write_file.h"

#include "protocol/base/result.h"

#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <system_error>

namespace terrane {
namespace {

tl::unexpected<Error> refused(const std::filesystem::path& path, const char* what, int error) {
    return fail(ErrorCode::io_error, path.string() + " " + what + ": " + std::strerror(error));
}

/// 0 or the errno of what went wrong.
int write_all(const std::filesystem::path& path, const char* mode,
              std::span<const std::byte> bytes) {
    std::FILE* file = std::fopen(path.c_str(), mode);
    if (file == nullptr) {
        return errno;
    }
    errno = 0;
    // An empty span may have no address, and fwrite wants one.
    const bool written =
        bytes.empty() || std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
    const int write_error = errno;
    const bool closed = std::fclose(file) == 0;
    if (!written) {
        return write_error != 0 ? write_error : EIO;
    }
    return closed ? 0 : errno;
}

}  // namespace

Result<void> write_file(const std::filesystem::path& path, std::span<const std::byte> bytes) {
    std::error_code ignored;
    const auto status = std::filesystem::status(path, ignored);
    if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
        const int error = write_all(path, "wb", bytes);
        return error == 0 ? Result<void>() : refused(path, "cannot be written", error);
    }
    std::filesystem::path aside = path;
    aside += ".part-" + std::to_string(::getpid());
    if (const int error = write_all(aside, "wb", bytes); error != 0) {
        std::filesystem::remove(aside, ignored);
        return refused(path, "cannot be written", error);
    }
    std::error_code moved;
    std::filesystem::rename(aside, path, moved);
    if (moved) {
        std::filesystem::remove(aside, ignored);
        return refused(path, "cannot be put in place", moved.value());
    }
    return {};
}

}  // namespace terrane
