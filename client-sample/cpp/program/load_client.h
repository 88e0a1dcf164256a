// One viewer of `terrane-client load`, without a socket: bytes in, bytes out, the time given.
//
//     greeting ──ServerHello──> viewing ──stop_moving──> viewing, at rest ──leave──> gone
//
// It knows what its view wants (view_set.h), so it can tell how long each chunk took from the
// moment it was wanted until it was decoded, what is still missing, and what came too late to be of
// use. With `by_view` the server is told the view and decides the order; without, the client asks
// for chunks by key, nearest first, as HTTP clients and simple games do.
#pragma once

#include "client-sample/cpp/program/carrier.h"
#include "client-sample/cpp/program/latency_counts.h"
#include "client-sample/cpp/program/movement.h"
#include "client-sample/cpp/view_set.h"
#include "protocol/wire/messages.h"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

namespace terrane {

/// Keys of one client that are asked for and not answered, without views.
inline constexpr std::size_t kLoadKeysInFlightMax = 256;
/// How often a client looks where it is.
inline constexpr std::chrono::milliseconds kLoadStep{250};

struct LoadClientOptions {
    ChunkFormat format = ChunkFormat::draco;
    std::vector<std::uint32_t> radius_chunks = {3, 3, 3, 3};
    bool by_view = true;
    std::uint64_t decode_every = 1;  ///< chunks; the others count as soon as they have come
    bool asks_world = false;         ///< for the world file, at the greeting
    std::string token;
    std::chrono::milliseconds patience{10'000};  ///< silent for so long while it wants: hung
};

/// What one client has seen.
struct LoadCounts {
    std::uint64_t chunks = 0;
    std::uint64_t bytes = 0;  ///< payloads
    std::uint64_t wasted_chunks = 0;
    std::uint64_t wasted_bytes = 0;  ///< of chunks that had left the view when they came
    std::uint64_t busy = 0;
    std::uint64_t refused = 0;  ///< other failures, of single chunks
    std::uint64_t undecodable = 0;
    std::uint64_t triangles = 0;
    std::uint64_t forgotten = 0;
    LatencyCounts latency;
    std::optional<std::chrono::microseconds> fill;  ///< first view asked for, to all of it there
    std::uint64_t fill_chunks = 0;                  ///< of these, that came until then
    std::chrono::microseconds wanting{};            ///< how long something was missing
    std::string first_fault;
};

/// One thread.
class LoadClient {
  public:
    using Clock = std::chrono::steady_clock;

    struct Handlers {
        /// Every chunk that decoded.
        std::function<void(const ChunkAnswer&, std::span<const std::byte>)> chunk;
        std::function<void(const WorldAnswer&, const ServerHello&)> world;
    };

    LoadClient(const LoadClientOptions& options, const MovementStart& movement,
               std::unique_ptr<Carrier> carrier, const Handlers& handlers);

    /// The connection is there: says hello.
    void open(Clock::time_point now);
    /// Fails when the server ends the session or breaks the protocol; the client is over then.
    Result<void> receive(std::span<const std::byte> bytes, Clock::time_point now);
    /// Moves, looks, asks again; about every kLoadStep.
    void tick(Clock::time_point now);

    /// From now on it stands still.
    void stop_moving() { is_moving_ = false; }

    /// Says goodbye.
    void leave();

    Bytes take_output() { return std::exchange(output_, {}); }

    bool is_greeted() const { return hello_.has_value(); }

    const std::optional<ServerHello>& hello() const { return hello_; }

    /// Chunks that are wanted and have not come.
    std::size_t missing() const { return missing_; }

    /// It wants something and has heard nothing for `patience`.
    bool is_hung(Clock::time_point now) const;

    const LoadCounts& counts() const { return counts_; }

  private:
    /// A square of the view.
    struct Want {
        Clock::time_point since;
        std::vector<bool> has_come;  ///< by y
    };

    struct SquareHash {
        std::size_t operator()(const StackPos& square) const {
            std::uint64_t hash = static_cast<std::uint32_t>(square.x);
            hash = (hash << 32U | static_cast<std::uint32_t>(square.z)) * 0x9e3779b97f4a7c15U;
            hash ^= static_cast<std::uint64_t>(square.lod) << 40U;
            return static_cast<std::size_t>(hash ^ hash >> 29U);
        }
    };

    void send(const AnyMessage& message);
    void look(const ServerHello& world, Clock::time_point now);
    void change_wants(const ServerHello& world, const ViewSet& next, Clock::time_point now);
    void ask(const WireLimits& limits, Clock::time_point now);
    void account_wanting(Clock::time_point now);
    void settle(ChunkPos key);
    Result<void> take(IncomingMessage& carried, Clock::time_point now);
    void take_chunk(const ServerHello& world, const ChunkAnswer& answer,
                    std::span<const std::byte> payload, Clock::time_point now);
    Result<void> take_failure(const Failure& failure, Clock::time_point now);
    void take_forget(const ChunkForget& forget, Clock::time_point now);
    void miss(std::size_t count, Clock::time_point now);
    bool answered(std::uint32_t request_id, ChunkPos key);
    void note_fault(std::string fault);

    const LoadClientOptions options_;
    Movement movement_;
    std::unique_ptr<Carrier> carrier_;
    const Handlers& handlers_;
    Bytes output_;
    std::optional<ServerHello> hello_;
    bool is_moving_ = true;
    Clock::time_point begin_;        ///< of the movement: when it was greeted
    Clock::time_point last_sign_;    ///< anything from the server
    Clock::time_point wants_since_;  ///< when it last began to miss anything
    Clock::time_point last_account_;
    std::optional<Clock::time_point> view_due_;  ///< a view that was refused is told again then
    ViewerPlace place_;
    std::optional<ViewerPlace> told_place_;
    ViewSet view_;
    std::unordered_map<StackPos, Want, SquareHash> wants_;
    std::size_t missing_ = 0;
    std::uint64_t uncredited_bytes_ = 0;
    // Without views:
    std::deque<ChunkPos> to_ask_;
    std::multimap<Clock::time_point, ChunkPos> paused_;
    std::unordered_map<std::uint32_t, std::vector<ChunkPos>> in_flight_;
    std::size_t keys_in_flight_ = 0;
    std::uint32_t last_id_ = 0;
    LoadCounts counts_;
};

}  // namespace terrane
