#include "client-sample/cpp/program/stream_loop.h"

#include "client-sample/cpp/connection.h"
#include "client-sample/cpp/tls_peer.h"
#include "protocol/base/bytes.h"
#include "protocol/base/result.h"

#include <boost/asio/buffer.hpp>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/write.hpp>
#include <openssl/ssl.h>

#include <array>
#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace terrane {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

namespace {

/// Little, so that all connections are read in turn even when decoding is slower than the server.
constexpr std::size_t kReceiveBytes = std::size_t{16} << 10U;

using TlsStream = asio::ssl::stream<tcp::socket&>;

/// A connection; kept alive by the operations that are under way.
struct Stream {
    explicit Stream(asio::io_context& context) : socket(context) {}

    tcp::socket socket;
    std::optional<TlsStream> tls;
    Bytes decrypted;  ///< where TLS reads to, which must stay while it waits
    bool is_open = false;
    bool is_ended = false;
    bool is_writing = false;
    std::deque<Bytes> queue;
    std::size_t queued_bytes = 0;
};

}  // namespace

struct StreamLoop::State {
    asio::io_context context{1};
    std::vector<tcp::endpoint> endpoints;
    std::string host;
    std::string peer;
    std::optional<asio::ssl::context> tls_context;
    Handlers handlers;
    std::vector<std::shared_ptr<Stream>> streams;
    /// One for all: bytes are handed on before the next read.
    std::array<std::byte, kReceiveBytes> received{};

    void end(StreamId id, const std::string& why) {
        Stream& stream = *streams[id];
        if (stream.is_ended) {
            return;
        }
        shut(stream);
        handlers.closed(id, Error{.code = ErrorCode::io_error, .message = peer + ": " + why});
    }

    static void shut(Stream& stream) {
        stream.is_ended = true;
        stream.is_open = false;
        error_code ignored;
        stream.socket.close(ignored);
    }

    void shake_hands(StreamId id, asio::ssl::context& with) {
        const auto& stream = streams[id];
        TlsStream& tls = stream->tls.emplace(stream->socket, with);
        if (const auto named = demand_host(tls.native_handle(), host); !named) {
            end(id, named.error().message);
            return;
        }
        stream->decrypted.resize(kReceiveBytes);
        tls.async_handshake(asio::ssl::stream_base::client, [this, id, stream](error_code error) {
            if (error && !stream->is_ended) {
                end(id, "TLS: " + error.message());
            } else if (!stream->is_ended) {
                begin(id);
            }
        });
    }

    void begin(StreamId id) {
        const auto stream = streams[id];
        stream->is_open = true;
        handlers.opened(id);
        if (!stream->is_ended) {
            read(id);
            write(id);
        }
    }

    void take(StreamId id, error_code error, std::span<const std::byte> bytes) {
        const auto stream = streams[id];
        if (error) {
            const bool is_over =
                error == asio::error::eof || error == asio::ssl::error::stream_truncated;
            end(id, is_over ? "the server closed the connection" : error.message());
            return;
        }
        handlers.received(id, bytes);
        if (!stream->is_ended) {
            read(id);
        }
    }

    void read(StreamId id) {
        if (std::optional<TlsStream>& tls = streams[id]->tls) {
            read_tls(id, *tls);
            return;
        }
        // Waiting takes no buffer, so thousands of idle connections hold none. (Those by TLS do,
        // kReceiveBytes each: what waits may be inside the TLS engine.)
        streams[id]->socket.async_wait(
            tcp::socket::wait_read, [this, id, stream = streams[id]](error_code error) {
                if (stream->is_ended) {
                    return;
                }
                std::size_t size_bytes = 0;
                if (!error) {
                    size_bytes = stream->socket.read_some(asio::buffer(received), error);
                }
                if (error == asio::error::would_block || error == asio::error::try_again) {
                    read(id);
                    return;
                }
                take(id, error, std::span<const std::byte>(received).first(size_bytes));
            });
    }

    void read_tls(StreamId id, TlsStream& tls) {
        const auto& stream = streams[id];
        tls.async_read_some(asio::buffer(stream->decrypted), [this, id, stream](
                                                                 error_code error,
                                                                 std::size_t size_bytes) {
            if (!stream->is_ended) {
                take(id, error, std::span<const std::byte>(stream->decrypted).first(size_bytes));
            }
        });
    }

