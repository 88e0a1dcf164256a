#include "tests/bench/view/view_server.h"

#include "generator/world/world_file.h"
#include "server/chunks/store_identity.h"
#include "server/net/byte_protocol.h"

#include <cstdio>
#include <cstdlib>
#include <utility>

namespace terrane::bench {

namespace {

/// The native protocol on a connection, as native_protocol.cpp has it, with a look at the session
/// after each step.
class WatchedProtocol final : public ByteProtocol {
  public:
    WatchedProtocol(std::shared_ptr<Session> session, ViewServer& server)
        : session_(std::move(session)), server_(server) {}

    void receive(std::span<const std::byte> bytes, Clock::time_point now) override {
        session_->receive(bytes, now);
        look();
        if (watch_) {
            watch_->last_input = Clock::now().time_since_epoch().count();
        }
    }

    void input_ended() override { ended_ = true; }

    std::size_t gather(Outbox::Gather& out) override {
        look();
        return session_->outbox().gather(out);
    }

    void written(std::size_t size_bytes, Clock::time_point now) override {
        session_->written(size_bytes, now);
        look();
    }

    void tick(Clock::time_point now) override { session_->tick(now); }

    std::optional<Clock::time_point> wake_at() const override { return session_->wake_at(); }

    void drain() override { session_->drain(); }

    void end() override { session_->end(); }

    bool wants_input() const override { return session_->wants_input(); }

    bool is_closing() const override { return session_->is_closing(); }

    bool is_dead() const override { return ended_ || session_->is_dead(); }

    std::string client_name() const override { return session_->client_name(); }

    std::string close_reason() const override { return session_->close_reason(); }

  private:
    void look() {
        if (!watch_) {
            if (session_->client_name().empty()) {
                return;
            }
            watch_ = server_.watch(session_->client_name());
        }
        const auto raise_to = [](std::atomic<std::size_t>& most, std::size_t value) {
            most = std::max(most.load(), value);
        };
        raise_to(watch_->outbox_bytes_max, session_->outbox().bytes());
        raise_to(watch_->uncredited_bytes_max, session_->uncredited_bytes());
    }

    std::shared_ptr<Session> session_;
    ViewServer& server_;
    std::shared_ptr<SessionWatch> watch_;
    bool ended_ = false;
};

ServerHello hello_of(const World& world) {
    const Grid& grid = world.definition.grid;
    ServerHello hello;
    hello.protocol_version = kProtocolVersion;
    hello.server_version = "view_bench";
    hello.world_name = world.definition.name;
    hello.chunk_side = grid.side;
    hello.chunk_height = grid.height;
    hello.voxel_size_m = grid.voxel_size_m;
    hello.levels = levels_supported();
    hello.height_bound_voxels = world.stack.height_bound;
    return hello;
}

}  // namespace

ViewServer::ViewServer(std::shared_ptr<const World> world, std::size_t workers,
                       std::size_t io_threads)
    : world_(std::move(world)),
      store_(store_identity_of(*world_)),
      stacks_(std::size_t{64} << 20U) {
    service_.emplace(ServiceOptions{.workers = workers,
                                    .cache_bytes_max = std::size_t{1} << 30U,
                                    .side_columns = world_->definition.grid.side},
                     counters_, [this] {
                         auto builder =
                             std::make_shared<ChunkBuilder>(BuildContext{.world = world_.get(),
                                                                         .store = &store_,
                                                                         .stacks = &stacks_,
                                                                         .counters = &counters_,
                                                                         .on_notice = {}});
                         return [this, builder = std::move(builder)](const Task& task) {
                             Build build{.key = std::get<ChunkKey>(task.key).position,
                                         .begun = Clock::now(),
                                         .ended = {},
                                         .is_answer = false};
                             auto answer = builder->build(task);
                             build.ended = Clock::now();
                             build.is_answer = answer.has_value();
                             log_.add(build);
                             return answer;
                         };
                     });
    context_.service = &*service_;
    context_.hello = hello_of(*world_);
    ListenPort port{
        .name = "tcp", .endpoint = {.address = "127.0.0.1", .port = 0}, .make = {}, .refusal = {}};
    port.make = [this](const ConnectionOrigin&, ConnectionPost post,
                       ByteProtocol::Clock::time_point now) {
        return std::make_shared<WatchedProtocol>(
            std::make_shared<Session>(context_, std::move(post), now), *this);
    };
    ListenOptions options;
    options.io_threads = io_threads;
    auto listener = Listener::open(options, {std::move(port)});
    if (!listener) {
        std::fprintf(stderr, "%s\n", listener.error().message.c_str());
        std::exit(1);
    }
    listener_ = *std::move(listener);
    if (const auto started = listener_->start(); !started) {
        std::fprintf(stderr, "%s\n", started.error().message.c_str());
        std::exit(1);
    }
}

ViewServer::~ViewServer() {
    listener_->drain(std::chrono::milliseconds{0});
    service_->stop();
    listener_.reset();
}

std::shared_ptr<SessionWatch> ViewServer::watch(const std::string& client_name) {
    const MutexLock lock(mutex_);
    auto& watch = watches_[client_name];
    if (!watch) {
        watch = std::make_shared<SessionWatch>();
    }
    return watch;
}

}  // namespace terrane::bench
