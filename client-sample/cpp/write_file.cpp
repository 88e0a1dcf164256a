#include "client-sample/cpp/write_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>
#include <system_error>

namespace terrane {

namespace {

tl::unexpected<Error> io_failure(const std::filesystem::path& path, int error_number) {
    return fail(ErrorCode::io_error,
                path.string() + ": cannot be written: " + std::strerror(error_number));
}

Result<void> write_bytes(const std::filesystem::path& path, std::span<const std::byte> bytes) {
    std::FILE* file = std::fopen(path.c_str(), "wb");
    if (file == nullptr) {
        return io_failure(path, errno);
    }
    const bool is_written = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
    const int write_errno = errno;
    if (std::fclose(file) != 0) {
        return io_failure(path, errno);
    }
    if (!is_written) {
        return io_failure(path, write_errno);
    }
    return {};
}

}  // namespace

Result<void> write_whole_file(const std::filesystem::path& path, std::span<const std::byte> bytes) {
    std::error_code ignored;
    if (std::filesystem::exists(path, ignored) &&
        !std::filesystem::is_regular_file(path, ignored)) {
        return write_bytes(path, bytes);
    }
    std::filesystem::path aside = path;
    aside += ".part-" + std::to_string(::getpid());
    auto written = write_bytes(aside, bytes);
    if (written && std::rename(aside.c_str(), path.c_str()) != 0) {
        written = io_failure(path, errno);
    }
    if (!written) {
        std::filesystem::remove(aside, ignored);
    }
    return written;
}

}  // namespace terrane
