// terrane-client load: many viewers at once, to learn what a server bears before players do.
#pragma once

#include "client-sample/cpp/connection.h"
#include "client-sample/cpp/program/carrier.h"
#include "client-sample/cpp/program/load_client.h"
#include "client-sample/cpp/program/load_report.h"
#include "client-sample/cpp/program/movement.h"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace terrane {

inline constexpr std::size_t kLoadClientsMax = 16'384;  ///< as many as a server takes

struct LoadOptions {
    std::string host = "127.0.0.1";
    std::uint16_t port = 7777;
    TlsUse tls;
    CarrierKind carrier = CarrierKind::tcp;
    std::size_t clients = 50;
    double seconds = 10;
    double ramp_seconds = 2;  ///< clients come one after the other over so long
    /// Kinds that clients take in turn.
    std::vector<MovementKind> movements = {MovementKind::walk};
    std::shared_ptr<const std::vector<PathPoint>> path;
    double at_x = 0;
    double at_z = 0;
    double spread_voxels = 512;
    std::uint64_t seed = 1;
    std::uint64_t check_every = 50;  ///< chunks; 0: none
    LoadClientOptions client;
    bool json = false;
};

/// Runs the load and gives what it found; `progress` gets a line a second. Fails with `io_error` if
/// the server's name can't be resolved, or the certificates to trust can't be read.
Result<LoadResult> run_load(const LoadOptions& options,
                            const std::function<void(const std::string&)>& progress);

/// Adds `load`. Its callback stores the exit code in `exit_code`; both outlive the parse.
void add_load_command(CLI::App& app, int& exit_code);

}  // namespace terrane
