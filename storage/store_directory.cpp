#include "storage/store_directory.h"

#include "protocol/base/bytes.h"
#include "protocol/base/hash.h"
#include "protocol/base/result.h"
#include "storage/record.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

namespace terrane {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMarkerBegin = "Terrane store, format ";
constexpr std::string_view kChecksumBegin = ", checksum ";
constexpr std::size_t kMarkerBytesMax = 256;
constexpr std::string_view kMarkerDraft = "TERRANE_STORE.new";

std::string marker_text(std::uint32_t format) {
    const std::string begin = std::string(kMarkerBegin) + std::to_string(format);
    return begin + std::string(kChecksumBegin) + to_hex(hash128(bytes_of(begin))) + "\n";
}

/// The format a marker names, or nothing if the marker is damaged.
std::optional<std::uint32_t> format_of_marker(std::string_view text) {
    if (!text.starts_with(kMarkerBegin)) {
        return std::nullopt;
    }
    const std::string_view number = text.substr(kMarkerBegin.size());
    std::uint32_t format = 0;
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), format);
    if (error != std::errc() || format == 0) {
        return std::nullopt;
    }
    // Later formats may add lines; the first one stays as it is, or they could not be told apart.
    return text.starts_with(marker_text(format)) ? std::optional(format) : std::nullopt;
}

tl::unexpected<Error> disk_failure(const fs::path& path, std::string_view what,
                                   const std::error_code& error) {
    return fail(ErrorCode::io_error,
                path.string() + ": " + std::string(what) + ": " + error.message());
}

Result<void> write_marker(const StoreDirectory& directory) {
    const fs::path draft = directory.root / kMarkerDraft;
    {
        std::ofstream out(draft, std::ios::binary | std::ios::trunc);
        out << marker_text(kStoreFormat);
        out.flush();
        if (!out) {
            return fail(ErrorCode::io_error, directory.root.string() +
                                                 ": cannot be written; check its permissions and "
                                                 "the space left, or use another --data directory");
        }
    }
    std::error_code error;
    fs::rename(draft, directory.marker(), error);
    if (error) {
        return disk_failure(directory.marker(), "cannot be written", error);
    }
    return {};
}

Result<std::string> read_marker(const StoreDirectory& directory) {
    std::ifstream in(directory.marker(), std::ios::binary);
    std::string text(kMarkerBytesMax, '\0');
    in.read(text.data(), static_cast<std::streamsize>(text.size()));
    if (!in && !in.eof()) {
        return fail(ErrorCode::io_error, directory.marker().string() + ": cannot be read");
    }
    text.resize(static_cast<std::size_t>(in.gcount()));
    return text;
}

/// True if the directory holds nothing but what a new file system or a cut short start left there.
Result<bool> is_empty_but_for_leftovers(const fs::path& root) {
    std::error_code error;
    fs::directory_iterator entries(root, error);
    for (; !error && entries != fs::directory_iterator(); entries.increment(error)) {
        const std::string name = entries->path().filename().string();
        if (name != "lost+found" && name != kMarkerDraft) {
            return false;
        }
    }
    if (error) {
        return disk_failure(root, "cannot be listed; use another --data directory", error);
    }
    return true;
}

}  // namespace

Result<StoreDirectory> prepare_store_directory(const fs::path& root) {
    std::error_code error;
    const fs::file_status status = fs::status(root, error);
    if (status.type() == fs::file_type::none) {
        return disk_failure(root, "cannot be looked at", error);
    }
    if (!fs::exists(status)) {
        fs::create_directories(root, error);
        if (error) {
            return disk_failure(root, "cannot be made; use another --data directory", error);
        }
    } else if (!fs::is_directory(status)) {
        return fail(ErrorCode::io_error,
                    root.string() + ": is not a directory; use another --data directory");
    }
    StoreDirectory directory{.root = root};
    if (!fs::exists(directory.marker(), error)) {
        const auto empty = is_empty_but_for_leftovers(root);
        if (!empty) {
            return tl::unexpected(empty.error());
        }
        if (!*empty) {
            return fail(
                ErrorCode::invalid_argument,
                root.string() +
                    ": is not empty and not a Terrane store; nothing in it was changed; use "
                    "another --data directory");
        }
        const auto written = write_marker(directory);
        return written ? Result<StoreDirectory>(directory) : tl::unexpected(written.error());
    }
    const auto text = read_marker(directory);
    if (!text) {
        return tl::unexpected(text.error());
    }
    const auto format = format_of_marker(*text);
    if (!format) {
        // The name says that it is ours; the database knows the rest.
        const auto written = write_marker(directory);
        return written ? Result<StoreDirectory>(directory) : tl::unexpected(written.error());
    }
    if (*format > kStoreFormat) {
        return fail(ErrorCode::version_mismatch,
                    root.string() + ": store format " + std::to_string(*format) +
                        " is newer than this build's " + std::to_string(kStoreFormat) +
                        "; use a newer terrane, another --data directory, or remove this one");
    }
    return directory;
}

Result<DirectoryLock> DirectoryLock::take(const StoreDirectory& directory) {
    const int descriptor = ::open(directory.root.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0) {
        return disk_failure(directory.root, "cannot be opened; use another --data directory",
                            {errno, std::generic_category()});
    }
    DirectoryLock lock(descriptor);
    if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
        return fail(ErrorCode::io_error,
                    directory.root.string() +
                        ": is in use by another terrane; stop that one or use another --data "
                        "directory");
    }
    return lock;
}

DirectoryLock::~DirectoryLock() {
    if (descriptor_ >= 0) {
        ::close(descriptor_);
    }
}

DirectoryLock::DirectoryLock(DirectoryLock&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)) {}

Result<bool> is_database_absent(const StoreDirectory& directory) {
    std::error_code error;
    const fs::path database = directory.database();
    if (!fs::exists(database, error) && !error) {
        return true;
    }
    const bool empty = !error && fs::is_empty(database, error);
    if (error) {
        return disk_failure(database, "cannot be listed; use another --data directory", error);
    }
    return empty;
}

Result<void> set_database_aside(const StoreDirectory& directory) {
    std::error_code error;
    fs::remove_all(directory.damaged_database(), error);
    if (!error) {
        fs::rename(directory.database(), directory.damaged_database(), error);
    }
    if (error) {
        return disk_failure(directory.database(),
                            "is damaged and cannot be set aside; use another --data directory",
                            error);
    }
    return {};
}

}  // namespace terrane
