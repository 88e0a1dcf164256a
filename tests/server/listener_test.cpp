#include "server/net/listener.h"

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace terrane {
namespace {

using boost::asio::ip::tcp;

/// Reads, and says nothing.
class Mute : public ByteProtocol {
  public:
    void receive(std::span<const std::byte>, Clock::time_point) override {}

    void input_ended() override { is_over_ = true; }

    std::size_t gather(Outbox::Gather&) override { return 0; }

    void written(std::size_t, Clock::time_point) override {}

    void tick(Clock::time_point) override {}

    void drain() override { is_over_ = true; }

    void end() override {}

    bool wants_input() const override { return !is_over_; }

    bool is_closing() const override { return is_over_; }

    bool is_dead() const override { return false; }

    std::string client_name() const override { return {}; }

    std::string close_reason() const override { return {}; }

  private:
    bool is_over_ = false;
};

struct Opened {
    std::atomic<int> made = 0;
    std::unique_ptr<Listener> listener;

    explicit Opened(std::uint16_t port = 0) {
        ListenPort at{.name = "tcp",
                      .endpoint = {.address = "127.0.0.1", .port = port},
                      .make = [this](const ConnectionOrigin&, ConnectionPost,
                                     ByteProtocol::Clock::time_point) {
                          ++made;
                          return std::make_shared<Mute>();
                      }};
        std::vector<ListenPort> ports;
        ports.push_back(std::move(at));
        auto opened = Listener::open({.endpoint = {}, .on_event = {}}, std::move(ports));
        if (opened) {
            listener = *std::move(opened);
        }
    }

    bool makes_one_within(std::chrono::milliseconds time) const {
        const auto deadline = std::chrono::steady_clock::now() + time;
        while (made == 0 && std::chrono::steady_clock::now() < deadline) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        return made > 0;
    }
};

class Client {
  public:
    explicit Client(const Endpoint& endpoint) : socket_(context_) {
        socket_.connect({boost::asio::ip::make_address(endpoint.address), endpoint.port});
    }

  private:
    boost::asio::io_context context_;
    tcp::socket socket_;
};

TEST(Listener, LetsNobodyInBeforeItStarts) {
    Opened opened;
    ASSERT_NE(opened.listener, nullptr);
    const Client client(opened.listener->endpoint(0));  // waits in the system's queue
    EXPECT_FALSE(opened.makes_one_within(std::chrono::milliseconds(100)));
    EXPECT_EQ(opened.listener->sessions(), 0U);
    ASSERT_TRUE(opened.listener->start());
    EXPECT_TRUE(opened.makes_one_within(std::chrono::seconds(10)));
}

TEST(Listener, ClosesOnceAndForAll) {
    Opened opened;
    ASSERT_NE(opened.listener, nullptr);
    ASSERT_TRUE(opened.listener->start());
    const Client client(opened.listener->endpoint(0));
    ASSERT_TRUE(opened.makes_one_within(std::chrono::seconds(10)));
    opened.listener->close();
    EXPECT_EQ(opened.listener->sessions(), 0U);
    EXPECT_EQ(opened.listener->traffic().accepted, 1U);  // still there to be asked
    opened.listener->close();
}

TEST(Listener, ClosesWithoutHavingStarted) {
    Opened opened;
    ASSERT_NE(opened.listener, nullptr);
    const std::uint16_t port = opened.listener->endpoint(0).port;
    opened.listener->close();
    const Opened again(port);
    EXPECT_NE(again.listener, nullptr) << "the port is still taken";
}

}  // namespace
}  // namespace terrane
