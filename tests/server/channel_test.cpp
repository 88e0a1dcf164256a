// A protocol and its successor behind a channel, without TLS; with it: tests/client/doors_test.cpp.
#include "server/net/channel.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>

namespace terrane {
namespace {

/// Says a text and then hands over.
class Speaker final : public ByteProtocol {
  public:
    Speaker(std::string_view text, std::shared_ptr<ByteProtocol> next) : next_(std::move(next)) {
        const auto bytes = bytes_of(text);
        outbox_.push(Bytes(bytes.begin(), bytes.end()), nullptr);
    }

    void receive(std::span<const std::byte> bytes, Clock::time_point) override {
        heard += text_of(bytes);
    }

    void input_ended() override {}

    std::size_t gather(Outbox::Gather& out) override { return outbox_.gather(out); }

    void written(std::size_t size_bytes, Clock::time_point) override {
        outbox_.consume(size_bytes);
    }

    void tick(Clock::time_point) override {}

    void drain() override {}

    void end() override {}

    bool wants_input() const override { return true; }

    bool is_closing() const override { return closing; }

    bool is_dead() const override { return false; }

    std::string client_name() const override { return {}; }

    std::string close_reason() const override { return {}; }

    std::shared_ptr<ByteProtocol> take_successor() override {
        return std::exchange(next_, nullptr);
    }

    std::string heard;
    bool closing = false;

  private:
    Outbox outbox_;
    std::shared_ptr<ByteProtocol> next_;
};

std::string said(Channel& channel) {
    const auto output = channel.output();
    EXPECT_TRUE(output);
    std::string text;
    for (const auto part : *output) {
        text += text_of(part);
    }
    return text;
}

TEST(Channel, HandsOverWhenAllIsWritten) {
    const auto second = std::make_shared<Speaker>("second", nullptr);
    const auto first = std::make_shared<Speaker>("first", second);
    Bytes scratch;
    Channel channel(first, nullptr, scratch);
    EXPECT_EQ(said(channel), "first");
    channel.wrote(2);
    EXPECT_EQ(said(channel), "rst");
    EXPECT_EQ(&channel.protocol(), first.get());
    EXPECT_TRUE(channel.receive(bytes_of("a")));
    channel.wrote(3);
    EXPECT_FALSE(channel.has_output());
    EXPECT_EQ(said(channel), "second");
    EXPECT_EQ(&channel.protocol(), second.get());
    EXPECT_TRUE(channel.receive(bytes_of("b")));
    channel.wrote(6);
    EXPECT_EQ(said(channel), "");
    EXPECT_TRUE(channel.farewell().empty());
    EXPECT_EQ(first->heard, "a");
    EXPECT_EQ(second->heard, "b");
}

TEST(Channel, AProtocolThatClosesHearsNoMore) {
    const auto speaker = std::make_shared<Speaker>("bye", nullptr);
    Bytes scratch;
    Channel channel(speaker, nullptr, scratch);
    speaker->closing = true;
    EXPECT_TRUE(channel.receive(bytes_of("more")));
    EXPECT_EQ(speaker->heard, "");
    EXPECT_EQ(said(channel), "bye");
}

}  // namespace
}  // namespace terrane
