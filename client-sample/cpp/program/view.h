// terrane-client view: what a server sends, as a picture, without a graphics card.
#pragma once

#include "client-sample/cpp/program/raster.h"
#include "client-sample/cpp/terrain.h"

namespace CLI {
class App;
}

namespace terrane {

struct DrawnView {
    Picture picture;
    std::size_t chunks = 0;
    std::size_t triangles = 0;
    std::uint64_t bytes = 0;
    double covered = 0;  ///< share of the picture that is terrain
};

/// Looks from the camera's eye, and draws what comes until the view is filled. The haze ends at the
/// options' last radius, whatever the camera says. Fails with what the session says, or `io_error`
/// if chunks are missing at the deadline.
Result<DrawnView> draw_view(const TerrainOptions& options, Camera camera, Deadline deadline);

/// Adds `view`. Its callback stores the exit code in `exit_code`; both outlive the parse.
void add_view_command(CLI::App& app, int& exit_code);

}  // namespace terrane
