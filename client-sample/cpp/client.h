// A Terrane client in one object: connect, ask for any number of chunks, take the answers as they
// come.
//
//     auto client = Client::connect({.host = "127.0.0.1", .port = 7777});
//     client->request(keys, ChunkFormat::draco);
//     while (client->unanswered() > 0) {
//         auto event = client->next(std::chrono::steady_clock::now() + 10s);   // error, nothing
//         yet, or an event if (auto* chunk = std::get_if<ReceivedChunk>(&**event)) { ...
//         chunk->answer.key, chunk->payload ... }
//     }
//
// Or say where the viewer is, as often as it moves, and let the server choose what comes and in
// which order; of what `next` gives, the chunks with request id 0 are the view's:
//
//     client->view({.x = 100, .y = 70, .z = -30, .radius_chunks = {16, 16, 16}});
//     ... ReceivedChunk: show it; ChunkForget: these have left the view
//
// Chunks of a view are sent as far ahead as the server's credit window goes. A chunk counts as
// consumed when `next` is called again, so do with it what must be done, decoding included, before
// that.
//
// The library keeps to the server's limits: keys are split over requests, no more are under way
// than the server takes, and a `busy` key is asked for again after the time that the server names,
// a bounded number of times. A client belongs to one thread at a time; nothing happens outside its
// calls.
#pragma once

#include "client-sample/cpp/connection.h"
#include "protocol/base/coords.h"
#include "protocol/base/result.h"
#include "protocol/wire/messages.h"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>

namespace terrane {

inline constexpr std::uint16_t kDefaultPort = 7777;
/// A busy key is given up after this many tries. The pause doubles from what the server names up to
/// kBusyPauseMaxMs: from 50 ms, all tries together take some 30 s.
inline constexpr int kBusyTriesMax = 12;
inline constexpr std::uint32_t kBusyPauseMaxMs = 5000;
inline constexpr std::size_t kUnansweredMax = std::size_t{1} << 20U;

struct ClientOptions {
    std::string host = "127.0.0.1";
    std::uint16_t port = kDefaultPort;
    std::chrono::milliseconds timeout{
        5000};  ///< for connecting with its greeting, and for each sending
    std::string client_name = "terrane-client";
    std::string token = {};
    TlsUse tls = {};
};

/// The payload is as received; chunk_reader.h makes a mesh or columns of it.
struct ReceivedChunk {
    ChunkAnswer answer;
    Bytes payload;
    std::chrono::microseconds waited{};  ///< from the first time it was sent for; 0: of the view
};

/// A Failure with request id 0 is about a chunk of the view if it has a key, else about the last
/// view.
using ClientEvent =
    std::variant<ReceivedChunk, Failure, ColumnAnswer, WorldAnswer, Pong, Goodbye, ChunkForget>;

class Client {
  public:
    /// Connects and greets. Fails with `io_error`, `version_mismatch`, `malformed`, or what the
    /// server says.
    static Result<Client> connect(const ClientOptions& options);

    Client(Client&&) noexcept;
    Client& operator=(Client&&) noexcept;
    ~Client();

    const ServerHello& hello() const;

    /// Asks for chunks, each answered by one ReceivedChunk or one Failure with its key. Gives the
    /// id that they carry and `cancel` takes. Fails with `busy` beyond kUnansweredMax.
    Result<std::uint32_t> request(std::span<const ChunkPos> keys, ChunkFormat format,
                                  std::int32_t priority = 0);

    /// Nothing of that request will be given out by `next` any more. An unknown or finished id does
    /// nothing.
    Result<void> cancel(std::uint32_t request_id);

    /// What is to be seen from now on, instead of what was; no radii: nothing. Fails with
    /// `invalid_argument` or `out_of_range` for what no server takes (messages.h), `unsupported` if
    /// this one gives no views. Radii above hello().limits.view_radius_max count as that.
    Result<void> view(const ViewUpdate& update);

    /// Answered by a ColumnAnswer or a Failure with the id that is given here.
    Result<std::uint32_t> query_column(ColumnPos column);

    /// Answered by a WorldAnswer or a Failure with the id that is given here.
    Result<std::uint32_t> query_world();

    /// Answered by a Pong with the same nonce.
    Result<void> ping(std::uint64_t nonce);

    /// Chunks and queries that have no answer yet, cancelled ones left out.
    std::size_t unanswered() const;

    /// Sends what is due, then the next event; nothing if none came by the deadline. After an error
    /// (the server closed, broke the protocol or ended the session) every call gives that error.
    Result<std::optional<ClientEvent>> next(Deadline deadline);

  private:
    class Session;

    explicit Client(std::unique_ptr<Session> session);

    std::unique_ptr<Session> session_;
};

}  // namespace terrane
