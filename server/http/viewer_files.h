// The viewer and whatever else lies beside it: a folder of static files, read whole at the start.
#pragma once

#include "protocol/base/result.h"
#include "server/http/router.h"

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace terrane {

inline constexpr std::size_t kViewerFilesMax = 1024;
inline constexpr std::size_t kViewerBytesMax = std::size_t{64} << 20U;

struct ViewerFile {
    std::string path;  ///< "/assets/viewer.js"
    std::string_view content_type;
    SharedBytes body;
};

/// By the name's ending; "application/octet-stream" for one that nobody knows.
std::string_view content_type_of(std::string_view path);

/// Every file under the folder; hidden ones and what is no plain file are left out. Fails with
/// `io_error`, or `too_large` beyond the two limits.
Result<std::vector<ViewerFile>> read_viewer_files(const std::filesystem::path& folder);

/// Each under its path, and "index.html" as its folder too. Without files "/" gets a small page
/// that links to the API. Nobody needs a token for them: the viewer is where one is typed in.
void add_viewer_routes(Router& router, std::vector<ViewerFile> files);

}  // namespace terrane
