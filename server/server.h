// A whole server: store, service, workers, routes, listener. What `terrane serve` runs, and tests
// on port 0.
#pragma once

#include "generator/terrain/world.h"
#include "protocol/base/result.h"
#include "server/chunks/counters.h"
#include "server/http/tiles3d.h"
#include "server/http/viewer_files.h"
#include "server/log.h"
#include "server/net/http_session.h"
#include "server/net/listen_options.h"
#include "server/net/session.h"
#include "server/net/tls.h"

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace terrane {

enum class StoreKind : std::uint8_t { rocksdb, memory };

/// Between the order to stop and the end of the last session.
inline constexpr std::chrono::milliseconds kDrainTime{10'000};

struct ServerOptions {
    std::shared_ptr<const World> world;
    ListenOptions listen;
    std::optional<Endpoint> http = {};  ///< none: no HTTP and no WebSocket
    SessionTimeouts timeouts;
    HttpTimeouts http_timeouts = {};
    std::vector<ViewerFile> viewer_files = {};
    SessionCaps caps = {};                         ///< of every session; clamped
    std::int32_t tileset_levels = kTilesetLevels;  ///< of 3D Tiles; a multiple of kSubtreeLevels
    bool publish_world = true;                     ///< clients may have the world file
    std::optional<TlsServer::Files> tls = {};      ///< of both ports
    std::filesystem::path token_file = {};         ///< empty: none
    std::optional<bool> anonymous = {};            ///< default: if there is no token file
    bool log_requests = false;                     ///< a debug line for each request
    std::size_t workers = 1;
    std::size_t cache_bytes_max = std::size_t{256} << 20U;
    std::size_t stack_cache_bytes_max = std::size_t{64} << 20U;
    StoreKind store = StoreKind::rocksdb;
    std::filesystem::path data_directory;  ///< of the rocksdb store
};

/// What the server may come to hold at most, bytes.
struct MemoryBound {
    std::size_t caches = 0;    ///< encoded chunks and stacks
    std::size_t store = 0;     ///< the memory store, or RocksDB's cache and write buffers
    std::size_t workers = 0;   ///< their scratch buffers
    std::size_t sessions = 0;  ///< every session with a full outbox and one answer more, a frame
                               ///< half read, all the wishes it may have and the largest view
    std::size_t queue = 0;     ///< work that waits, and who waits for it

    std::size_t sum() const { return caches + store + workers + sessions + queue; }
};

MemoryBound memory_bound_of(const ServerOptions& options);

/// Raises the limit of open descriptors as far as the system lets us, and gives it.
std::size_t raise_descriptor_limit();

/// Calls from the owner's thread, but `counters`: any.
class Server {
  public:
    /// Opens the store, starts the workers, listens. `log` outlives the server. Fails with what the
    /// store says, `io_error` if the address can't be bound, or `internal` if there are no threads.
    static Result<std::unique_ptr<Server>> start(const ServerOptions& options, const Log& log);
    /// Stops, if nobody has.
    ~Server();
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    /// Where it listens for the native protocol, and for HTTP if it does.
    Endpoint endpoint() const;
    std::optional<Endpoint> http_endpoint() const;
    const ServiceCounters& counters() const;
    /// Reads certificate, key and tokens again. What can't be used leaves the old in force; the log
    /// says so.
    void reload();
    std::size_t sessions() const;
    /// Accepts no more, says goodbye, answers what is under way for at most `drain_time`, then
    /// stops the workers and flushes the store.
    void stop(std::chrono::milliseconds drain_time = kDrainTime);

  private:
    struct Impl;
    explicit Server(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace terrane
