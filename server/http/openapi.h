// The HTTP interface described for programs: an OpenAPI 3.1 document, one entry for each route of
// the router's table. A test holds the two against each other.
#pragma once

#include "server/http/router.h"

#include <cstdint>
#include <string>
#include <vector>

namespace terrane {

/// The document for the routes that `router` has now, this one's own included. Routes that it
/// doesn't know, such as a viewer's files, are left out. Levels of 3D Tiles are 0..tileset_levels
/// - 1.
std::string openapi_json(const Router& router, std::int32_t tileset_levels);

/// Every path that openapi_json can describe, as Router::paths writes them.
std::vector<std::string> described_paths();

/// /v1/openapi.json. Call it after the routes that it is to describe.
void add_openapi_route(Router& router, std::int32_t tileset_levels);

}  // namespace terrane
