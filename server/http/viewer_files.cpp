#include "server/http/viewer_files.h"

#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "server/http/http_message.h"
#include "server/http/router.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <iterator>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace terrane {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kIndexName = "index.html";

constexpr std::string_view kIndexPage = R"(<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>Terrane</title>
<style>body { font: 16px/1.5 system-ui, sans-serif; max-width: 40em; margin: 3em auto; padding: 0 1em }</style>
<h1>Terrane</h1>
<p>This server makes volumetric terrain on request. It was started without a viewer
(<code>--viewer FOLDER</code>); its API is here:</p>
<ul>
<li><a href="/v1/world">/v1/world</a> &ndash; the world that is served, and links to its chunks</li>
<li><a href="/v1/chunks/0/0/0/0.drc">/v1/chunks/0/0/0/0.drc</a> &ndash; a chunk as a Draco mesh</li>
<li><a href="/v1/columns/0/0.json">/v1/columns/0/0.json</a> &ndash; one column of it</li>
<li><a href="/metrics">/metrics</a> &ndash; what the server is doing, for Prometheus</li>
</ul>
</html>
)";

void add_file(Router& router, std::string path, const ViewerFile& file) {
    router.add({.path = std::move(path),
                .caching = HttpCaching::revalidate,
                .needs_token = false,
                .handler = fixed_answer(file.content_type, file.body)});
}

/// A route's pattern must not be read out of a file's name.
bool is_servable(std::string_view path) {
    return path.find_first_of("{}") == std::string_view::npos &&
           path.find("/.") == std::string_view::npos;
}

Result<SharedBytes> read_file(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    Bytes bytes;
    std::transform(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>(),
                   std::back_inserter(bytes), [](char c) { return static_cast<std::byte>(c); });
    if (!in.good() && !in.eof()) {
        return fail(ErrorCode::io_error, path.string() + ": cannot be read");
    }
    return std::make_shared<const Bytes>(std::move(bytes));
}

}  // namespace

std::string_view content_type_of(std::string_view path) {
    static constexpr std::array<std::pair<std::string_view, std::string_view>, 17> kTypes = {{
        {".html", "text/html; charset=utf-8"},
        {".js", "text/javascript; charset=utf-8"},
        {".mjs", "text/javascript; charset=utf-8"},
        {".css", "text/css; charset=utf-8"},
        {".json", "application/json"},
        {".map", "application/json"},
        {".wasm", "application/wasm"},
        {".svg", "image/svg+xml"},
        {".png", "image/png"},
        {".jpg", "image/jpeg"},
        {".webp", "image/webp"},
        {".ico", "image/x-icon"},
        {".woff2", "font/woff2"},
        {".glb", "model/gltf-binary"},
        {".txt", "text/plain; charset=utf-8"},
        {".md", "text/markdown; charset=utf-8"},
        {".webmanifest", "application/manifest+json"},
    }};
    const auto* const found = std::ranges::find_if(
        kTypes, [path](const auto& type) { return path.ends_with(type.first); });
    return found == kTypes.end() ? "application/octet-stream" : found->second;
}

Result<std::vector<ViewerFile>> read_viewer_files(const fs::path& folder) {
    std::vector<ViewerFile> files;
    std::size_t bytes = 0;
    std::error_code error;
    for (auto at = fs::recursive_directory_iterator(folder, error);
         !error && at != fs::recursive_directory_iterator(); at.increment(error)) {
        const std::string path = "/" + fs::relative(at->path(), folder, error).generic_string();
        if (error || !at->is_regular_file(error) || !is_servable(path)) {
            continue;
        }
        bytes += at->file_size(error);
        if (!error && (files.size() >= kViewerFilesMax || bytes > kViewerBytesMax)) {
            return fail(ErrorCode::too_large, folder.string() + ": a viewer has at most " +
                                                  std::to_string(kViewerFilesMax) + " files and " +
                                                  std::to_string(kViewerBytesMax >> 20U) + " MiB");
        }
        auto body = read_file(at->path());
        if (!body) {
            return tl::unexpected(body.error());
        }
        files.push_back(
            {.path = path, .content_type = content_type_of(path), .body = *std::move(body)});
    }
    if (error) {
        return fail(ErrorCode::io_error, folder.string() + ": " + error.message());
    }
    std::ranges::sort(files, {}, &ViewerFile::path);
    return files;
}

void add_viewer_routes(Router& router, std::vector<ViewerFile> files) {
    if (files.empty()) {
        files.push_back({.path = "/" + std::string(kIndexName),
                         .content_type = content_type_of(kIndexName),
                         .body = http_body(kIndexPage)});
    }
    for (const ViewerFile& file : files) {
        add_file(router, file.path, file);
        if (file.path.ends_with("/" + std::string(kIndexName))) {
            add_file(router, file.path.substr(0, file.path.size() - kIndexName.size()), file);
        }
    }
}

}  // namespace terrane
