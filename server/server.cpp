#include "server/server.h"

#include "generator/mesh/draco_codec.h"
#include "generator/terrain/world.h"
#include "generator/world/generator_version.h"
#include "generator/world/world_definition.h"
#include "generator/world/world_file.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"
#include "protocol/wire/limits.h"
#include "protocol/wire/messages.h"
#include "server/chunks/build_chunk.h"
#include "server/chunks/chunk_key.h"
#include "server/chunks/chunk_service.h"
#include "server/chunks/counters.h"
#include "server/chunks/in_flight.h"
#include "server/chunks/store_identity.h"
#include "server/http/content_routes.h"
#include "server/http/core_routes.h"
#include "server/http/http_message.h"
#include "server/http/openapi.h"
#include "server/http/problem.h"
#include "server/http/tiles3d.h"
#include "server/http/viewer_files.h"
#include "server/log.h"
#include "server/metrics.h"
#include "server/net/endpoint.h"
#include "server/net/http_session.h"
#include "server/net/listen_options.h"
#include "server/net/listener.h"
#include "server/net/native_protocol.h"
#include "server/net/outbox.h"
#include "server/net/session_caps.h"
#include "server/net/tls.h"
#include "server/net/tokens.h"
#include "server/net/websocket_protocol.h"
#include "server/notice_limit.h"
#include "storage/chunk_store.h"
#include "storage/memory_store.h"
#include "storage/rocksdb_store.h"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

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

ServerHello hello_of(const World& world, std::int32_t tileset_levels) {
    const WorldDefinition& definition = world.definition;
    ServerHello hello{.protocol_version = kProtocolVersion,
                      .server_version = kServerVersion,
                      .generator_version = kGeneratorVersion,
                      .encoding_version = kEncodingVersion,
                      .world_name = definition.name,
                      .fingerprint = world.fingerprint,
                      .content_id = served_content_id(content_id_of(world), tileset_levels),
                      .chunk_side = definition.grid.side,
                      .chunk_height = definition.grid.height,
                      .voxel_size_m = definition.grid.voxel_size_m,
                      .levels = levels_supported(),
                      .height_bound_voxels = world.stack.height_bound,
                      .materials = {},
                      .limits = {},  // every session tells its own
                      .mesh_parts = definition.has_landscape()};
    static_assert(
        static_cast<int>(WireMaterialKind::cave) == static_cast<int>(MaterialKind::cave) &&
        static_cast<int>(WireMaterialKind::water) == static_cast<int>(MaterialKind::water));
    for (const Material& material : definition.materials) {
        const Rgb8 color = material.color;
        hello.materials.push_back({.name = material.name,
                                   .color_rgb = (std::uint32_t{color.r} << 16U) |
                                                (std::uint32_t{color.g} << 8U) | color.b,
                                   .texture = material.texture,
                                   .solid = is_solid(material.kind),
                                   .kind = static_cast<WireMaterialKind>(material.kind)});
    }
    return hello;
}

/// Everybody's entrance: both ports' TLS, and the tokens.
struct Doors {
    std::unique_ptr<TlsServer> tls;
    std::unique_ptr<TokenGate> gate;

    /// What the bearer of a token may do.
    Result<SessionCaps> admit(std::string_view token, SessionCaps caps) const {
        const auto changed = gate->admit(token, std::chrono::system_clock::now());
        if (!changed) {
            return tl::unexpected(changed.error());
        }
        caps.view_radius_max = changed->view_radius_max.value_or(caps.view_radius_max);
        caps.bytes_per_second_max =
            changed->bytes_per_second_max.value_or(caps.bytes_per_second_max);
        caps.requests_per_second_max =
            changed->requests_per_second_max.value_or(caps.requests_per_second_max);
        caps.credit_window_bytes = changed->credit_window_bytes.value_or(caps.credit_window_bytes);
        return caps;
    }
};

Result<Doors> open_doors(const ServerOptions& options) {
    Doors doors;
    if (options.tls) {
        auto tls = TlsServer::open(*options.tls);
        if (!tls) {
            return tl::unexpected(tls.error());
        }
        doors.tls = *std::move(tls);
    }
    std::vector<TokenEntry> tokens;
    if (!options.token_file.empty()) {
        auto read = read_tokens(options.token_file);
        if (!read) {
            return tl::unexpected(read.error());
        }
        tokens = *std::move(read);
    }
    doors.gate = std::make_unique<TokenGate>(
        TokenGate::Options{.anonymous = options.anonymous.value_or(options.token_file.empty()),
                           .world = options.world->fingerprint},
        std::move(tokens));
    return doors;
}

constexpr std::array<std::pair<const char*, Counter OutcomeCounters::*>, 6> kOutcomes = {
    {{"cache", &OutcomeCounters::cache},
     {"store", &OutcomeCounters::store},
     {"generated", &OutcomeCounters::generated},
     {"busy", &OutcomeCounters::busy},
     {"cancelled", &OutcomeCounters::cancelled},
     {"failed", &OutcomeCounters::failed}}};

constexpr const char* kNoRoom = "too many sessions are open";

