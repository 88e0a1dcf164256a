#include "server/server.h"

#include "generator/mesh/draco_codec.h"
#include "generator/world/world_file.h"
#include "protocol/wire/limits.h"
#include "server/chunks/build_chunk.h"
#include "server/chunks/store_identity.h"
#include "server/http/core_routes.h"
#include "server/http/problem.h"
#include "server/net/native_protocol.h"
#include "server/notice_limit.h"
#include "storage/memory_store.h"
#include "storage/rocksdb_store.h"

#include <sys/resource.h>

#include <algorithm>
#include <exception>
#include <string>
#include <utility>

namespace terrane {

namespace {

constexpr const char* kServerVersion = "0.1.0";
/// A worker's generator, mesher and encoder; the largest allowed stack (64 x 64 columns of a few
/// hundred limits) takes about a third of it.
constexpr std::size_t kWorkerScratchBytes = std::size_t{32} << 20U;
/// The one answer that an outbox may hold beyond its bound: a chunk, or the world file. Of a
/// chunk's payload, bytes a column: eight times what the demo world's fullest chunk takes.
constexpr std::size_t kPayloadBytesPerColumn = 64;
/// An entry of the in-flight table with its key, and a waiter with its callback; measured by sizeof
/// and the nodes around them.
constexpr std::size_t kKeyInFlightBytes = 400;
constexpr std::size_t kWaiterBytes = 200;

Result<std::unique_ptr<ChunkStore>> open_store(const ServerOptions& options, const Log& log) {
    const StoreIdentity identity = store_identity_of(*options.world);
    if (options.store == StoreKind::memory) {
        return std::make_unique<MemoryStore>(identity);
    }
    RocksdbOptions rocksdb;
    rocksdb.on_notice = [&log](std::string_view notice) { log.warning(notice); };
    return open_rocksdb_store(options.data_directory, identity, rocksdb);
}

ServerHello hello_of(const World& world) {
    const WorldDefinition& definition = world.definition;
    ServerHello hello{.protocol_version = kProtocolVersion,
                      .server_version = kServerVersion,
                      .generator_version = kGeneratorVersion,
                      .encoding_version = kEncodingVersion,
                      .world_name = definition.name,
                      .fingerprint = world.fingerprint,
                      .content_id = content_id_of(world),
                      .chunk_side = definition.grid.side,
                      .chunk_height = definition.grid.height,
                      .voxel_size_m = definition.grid.voxel_size_m,
                      .levels = levels_supported(),
                      .height_bound_voxels = world.stack.height_bound,
                      .materials = {},
                      .limits = {}};  // every session tells its own
    for (const Material& material : definition.materials) {
        const Rgb8 color = material.color;
        hello.materials.push_back(
            {.name = material.name,
             .color_rgb =
                 (std::uint32_t{color.r} << 16U) | (std::uint32_t{color.g} << 8U) | color.b,
             .texture = material.texture,
             .solid = material.kind != MaterialKind::void_ && material.kind != MaterialKind::cave});
    }
    return hello;
}

constexpr const char* kNoRoom = "too many sessions are open";

/// What a port says to a client for whom there is no room.
Bytes native_refusal() {
    return encode_message(Failure{.request_id = 0,
                                  .error = {.code = ErrorCode::busy, .message = kNoRoom},
                                  .retry_after_ms = 1000,
                                  .key = std::nullopt});
}

Bytes http_refusal() {
    const HttpResponse response = http_problem(Error{.code = ErrorCode::busy, .message = kNoRoom});
    Bytes out = http_head(response, 0, false, http_date(std::chrono::system_clock::now()));
    out.insert(out.end(), response.body->begin(), response.body->end());
    return out;
}

std::size_t answer_bytes_of(const World& world) {
    const auto side = static_cast<std::size_t>(world.definition.grid.side);
    return std::max(side * side * kPayloadBytesPerColumn,
                    canonical_world_file(world.definition).size());
}

}  // namespace

MemoryBound memory_bound_of(const ServerOptions& options) {
    const std::size_t answer_bytes = options.world ? answer_bytes_of(*options.world) : 0;
    const std::size_t session_bytes =
        kOutboxBytesMax + answer_bytes + session_bytes_max(clamped(options.caps));
    const ServiceOptions service;
    const RocksdbOptions rocksdb;
    return {.caches = options.cache_bytes_max + options.stack_cache_bytes_max,
            .store = options.store == StoreKind::memory
                         ? kMemoryStoreBytesMax
                         : rocksdb.block_cache_bytes + rocksdb.write_buffer_bytes,
            .workers = options.workers * kWorkerScratchBytes,
            .sessions = options.listen.sessions_max * session_bytes,
            .queue = service.keys_in_flight_max * kKeyInFlightBytes +
                     service.waiters_max * kWaiterBytes};
}

std::size_t raise_descriptor_limit() {
    rlimit limit{};
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0) {
        return 0;
    }
    if (limit.rlim_cur < limit.rlim_max) {
        rlimit raised = limit;
        raised.rlim_cur = limit.rlim_max;
        if (setrlimit(RLIMIT_NOFILE, &raised) == 0) {
            limit = raised;
        }
    }
    return limit.rlim_cur;
}