    void write(StreamId id) {
        const auto& stream = streams[id];
        if (stream->is_writing || !stream->is_open || stream->queue.empty()) {
            return;
        }
        stream->is_writing = true;
        const asio::const_buffer front = asio::buffer(stream->queue.front());
        const auto written = [this, id, stream](error_code error, std::size_t) {
            stream->is_writing = false;
            stream->queued_bytes -= stream->queue.front().size();
            stream->queue.pop_front();
            if (stream->is_ended) {
                return;
            }
            if (error) {
                end(id, error.message());
                return;
            }
            write(id);
        };
        if (std::optional<TlsStream>& tls = stream->tls) {
            asio::async_write(*tls, front, written);
        } else {
            asio::async_write(stream->socket, front, written);
        }
    }
};

StreamLoop::StreamLoop(std::unique_ptr<State> state) : state_(std::move(state)) {}

StreamLoop::StreamLoop(StreamLoop&&) noexcept = default;
StreamLoop& StreamLoop::operator=(StreamLoop&&) noexcept = default;
StreamLoop::~StreamLoop() = default;

Result<StreamLoop> StreamLoop::open(const Target& target, Handlers handlers, Deadline deadline) {
    auto state = std::make_unique<State>();
    state->host = target.host;
    state->peer = target.host + ":" + std::to_string(target.port);
    state->handlers = std::move(handlers);
    if (target.tls.enabled) {
        asio::ssl::context& context = state->tls_context.emplace(asio::ssl::context::tls_client);
        if (const auto trusted = demand_trust(context.native_handle(), target.tls.ca_file);
            !trusted) {
            return tl::unexpected(trusted.error());
        }
    }
    tcp::resolver resolver(state->context);
    error_code outcome;
    bool is_resolved = false;
    resolver.async_resolve(target.host, std::to_string(target.port),
                           [&](error_code error, const auto& results) {
                               outcome = error;
                               is_resolved = true;
                               for (const auto& result : results) {
                                   state->endpoints.push_back(result.endpoint());
                               }
                           });
    state->context.run_until(deadline);
    if (!is_resolved || outcome) {
        resolver.cancel();
        state->context.restart();
        state->context.run();
        return fail(ErrorCode::io_error,
                    state->peer + ": " + (outcome ? outcome.message() : "no address in time"));
    }
    return StreamLoop(std::move(state));
}

StreamLoop::StreamId StreamLoop::connect() {
    State& state = *state_;
    const StreamId id = state.streams.size();
    const auto& stream = state.streams.emplace_back(std::make_shared<Stream>(state.context));
    asio::async_connect(stream->socket, state.endpoints,
                        [&state, id, stream](error_code error, const tcp::endpoint&) {
                            if (stream->is_ended) {
                                return;
                            }
                            if (!error) {
                                stream->socket.set_option(tcp::no_delay(true), error);
                                stream->socket.non_blocking(true, error);
                            }
                            if (error) {
                                state.end(id, error.message());
                                return;
                            }
                            if (state.tls_context) {
                                state.shake_hands(id, *state.tls_context);
                            } else {
                                state.begin(id);
                            }
                        });
    return id;
}

void StreamLoop::send(StreamId id, Bytes bytes) {
    Stream& stream = *state_->streams[id];
    if (stream.is_ended || bytes.empty()) {
        return;
    }
    stream.queued_bytes += bytes.size();
    if (stream.queued_bytes > kSendQueueBytesMax) {
        state_->end(id, "the server does not take what is sent to it");
        return;
    }
    stream.queue.push_back(std::move(bytes));
    state_->write(id);
}

bool StreamLoop::has_unread(StreamId id) const {
    Stream& stream = *state_->streams[id];
    error_code error;
    const bool has_decrypted = stream.tls && SSL_has_pending(stream.tls->native_handle()) == 1;
    return stream.is_open && (has_decrypted || stream.socket.available(error) > 0) && !error;
}

void StreamLoop::close(StreamId id) {
    Stream& stream = *state_->streams[id];
    if (!stream.is_ended) {
        // A goodbye at the end of the queue goes out if nothing is before it.
        if (stream.is_open && !stream.is_writing) {
            error_code ignored;
            for (const Bytes& bytes : stream.queue) {
                if (stream.tls) {
                    stream.tls->write_some(asio::buffer(bytes), ignored);
                } else {
                    stream.socket.write_some(asio::buffer(bytes), ignored);
                }
            }
        }
        State::shut(stream);
    }
}

void StreamLoop::run_until(Deadline deadline) {
    if (state_->context.stopped()) {
        state_->context.restart();
    }
    state_->context.run_until(deadline);
}

}  // namespace terrane