std::vector<MetricSample> request_samples(const ServiceCounters& counters,
                                          const HttpCounters& http) {
    std::vector<MetricSample> out;
    for (std::size_t i = 0; i < kRequestKinds.size(); ++i) {
        for (const auto& [outcome, member] : kOutcomes) {
            out.push_back(
                {.name = "terrane_requests_total",
                 .help = "Requests, by what was asked and outcome",
                 .kind = MetricSample::Kind::counter,
                 .value = static_cast<double>(count_of(counters.outcomes[i].*member)),
                 .labels = "kind=" + std::string(kRequestKinds[i]) + ",outcome=" + outcome});
        }
    }
    out.push_back({.name = "terrane_requests_total",
                   .help = "Requests, by what was asked and outcome",
                   .kind = MetricSample::Kind::counter,
                   .value = static_cast<double>(count_of(counters.limited) + http.limited.load()),
                   .labels = "kind=any,outcome=limited"});
    return out;
}

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
    Impl(const ServerOptions& options, const Log& server_log, std::unique_ptr<ChunkStore> opened,
         Doors opened_doors)
        : log(server_log),
          doors(std::move(opened_doors)),
          token_file(options.token_file),
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
                      return [this, builder = std::move(builder)](const Task& task) {
                          const auto queued = std::chrono::steady_clock::now() - task.asked;
                          auto answer = builder->build(task);
                          metrics.observe(
                              answer,
                              std::chrono::duration_cast<std::chrono::microseconds>(queued));
                          return answer;
                      };
                  }),
          sessions{.service = &service,
                   .hello = hello_of(*world, options.tileset_levels),
                   .world_file = options.publish_world ? canonical_world_file(world->definition)
                                                       : std::string(),
                   .timeouts = options.timeouts,
                   .caps = options.caps,
                   .admit =
                       [this](const ClientHello& hello) {
                           return doors.admit(hello.token, sessions.caps);
                       },
                   .requests_log = options.log_requests ? &log : nullptr,
                   .next_request_id = &next_request_id},
          routes{.service = &service,
                 .world = world.get(),
                 .hello = &sessions.hello,
                 .world_file = sessions.world_file,
                 .tileset_levels = options.tileset_levels,
                 .is_ready = [this] { return !draining.load(); },
                 .metrics = [this] { return metrics.text(samples()); }},
          router(sessions.hello.content_id,
                 [this](const HttpRequest& request) -> Result<void> {
                     const auto caps =
                         doors.admit(token_of(request.authorization, request.query), sessions.caps);
                     if (!caps) {
                         return tl::unexpected(caps.error());
                     }
                     return {};
                 }),
          http{.router = &router,
               .counters = &http_counters,
               .next_request_id = &next_request_id,
               .new_flow = [this] { return service.new_flow_id(); },
               .timeouts = options.http_timeouts,
               .websocket = websocket_upgrade(sessions),
               .requests_log = options.log_requests ? &log : nullptr,
               .rates_of =
                   [this](std::string_view token) {
                       // Who is not let in gets refusals, at the rate of everybody.
                       const SessionCaps caps =
                           clamped(doors.admit(token, sessions.caps).value_or(sessions.caps));
                       return HttpRates{.requests_per_second_max = caps.requests_per_second_max,
                                        .bytes_per_second_max = caps.bytes_per_second_max};
                   }} {
        add_chunk_routes(router, routes);
        add_world_routes(router, routes);
        add_state_routes(router, routes);
        add_tiles3d_routes(router, routes);
        add_picture_routes(router, routes);
        add_texture_routes(router, routes);
        add_openapi_route(router, options.tileset_levels);
        add_viewer_routes(router, options.viewer_files);
    }

    std::vector<ListenPort> ports(const ServerOptions& options) {
        std::vector<ListenPort> out;
        out.push_back({.name = "tcp",
                       .endpoint = options.listen.endpoint,
                       .make = native_protocol(sessions),
                       .refusal = native_refusal(),
                       .tls = doors.tls.get()});
        if (options.http) {
            out.push_back({.name = "http",
                           .endpoint = *options.http,
                           .make = http_protocol(http),
                           .refusal = http_refusal(),
                           .tls = doors.tls.get()});
        }
        return out;
    }

    std::vector<MetricSample> samples();

    const Log& log;
    const Doors doors;
    const std::filesystem::path token_file;
    const std::shared_ptr<const World> world;
    const std::unique_ptr<ChunkStore> store;
    NoticeLimit store_notices{std::chrono::minutes{1}};
    ServiceCounters counters;
    Metrics metrics;
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

