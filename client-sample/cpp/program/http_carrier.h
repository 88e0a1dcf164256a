// The native protocol's messages as HTTP/1.1 requests of one kept connection: a hello is
// GET /v1/world, a chunk a GET each, one after the other. There are no views over HTTP, and answers
// say nothing of where a chunk came from.
#pragma once

#include "client-sample/cpp/program/carrier.h"

#include <deque>
#include <map>
#include <string>
#include <string_view>

namespace terrane {

inline constexpr std::size_t kHttpHeadBytesMax = std::size_t{16} << 10U;
inline constexpr std::size_t kHttpAsksMax = 4096;  ///< that wait for the connection

class HttpCarrier final : public Carrier {
  public:
    explicit HttpCarrier(const CarrierAddress& address);

    Bytes opening() override { return {}; }

    /// Hello, world query and chunk requests; others need no answer and are left out.
    Bytes wrap(const AnyMessage& message) override;
    Result<void> feed(std::span<const std::byte> bytes) override;
    Result<std::optional<IncomingMessage>> next() override;

    /// The next request, once the last has been answered.
    Bytes take_reply() override;

  private:
    enum class What : std::uint8_t { world, world_file, chunk };

    struct Ask {
        What what = What::world;
        std::uint32_t request_id = 0;
        ChunkPos key;
        ChunkFormat format = ChunkFormat::draco;
    };

    struct Response {
        int status = 0;
        std::map<std::string, std::string, std::less<>> headers;  ///< names in small letters
        std::span<const std::byte> body;
    };

    void ask(const Ask& ask);
    std::string path_of(const Ask& ask) const;
    Result<bool> read(Response& response);
    Result<AnyMessage> message_of(const Ask& ask, const Response& response);
    Result<AnyMessage> hello_of(const Response& response);
    WireComposition composition_of(std::string_view status) const;

    std::string host_;
    std::string token_;
    std::string content_path_;  ///< "/v1/w/W"
    ServerHello hello_;
    std::deque<Ask> asks_;
    std::optional<Ask> asked_;  ///< sent, and not answered
    Bytes buffer_;
    std::size_t taken_bytes_ = 0;  ///< of the buffer: the answer that was given out last
};

}  // namespace terrane