/// In order of construction; `stop` ends them in reverse.
struct Server::Impl {
    Impl(const ServerOptions& options, const Log& server_log, std::unique_ptr<ChunkStore> opened)
        : log(server_log),
          world(options.world),
          store(std::move(opened)),
          stacks(options.stack_cache_bytes_max),
          service({.workers = options.workers,
                   .cache_bytes_max = options.cache_bytes_max,
                   .side_columns = options.world->definition.grid.side},
                  counters,
                  [this] {
                      auto builder = std::make_shared<ChunkBuilder>(BuildContext{
                          .world = world.get(),
                          .store = store.get(),
                          .stacks = &stacks,
                          .counters = &counters,
                          .on_notice = [this](std::string_view notice) { log.warning(notice); },
                          .on_store_failure =
                              [this](std::string_view failure) {
                                  if (store_notices.allows()) {
                                      log.warning(failure);
                                  }
                              }});
                      return [builder = std::move(builder)](const Task& task) {
                          return builder->build(task);
                      };
                  }),
          sessions{.service = &service,
                   .hello = hello_of(*world),
                   .world_file = canonical_world_file(world->definition),
                   .timeouts = options.timeouts,
                   .caps = options.caps},
          routes{.service = &service,
                 .world = world.get(),
                 .hello = &sessions.hello,
                 .world_file = sessions.world_file,
                 .is_ready = [this] { return !draining.load(); },
                 .metrics = [] { return std::string(); }},
          router(sessions.hello.content_id),
          http{.router = &router,
               .counters = &http_counters,
               .next_request_id = &next_request_id,
               .timeouts = options.http_timeouts,
               .websocket = {},
               .requests_log = &log} {
        add_chunk_routes(router, routes);
        add_world_routes(router, routes);
        add_state_routes(router, routes);
        add_viewer_routes(router, options.viewer_files);
    }

    std::vector<ListenPort> ports(const ServerOptions& options) {
        std::vector<ListenPort> out;
        out.push_back({.name = "tcp",
                       .endpoint = options.listen.endpoint,
                       .make = native_protocol(sessions),
                       .refusal = native_refusal()});
        if (options.http) {
            out.push_back({.name = "http",
                           .endpoint = *options.http,
                           .make = http_protocol(http),
                           .refusal = http_refusal()});
        }
        return out;
    }

    const Log& log;
    const std::shared_ptr<const World> world;
    const std::unique_ptr<ChunkStore> store;
    NoticeLimit store_notices{std::chrono::minutes{1}};
    ServiceCounters counters;
    StackCache stacks;
    ChunkService service;
    SessionContext sessions;
    std::atomic<bool> draining = false;
    RouteContext routes;
    Router router;
    HttpCounters http_counters;
    std::atomic<std::uint64_t> next_request_id = 1;
    HttpContext http;
    bool has_http = false;
    std::unique_ptr<Listener> listener;
};

Result<std::unique_ptr<Server>> Server::start(const ServerOptions& options, const Log& log) {
    auto store = open_store(options, log);
    if (!store) {
        return tl::unexpected(store.error());
    }
    std::unique_ptr<Impl> impl;
    try {
        impl = std::make_unique<Impl>(options, log, *std::move(store));
    } catch (const std::exception& error) {
        return fail(ErrorCode::internal, std::to_string(options.workers) +
                                             " workers cannot be started: " + error.what() +
                                             "; use fewer --workers or allow more memory");
    }
    ListenOptions listen = options.listen;
    if (!listen.on_event) {
        listen.on_event = [&log](std::string_view event) { log.debug(event); };
    }
    if (!listen.on_fault) {
        listen.on_fault = [&log, limit = std::make_shared<NoticeLimit>(std::chrono::seconds{1})](
                              std::string_view fault) {
            if (limit->allows()) {
                log.warning(fault);
            }
        };
    }
    impl->has_http = options.http.has_value();
    auto listener = Listener::open(listen, impl->ports(options));
    if (!listener) {
        return tl::unexpected(listener.error());
    }
    impl->listener = *std::move(listener);
    return std::unique_ptr<Server>(new Server(std::move(impl)));
}

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Server::~Server() {
    stop(std::chrono::milliseconds{0});
}

Endpoint Server::endpoint() const {
    return impl_->listener->endpoint(0);
}

std::optional<Endpoint> Server::http_endpoint() const {
    return impl_->has_http ? std::optional(impl_->listener->endpoint(1)) : std::nullopt;
}

const ServiceCounters& Server::counters() const {
    return impl_->counters;
}

std::size_t Server::sessions() const {
    return impl_->listener ? impl_->listener->sessions() : 0;
}

void Server::stop(std::chrono::milliseconds drain_time) {
    if (!impl_->listener) {
        return;
    }
    impl_->draining.store(true);
    if (!impl_->listener->drain(drain_time)) {
        impl_->log.warning("sessions that did not end in time are closed",
                           {{"sessions", std::uint64_t{impl_->listener->sessions()}}});
    }
    // Workers first: their last answers are posted to the listener's loops.
    impl_->service.stop();
    impl_->listener.reset();
    if (const auto flushed = impl_->store->flush(); !flushed) {
        impl_->log.error("the store could not be flushed: " + flushed.error().message);
    }
}

}  // namespace terrane