std::vector<MetricSample> Server::Impl::samples() {
    using Kind = MetricSample::Kind;
    std::vector<MetricSample> out = request_samples(counters, http_counters);
    const auto add = [&out](Kind kind, const char* name, const char* help, auto value,
                            std::string labels = {}) {
        out.push_back({.name = name,
                       .help = help,
                       .kind = kind,
                       .value = static_cast<double>(value),
                       .labels = std::move(labels)});
    };
    const auto counter = [&add](const char* name, const char* help, const auto& value,
                                const char* label = "") {
        add(Kind::counter, name, help, value.load(std::memory_order_relaxed), label);
    };
    const auto gauge = [&add](const char* name, const char* help, auto value) {
        add(Kind::gauge, name, help, value);
    };
    counter("terrane_generations_total", "Chunk stacks made", counters.generations);
    counter("terrane_undelivered_total", "Answers that could not be handed on for want of memory",
            counters.undelivered);
    counter("terrane_joins_total", "Requests that joined one in flight", counters.joins);
    counter("terrane_stack_hits_total", "Stacks found in memory", counters.stack_hits);
    gauge("terrane_queue_jobs", "Stacks that wait for a worker", service.queued_jobs());
    gauge("terrane_in_flight_keys", "Keys that wait or are being made", service.in_flight());
    gauge("terrane_oldest_in_flight_seconds", "How long the oldest such key has been wanted",
          std::chrono::duration<double>(service.oldest_in_flight()).count());
    counter("terrane_credit_stalls_total", "Times a view began to wait for its client's credit",
            counters.credit_stalls);
    gauge("terrane_cache_bytes", "Encoded chunks in memory", service.cache_bytes());
    gauge("terrane_stack_cache_bytes", "Stacks in memory", stacks.size_bytes());
    const StoreStats stats = store->stats();
    counter("terrane_store_hits_total", "Records found in the store", counters.store_hits);
    add(Kind::counter, "terrane_store_gets_total", "Records asked of the store", stats.gets);
    add(Kind::counter, "terrane_store_puts_total", "Records written to the store", stats.puts);
    add(Kind::counter, "terrane_store_corrupt_total", "Records that could not be read back",
        stats.corrupt + count_of(counters.store_corrupt));
    add(Kind::counter, "terrane_store_failures_total", "Reads or writes that the disk refused",
        stats.failures);
    gauge("terrane_store_disk_bytes", "The store's tables", stats.disk_bytes);
    gauge("terrane_store_memtable_bytes", "Written, and not yet in a table; all of a memory store",
          stats.memtable_bytes);
    gauge("terrane_store_block_cache_bytes", "Blocks of tables in memory", stats.block_cache_bytes);
    gauge("terrane_store_pending_compaction_bytes", "What merging tables has yet to read",
          stats.pending_compaction_bytes);
    gauge("terrane_store_stalled_writes", "1 while the store slows or stops writes to catch up",
          stats.stalled_writes);
    if (listener) {
        const TrafficCounters& traffic = listener->traffic();
        gauge("terrane_sessions", "Connections that are open", listener->sessions());
        counter("terrane_connections_total", "Connections taken", traffic.accepted);
        counter("terrane_connections_refused_total", "Connections refused at a limit",
                traffic.refused);
        counter("terrane_tls_failures_total", "TLS handshakes that failed", traffic.tls_failed);
        counter("terrane_received_bytes_total", "Bytes from clients", traffic.bytes_in);
        counter("terrane_sent_bytes_total", "Bytes to clients", traffic.bytes_out);
    }
    const char* const classes = "HTTP answers, by the class of their status";
    constexpr std::array<const char*, 4> kLabels = {"status=2xx", "status=3xx", "status=4xx",
                                                    "status=5xx"};
    for (std::size_t i = 0; i < kLabels.size(); ++i) {
        counter("terrane_http_answers_total", classes, http_counters.by_class[i + 2], kLabels[i]);
    }
    counter("terrane_http_not_modified_total", "HTTP answers 304", http_counters.not_modified);
    return out;
}

Result<std::unique_ptr<Server>> Server::start(const ServerOptions& options, const Log& log) {
    auto doors = open_doors(options);
    if (!doors) {
        return tl::unexpected(doors.error());
    }
    auto store = open_store(options, log);
    if (!store) {
        return tl::unexpected(store.error());
    }
    std::unique_ptr<Impl> impl;
    try {
        impl = std::make_unique<Impl>(options, log, *std::move(store), *std::move(doors));
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
    if (const auto started = impl->listener->start(); !started) {
        impl->service.stop();
        impl->listener->close();
        return tl::unexpected(started.error());
    }
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

void Server::reload() {
    const Doors& doors = impl_->doors;
    if (doors.tls) {
        if (const auto reloaded = doors.tls->reload(); reloaded) {
            impl_->log.info("certificate and key were read again");
        } else {
            impl_->log.error("the old certificate stays in force: " + reloaded.error().message);
        }
    }
    if (!impl_->token_file.empty()) {
        if (auto tokens = read_tokens(impl_->token_file); tokens) {
            impl_->log.info("tokens were read again", {{"tokens", std::uint64_t{tokens->size()}}});
            doors.gate->replace(*std::move(tokens));
        } else {
            impl_->log.error("the old tokens stay in force: " + tokens.error().message);
        }
    }
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
    impl_->listener->close();  // before it is gone: its threads look at it, for the metrics
    impl_->listener.reset();
    if (const auto flushed = impl_->store->flush(); !flushed) {
        impl_->log.error("the store could not be flushed: " + flushed.error().message);
    }
}

}  // namespace terrane
